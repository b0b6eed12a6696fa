#pragma once

#include "raw_image.hpp"

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

struct NrrdHeader {
  std::map<std::string, std::string> fields;  ///< names in lower case without blanks
  std::map<std::string, std::string> keys;    ///< what is written as key:=value
  std::vector<std::string> list;              ///< the file names below "data file: LIST"
  std::uint64_t bytes = 0;                    ///< its length, where the voxels follow it
  bool has(const std::string& field) const { return fields.count(field) != 0; }
  std::string at(const std::string& field) const;
};

NrrdHeader read_nrrd_header(const std::filesystem::path& path);

/// One axis of the file, as it is described.
struct NrrdAxis {
  long long size = 1;
  std::string kind;                              ///< in lower case; empty where it is not said
  std::optional<std::vector<double>> direction;  ///< in the space; none for an axis that is not in it
  std::optional<double> spacing, min, max;
  std::string unit;
  bool cells = true;  ///< min and max are the outer borders, not the outer samples
};
/// From the fastest to the slowest. Throws where the fields do not fit one another.
std::vector<NrrdAxis> nrrd_axes(const NrrdHeader& header, const std::filesystem::path& path);
/// "(1,0,0)" and the like, one after the other; none for "none".
std::vector<std::optional<std::vector<double>>> nrrd_vectors(const std::string& text,
                                                             const std::filesystem::path& path);
/// The words of a text, of which some stand in quotes.
std::vector<std::string> quoted_words(const std::string& text);

/// Type, packing and files of the voxels; the axes are not set yet.
RawImage nrrd_voxels(const NrrdHeader& header, const std::filesystem::path& path,
                     const std::vector<NrrdAxis>& axes);

}  // namespace palpate::imaging::reading
