#pragma once

#include "dicom_codecs.hpp"

namespace palpate::imaging::reading {

/// Decodes one frame of JPEG or JPEG 2000 by GDCM, which may end the process where a stream is
/// damaged. `frame` comes with its shape and is filled; false where it refuses.
/// Not JPEG-LS: CharLS of GDCM and that of DCMTK export the same names, and a
/// process gets one of the two (see CMakeLists.txt).
bool decode_by_gdcm(FrameCoding coding, const std::vector<std::uint8_t>& stream, const FrameShape& shape,
                    int precision, CodedFrame& frame);

}  // namespace palpate::imaging::reading
