#include "inflate.hpp"
#include "itk_image.hpp"
#include "text_header.hpp"

#include <itkNrrdImageIO.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;

struct NrrdHeader {
  std::map<std::string, std::string> fields;  ///< names in lower case
  std::uint64_t bytes = 0;
  bool tracked = false;  ///< a sequence of tracked ultrasound, whose image is in pixels
  bool has(const std::string& key) const { return fields.count(key) != 0; }
  std::string at(const std::string& key) const {
    const auto found = fields.find(key);
    return found == fields.end() ? std::string() : found->second;
  }
};

NrrdHeader read_header(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) fail("not-found", path, "cannot be opened. Check that it is there and may be read.");
  NrrdHeader header;
  constexpr std::uint64_t longest = 64U << 20;
  std::string line;
  bool first = true;
  while (header.bytes < longest) {
    line.clear();
    char c = 0;
    while (line.size() < (1U << 20) && file.get(c) && c != '\n') line.push_back(c);
    if (line.empty() && !file) break;
    header.bytes += line.size() + 1;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (first) {
      if (line.compare(0, 7, "NRRD000") != 0) fail("bad-header", path, "does not begin like an NRRD file.");
      first = false;
      continue;
    }
    if (line.empty()) break;
    if (line.compare(0, 9, "Seq_Frame") == 0) header.tracked = true;
    const auto sign = line.find(':');
    if (line[0] == '#' || sign == std::string::npos || line.compare(sign, 2, ":=") == 0) continue;
    header.fields[lower_case(trimmed(line.substr(0, sign)))] = trimmed(line.substr(sign + 1));
  }
  if (first) fail("bad-header", path, "is empty.");
  return header;
}

std::vector<long long> sizes_of(const NrrdHeader& header, const std::filesystem::path& path) {
  const auto axes = whole_number(header.at("dimension"));
  if (!axes || *axes < 1 || *axes > 5)
    fail("bad-header", path,
         "says dimension: " + header.at("dimension").substr(0, 40) + "; 1 to 5 can be read.");
  std::vector<long long> sizes;
  for (const auto& word : words_of(header.at("sizes"))) {
    const auto size = whole_number(word);
    if (!size || *size < 1 || *size > (1LL << 31) - 1)
      fail("bad-header", path,
           "says sizes: " + header.at("sizes").substr(0, 60) + "; each must be at least 1.");
    sizes.push_back(*size);
  }
  if (sizes.size() != static_cast<std::size_t>(*axes))
    fail("bad-header", path,
         "gives " + std::to_string(sizes.size()) + " sizes for " + std::to_string(*axes) + " axes.");
  return sizes;
}

int bytes_of_type(const NrrdHeader& header, const std::filesystem::path& path) {
  static const std::map<std::string, int> bytes{{"signed char", 1},
                                                {"int8", 1},
                                                {"int8_t", 1},
                                                {"uchar", 1},
                                                {"unsigned char", 1},
                                                {"uint8", 1},
                                                {"uint8_t", 1},
                                                {"short", 2},
                                                {"short int", 2},
                                                {"signed short", 2},
                                                {"signed short int", 2},
                                                {"int16", 2},
                                                {"int16_t", 2},
                                                {"ushort", 2},
                                                {"unsigned short", 2},
                                                {"unsigned short int", 2},
                                                {"uint16", 2},
                                                {"uint16_t", 2},
                                                {"int", 4},
                                                {"signed int", 4},
                                                {"int32", 4},
                                                {"int32_t", 4},
                                                {"uint", 4},
                                                {"unsigned int", 4},
                                                {"uint32", 4},
                                                {"uint32_t", 4},
                                                {"longlong", 8},
                                                {"long long", 8},
                                                {"long long int", 8},
                                                {"signed long long", 8},
                                                {"signed long long int", 8},
                                                {"int64", 8},
                                                {"int64_t", 8},
                                                {"ulonglong", 8},
                                                {"unsigned long long", 8},
                                                {"unsigned long long int", 8},
                                                {"uint64", 8},
                                                {"uint64_t", 8},
                                                {"float", 4},
                                                {"double", 8}};
  const auto found = bytes.find(header.at("type"));
  if (found == bytes.end())
    fail("unsupported", path,
         "has voxels of type \"" + header.at("type").substr(0, 40) + "\", which cannot be read.");
  return found->second;
}

void check_data(const NrrdHeader& header, const std::filesystem::path& path, double needed) {
  const std::string name = header.has("data file") ? header.at("data file") : header.at("datafile");
  std::filesystem::path data = path;
  if (!name.empty()) {
    if (name.compare(0, 4, "LIST") == 0 || name.find('%') != std::string::npos)
      fail("unsupported", path, "keeps its voxels in a list of files. Write one .nrrd file.");
    data = companion(path, name);
  }
  const std::uint64_t start = name.empty() ? header.bytes : 0;
  const auto file_bytes = static_cast<double>(std::filesystem::file_size(data));
  const std::string encoding = lower_case(header.at("encoding"));
  const bool skips =
      header.has("byte skip") || header.has("line skip") || header.has("byteskip") || header.has("lineskip");
  double there = std::max(0.0, file_bytes - static_cast<double>(start));
  if (encoding == "gz" || encoding == "gzip") {
    if (skips) return;
    const Inflated inflated = inflate_and_count(data, start, 0, static_cast<std::uint64_t>(needed));
    there = static_cast<double>(inflated.bytes);
  } else if (encoding != "raw") {
    return;  // text, hex and bzip2 are counted by the library itself
  }
  if (there < needed)
    fail("truncated", path,
         "holds " + std::to_string(static_cast<long long>(there)) +
             " bytes of voxels where its header speaks of " + std::to_string(static_cast<long long>(needed)) +
             ". It was cut off: copy or export it again.");
}

/// Which axis is time or a list, and whether components are a colour.
Layout layout_of(const NrrdHeader& header, const std::vector<long long>& sizes) {
  Layout layout;
  const auto kinds = words_of(lower_case(header.at("kinds")));
  const auto spacings = words_of(header.at("spacings"));
  int domains = 0;
  for (std::size_t axis = 0; axis < kinds.size() && axis < sizes.size(); ++axis) {
    const std::string& kind = kinds[axis];
    const bool domain =
        kind == "domain" || kind == "space" || kind == "time" || kind == "???" || kind == "none";
    if (kind == "list") layout.components_are_frames = true;
    if (kind == "time") {
      const auto step = axis < spacings.size() ? number(spacings[axis]) : std::nullopt;
      if (step && std::isfinite(*step) && *step > 0.0) layout.frame_spacing_s = *step;
      if (domains == 2) layout.k_is_time = true;
    }
    if (kind.find("matrix") != std::string::npos || kind == "quaternion") layout.colour = false;
    if (domain) ++domains;
  }
  return layout;
}

}  // namespace

Parsed parse_nrrd(const std::filesystem::path& path, const Context& context) {
  const NrrdHeader header = read_header(path);
  const auto sizes = sizes_of(header, path);
  double needed = bytes_of_type(header, path);
  for (const auto size : sizes) needed *= static_cast<double>(size);
  check_memory(path, needed, 0.0, context);
  check_data(header, path, needed);

  core::VolumeInfo info;
  info.format = "NRRD";
  const bool spaced = !header.tracked && (header.has("space directions") || header.has("spacings"));
  info.spacing_provenance.fill(spaced ? Provenance::stated : Provenance::assumed);
  const Layout layout = layout_of(header, sizes);
  std::size_t space_axes = sizes.size();
  for (const auto& kind : words_of(lower_case(header.at("kinds"))))
    if (kind != "domain" && kind != "space" && kind != "???" && kind != "none" && space_axes > 0)
      --space_axes;
  if (space_axes < 3) info.spacing_provenance[2] = Provenance::assumed;
  // Without a named space the axes are taken as they are, and nobody said so.
  const auto placed = header.has("space") ? Provenance::stated : Provenance::assumed;
  info.origin_provenance = header.has("space origin") ? placed : Provenance::absent;
  info.direction_provenance = header.has("space directions") ? placed : Provenance::absent;
  const auto io = itk::NrrdImageIO::New();
  return read_through(*io, path, std::move(info), layout, context);
}

}  // namespace palpate::imaging::reading
