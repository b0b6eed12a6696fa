#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace palpate::imaging::reading {

/// How a number of a voxel is stored in a file.
enum class VoxelType { uint8, int8, uint16, int16, uint32, int32, uint64, int64, float32, float64 };
/// "uint8", "int16", "float32", ...
std::string name_of(VoxelType type);
std::size_t bytes_of(VoxelType type);
bool is_whole(VoxelType type);
/// Whether such a type can hold the value (any, infinite or no number, where it is a float).
bool holds(VoxelType type, double value);

/// How the numbers of a voxel become one grey number.
enum class GreyRule {
  only,       ///< there is one number
  luma,       ///< R, G, B and perhaps A, which is ignored: Rec. 601, 0.299 R + 0.587 G + 0.114 B
  magnitude,  ///< complex numbers
};

/// Where the numbers of one frame lie, in numbers from the frame's first.
struct Strides {
  std::array<std::size_t, 3> axis{};
  std::size_t component = 1;
};

/// Turns the order of bytes around in each of `count` numbers.
void swap_bytes(VoxelType type, char* raw, std::size_t count);

/// `count` voxels that lie one after the other with their components together.
void to_grey(VoxelType type, GreyRule rule, const char* raw, std::size_t components, std::size_t count,
             float* grey);
/// A frame whose voxels lie anyhow.
void to_grey(VoxelType type, GreyRule rule, const char* raw, const Strides& strides,
             const std::array<int, 3>& dims, float* grey);

}  // namespace palpate::imaging::reading
