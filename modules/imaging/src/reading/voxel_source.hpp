#pragma once

#include "voxel_type.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

namespace palpate::imaging::reading {

/// How voxels are packed. Text comes out as float64, whatever the file's type.
enum class Encoding { raw, deflate, bzip2, text, hex };

/// A file that holds voxels, all or some.
struct VoxelFile {
  std::filesystem::path path;
  std::uint64_t offset = 0;  ///< where they begin, packed or not
  std::uint64_t length = 0;  ///< of what is packed; 0: to the file's end
};

/// The bytes of one file, unpacked, from the first to the last.
class VoxelSource {
 public:
  virtual ~VoxelSource() = default;
  /// As many as there are, at most `count`.
  virtual std::size_t read(char* to, std::size_t count) = 0;
  /// Passes over as many as there are, at most `count`.
  virtual std::uint64_t skip(std::uint64_t count);
  /// Whether the packed stream was sound so far.
  virtual bool sound() const { return true; }
};

/// `header` is the file that errors name; `type` that of the numbers in a text.
std::unique_ptr<VoxelSource> open_source(const std::filesystem::path& header, const VoxelFile& file,
                                         Encoding encoding, VoxelType type);

}  // namespace palpate::imaging::reading
