#pragma once

#include "parsed.hpp"
#include "voxel_source.hpp"
#include "voxel_type.hpp"

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace palpate::imaging::reading {

/// What an axis of the file stands for.
enum class Role { i, j, k, frame, component, single };

struct FileAxis {
  long long size = 1;
  Role role = Role::single;
};

/// Voxels as they lie in the files. `axes` begin with the fastest; an axis
/// `single` has one entry only.
struct RawImage {
  VoxelType type = VoxelType::uint8;
  bool big_endian = false;
  Encoding encoding = Encoding::raw;
  std::vector<VoxelFile> files;     ///< each holds an equal share, one after the other
  bool files_must_fit = false;      ///< a raw file of another size than its share is refused
  std::uint64_t skipped_bytes = 0;  ///< at the start of each file, after unpacking
  std::vector<FileAxis> axes;
  GreyRule rule = GreyRule::only;
  double slope = 1.0, intercept = 0.0;  ///< grey = slope x number + intercept; not for colour
};

/// The sizes that the axes stand for.
std::array<int, 3> dims_of(const RawImage& image);
/// Throws Error(input, "too-large") where there are more than can be shown.
int frames_of(const std::filesystem::path& path, const RawImage& image);
double bytes_of_voxels(const RawImage& image);

/// Reads the frames that are asked for, and no more of the files than that
/// takes. `info` comes with everything but what the voxels say. Throws
/// Error(input): "truncated" where a file holds less than its header speaks of
/// (a warning with options.allow_truncated), "too-large" before anything is
/// allocated, "bad-header".
Parsed read_raw(const std::filesystem::path& path, const RawImage& image, core::VolumeInfo info,
                const Context& context);

}  // namespace palpate::imaging::reading
