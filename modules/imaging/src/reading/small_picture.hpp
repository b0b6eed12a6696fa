#pragma once

#include "palpate/core/geometry.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// Grey pixels, top row first.
struct SmallPicture {
  static constexpr int most_px = 128;  ///< a side
  int width_px = 0, height_px = 0;
  std::vector<std::uint8_t> grey;
};

/// The middle slice of a volume with square pixels, dark to bright over what
/// most of its voxels hold.
SmallPicture small_picture(const float* voxels, const core::ImageGeometry& geometry);

/// Two digits a byte, as a message carries them.
std::string hex_of(const std::vector<std::uint8_t>& bytes);
/// None where the text is not made of such digits.
std::optional<std::vector<std::uint8_t>> bytes_of_hex(const std::string& text);

}  // namespace palpate::imaging::reading
