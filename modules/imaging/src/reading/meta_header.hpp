#pragma once

#include "raw_image.hpp"

#include "palpate/core/volume.hpp"

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// The text header of a MetaImage, read strictly.
struct MetaHeader {
  std::map<std::string, std::string> values;
  std::vector<std::string> list;  ///< the file names below ElementDataFile = LIST
  std::uint64_t bytes = 0;        ///< its length, where the voxels follow it
  bool has(const std::string& key) const { return values.count(key) != 0; }
  std::string at(const std::string& key) const;
  /// The first of these keys that is there, or an empty text.
  std::string first_of(std::initializer_list<const char*> keys) const;
  bool yes(const std::string& key) const;
};

MetaHeader read_meta_header(const std::filesystem::path& path);

/// The numbers behind a key, `least` of them at least where the key is there.
std::vector<double> numbers_of(const MetaHeader& header, const std::filesystem::path& path,
                               const std::string& key, std::size_t least);

/// Size, kind and place of the voxels. The axes are i, j, k and frames, in this
/// order; with `frames_last` the last of three is frames.
RawImage raw_image_of(const MetaHeader& header, const std::filesystem::path& path, bool frames_last);

/// A sequence of tracked ultrasound has fields for each frame.
bool is_tracked(const MetaHeader& header);
/// The times of these frames in s, from the first on; none where one is missing.
std::vector<double> tracked_times(const MetaHeader& header, long long frames);

}  // namespace palpate::imaging::reading
