#pragma once

#include "settle.hpp"

#include <itkImageIOBase.h>

#include <cstddef>
#include <string>

namespace palpate::imaging::reading {

/// "uint8", "int16", "float32", ...; empty for what cannot be turned to grey.
std::string pixel_type_name(itk::IOComponentEnum type);
std::size_t component_bytes(itk::IOComponentEnum type);

/// How the components of a voxel become one grey number.
enum class Mix {
  grey,       ///< one component
  colour,     ///< R, G, B and perhaps A, which is ignored: Rec. 601 luma, 0.299 R + 0.587 G + 0.114 B
  magnitude,  ///< complex numbers
  pick        ///< the components are frames: each is grey of its own
};

/// Turns `count` voxels to 32-bit float; `pick` chooses the component for Mix::pick.
void to_grey(const void* raw, itk::IOComponentEnum type, std::size_t components, Mix mix, std::size_t pick,
             std::size_t count, float* grey);

}  // namespace palpate::imaging::reading
