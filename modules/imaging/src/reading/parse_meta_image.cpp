#include "inflate.hpp"
#include "itk_image.hpp"
#include "text_header.hpp"

#include <itkMetaImageIO.h>

#include <cmath>
#include <fstream>
#include <map>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;

/// The text header, read strictly: MetaIO overruns its buffers on long words,
/// does not return on some values of NDims and accepts missing voxels.
struct MetaHeader {
  std::map<std::string, std::string> values;
  std::vector<std::string> list;  ///< the file names below ElementDataFile = LIST
  std::uint64_t bytes = 0;        ///< length of the header
  bool has(const std::string& key) const { return values.count(key) != 0; }
  std::string at(const std::string& key) const {
    const auto found = values.find(key);
    return found == values.end() ? std::string() : found->second;
  }
  bool yes(const std::string& key) const {
    const std::string value = lower_case(at(key));
    return !value.empty() && (value[0] == 't' || value[0] == '1' || value[0] == 'y');
  }
};

// MetaIO's own buffers: 500 characters for a line's value, 255 for its name,
// 80 for a word where a value is split into words.
constexpr std::size_t longest_value = 480;
constexpr std::size_t longest_name = 200;
constexpr std::size_t longest_word = 79;
constexpr std::uint64_t longest_header = 64U << 20;

MetaHeader read_header(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) fail("not-found", path, "cannot be opened. Check that it is there and may be read.");
  MetaHeader header;
  std::string line;
  while (header.bytes < longest_header) {
    line.clear();
    char c = 0;
    while (file.get(c) && c != '\n' && line.size() <= longest_name + longest_value) line.push_back(c);
    if (line.empty() && !file) break;
    header.bytes += line.size() + 1;
    const auto sign = line.find('=');
    if (trimmed(line).empty()) continue;
    if (sign == std::string::npos || line.find('\0') != std::string::npos)
      fail("bad-header", path,
           "has a line in its header that is no \"Name = value\". It may be no MetaImage.");
    const std::string name = trimmed(line.substr(0, sign));
    const std::string value = trimmed(line.substr(sign + 1));
    if (name.size() > longest_name || value.size() > longest_value)
      fail("bad-header", path, "has an over-long line in its header (" + name.substr(0, 40) + ").");
    if (!header.values.emplace(name, value).second)
      fail("bad-header", path, "says " + name + " twice in its header.");
    if (name == "ElementDataFile") {
      const std::string kind = words_of(value).empty() ? "" : words_of(value).front();
      while (kind == "LIST" && std::getline(file, line) && header.list.size() < 100000)
        if (!trimmed(line).empty()) header.list.push_back(trimmed(line));
      return header;
    }
  }
  fail("bad-header", path, "has no ElementDataFile in its header: it is truncated or no MetaImage.");
}

std::vector<double> numbers_of(const MetaHeader& header, const std::filesystem::path& path,
                               const std::string& key) {
  std::vector<double> values;
  for (const auto& word : words_of(header.at(key))) {
    const auto value = number(word);
    if (!value || !std::isfinite(*value))
      fail("bad-header", path, key + " holds \"" + word.substr(0, 40) + "\", which is no usable number.");
    values.push_back(*value);
  }
  return values;
}

struct MetaShape {
  std::vector<long long> dims;
  long long channels = 1;
  long long component_bytes = 1;
  double bytes = 0.0;  ///< of all voxels
};

MetaShape shape_of(const MetaHeader& header, const std::filesystem::path& path) {
  static const std::map<std::string, int> sizes{{"MET_CHAR", 1},       {"MET_UCHAR", 1}, {"MET_SHORT", 2},
                                                {"MET_USHORT", 2},     {"MET_INT", 4},   {"MET_UINT", 4},
                                                {"MET_LONG", 4},       {"MET_ULONG", 4}, {"MET_LONG_LONG", 8},
                                                {"MET_ULONG_LONG", 8}, {"MET_FLOAT", 4}, {"MET_DOUBLE", 8}};
  MetaShape shape;
  const auto axes = whole_number(header.at("NDims"));
  if (!axes || *axes < 1 || *axes > 4)
    fail("bad-header", path, "says NDims = " + header.at("NDims").substr(0, 40) + "; 1 to 4 are possible.");
  double voxels = 1.0;
  for (const auto& word : words_of(header.at("DimSize"))) {
    const auto size = whole_number(word);
    if (!size || *size < 1 || *size > (1LL << 31) - 1)
      fail(size && *size == 0 ? "no-image" : "bad-header", path,
           "says DimSize = " + header.at("DimSize").substr(0, 60) +
               "; each must be at least 1. There is no image in it.");
    shape.dims.push_back(*size);
    voxels *= static_cast<double>(*size);
  }
  if (shape.dims.size() != static_cast<std::size_t>(*axes))
    fail("bad-header", path,
         "gives " + std::to_string(shape.dims.size()) + " sizes for " + std::to_string(*axes) + " axes.");
  if (header.has("ElementNumberOfChannels")) {
    const auto channels = whole_number(header.at("ElementNumberOfChannels"));
    if (!channels || *channels < 1 || *channels > 4)
      fail("bad-header", path,
           "says ElementNumberOfChannels = " + header.at("ElementNumberOfChannels").substr(0, 40) +
               "; 1 to 4 can be read.");
    shape.channels = *channels;
  }
  const auto type = sizes.find(header.at("ElementType"));
  if (type == sizes.end())
    fail("unsupported", path,
         "has voxels of type \"" + header.at("ElementType").substr(0, 40) + "\", which cannot be read.");
  shape.component_bytes = type->second;
  shape.bytes = voxels * static_cast<double>(shape.channels * shape.component_bytes);
  return shape;
}

void check_geometry(const MetaHeader& header, const std::filesystem::path& path, std::size_t axes) {
  for (const char* key : {"ElementSpacing", "ElementSize"}) {
    if (!header.has(key)) continue;
    const auto values = numbers_of(header, path, key);
    if (values.size() < axes)
      fail("bad-header", path, std::string(key) + " has fewer numbers than there are axes.");
    for (const double value : values)
      if (!(value > 0.0))
        fail("bad-header", path,
             std::string(key) + " = " + header.at(key) + "; positive numbers are needed.");
  }
  for (const char* key : {"Offset", "Origin", "Position"})
    if (header.has(key) && numbers_of(header, path, key).size() < axes)
      fail("bad-header", path, std::string(key) + " has fewer numbers than there are axes.");
  for (const char* key : {"TransformMatrix", "Rotation", "Orientation"})
    if (header.has(key) && numbers_of(header, path, key).size() < axes * axes)
      fail("bad-header", path, std::string(key) + " has fewer numbers than a matrix of its axes.");
}

[[noreturn]] void fail_truncated(const std::filesystem::path& path, double there, double needed) {
  fail("truncated", path,
       "holds " + std::to_string(static_cast<long long>(there)) +
           " bytes of voxels where its header speaks of " + std::to_string(static_cast<long long>(needed)) +
           ". It was cut off: copy or export it again.");
}

/// Numbers as text: MetaIO takes any word for a number and does not count them.
void check_text_voxels(const MetaShape& shape, const std::filesystem::path& header_path,
                       const std::filesystem::path& data, std::uint64_t offset) {
  std::ifstream file(data, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(offset));
  const double needed = shape.bytes / static_cast<double>(shape.component_bytes);
  double count = 0;
  for (std::string word; count < needed && file >> word; ++count)
    if (!number(word))
      fail("bad-header", header_path,
           "holds \"" + word.substr(0, 20) + "\" among its voxels, which is no number.");
  if (count < needed)
    fail("truncated", header_path,
         "holds " + std::to_string(static_cast<long long>(count)) + " numbers where its header speaks of " +
             std::to_string(static_cast<long long>(needed)) + ".");
}

/// Compares the bytes that are there with those that the header speaks of.
void check_data(const MetaHeader& header, const MetaShape& shape, const std::filesystem::path& path,
                bool local, const std::filesystem::path& data, double needed, const ReadOptions& options,
                core::VolumeInfo& info) {
  const double file_bytes = static_cast<double>(std::filesystem::file_size(data));
  const std::uint64_t start = local ? header.bytes : 0;
  const double behind = std::max(0.0, file_bytes - static_cast<double>(start));
  if (header.yes("CompressedData")) {
    std::uint64_t length = 0;
    if (header.has("CompressedDataSize")) {
      const auto stated = whole_number(header.at("CompressedDataSize"));
      if (!stated || *stated < 1) fail("bad-header", path, "has an unusable CompressedDataSize.");
      if (static_cast<double>(*stated) > behind) fail_truncated(path, behind, static_cast<double>(*stated));
      length = static_cast<std::uint64_t>(*stated);
    } else if (local) {
      fail("bad-header", path,
           "is compressed but has no CompressedDataSize in its header. Write it again, uncompressed.");
    }
    const Inflated inflated = inflate_and_count(data, start, length, static_cast<std::uint64_t>(needed));
    if (static_cast<double>(inflated.bytes) != needed || !inflated.whole)
      fail_truncated(path, static_cast<double>(inflated.bytes), needed);
    return;
  }
  if (header.has("BinaryData") && !header.yes("BinaryData"))
    return check_text_voxels(shape, path, data, start);
  double skipped = 0.0;
  if (header.has("HeaderSize")) {
    const auto stated = whole_number(header.at("HeaderSize"));
    if (!stated || *stated < -1 || static_cast<double>(*stated) > file_bytes)
      fail("bad-header", path, "has an unusable HeaderSize.");
    if (*stated > 0) skipped = static_cast<double>(*stated);
  }
  const double there = skipped > 0.0 ? file_bytes - skipped : behind;
  if (there >= needed) return;
  if (!options.allow_truncated) fail_truncated(path, there, needed);
  warn(info, "truncated", "The file was cut off; the voxels that are missing are black.");
}

void check_voxels(const MetaHeader& header, const MetaShape& shape, const std::filesystem::path& path,
                  const ReadOptions& options, core::VolumeInfo& info) {
  const std::string value = header.at("ElementDataFile");
  const auto words = words_of(value);
  if (words.empty()) fail("bad-header", path, "names no data file.");
  if (value == "LOCAL" || value == "Local" || value == "local")
    return check_data(header, shape, path, true, path, shape.bytes, options, info);
  if (words.front() == "LIST") {
    if (words.size() > 1) fail("unsupported", path, "lists its data files in a way that cannot be read.");
    const auto files = static_cast<std::size_t>(shape.dims.back());
    if (header.list.size() != files)
      fail("truncated", path,
           "lists " + std::to_string(header.list.size()) + " data files where its size asks for " +
               std::to_string(files) + ". Put the missing ones back.");
    for (const auto& name : header.list) {
      if (name.size() > longest_word || words_of(name).size() != 1)
        fail("unsupported", path, "lists a data file whose name is too long or holds a space.");
      check_data(header, shape, path, false, companion(path, name), shape.bytes / static_cast<double>(files),
                 options, info);
    }
    return;
  }
  if (words.size() > 1 || value.size() > longest_word || value.find('%') != std::string::npos)
    fail("unsupported", path,
         "names its data file by a pattern, or by a name that is too long or holds a space. Rename it, or "
         "write one .mha.");
  check_data(header, shape, path, false, companion(path, value), shape.bytes, options, info);
}

/// Tracked ultrasound: one time stamp a frame, in s. Times count from the first frame.
bool take_sequence(const MetaHeader& header, const MetaShape& shape, Layout& layout) {
  if (shape.dims.size() != 3) return false;
  const auto first = header.values.lower_bound("Seq_Frame");
  if (first == header.values.end() || first->first.compare(0, 9, "Seq_Frame") != 0) return false;
  layout.k_is_time = true;
  std::optional<double> start;
  for (long long frame = 0; frame < shape.dims[2]; ++frame) {
    std::string number_text = std::to_string(frame);
    if (number_text.size() < 4) number_text.insert(0, 4 - number_text.size(), '0');
    const auto time = number(header.at("Seq_Frame" + number_text + "_Timestamp"));
    if (!time || !std::isfinite(*time)) {
      layout.frame_times_s.clear();
      break;
    }
    if (!start) start = time;
    layout.frame_times_s.push_back(*time - *start);
  }
  return true;
}

}  // namespace

Parsed parse_meta_image(const std::filesystem::path& path, const Context& context) {
  const MetaHeader header = read_header(path);
  const MetaShape shape = shape_of(header, path);
  check_geometry(header, path, shape.dims.size());
  core::VolumeInfo info;
  info.format = "MetaImage";
  // Before something is inflated only to be counted.
  if (header.yes("CompressedData")) check_memory(path, shape.bytes, 0.0, context);
  check_voxels(header, shape, path, context.options, info);

  Layout layout;
  const char* spacing_key = header.has("ElementSpacing") ? "ElementSpacing" : "ElementSize";
  const auto spacing = numbers_of(header, path, spacing_key);
  const bool tracked = take_sequence(header, shape, layout);
  // Tracked sequences write 1 1 1, their image being in pixels: that is no statement.
  const bool ones = tracked && spacing.size() == 3 && spacing == std::vector<double>{1.0, 1.0, 1.0};
  const auto provenance = spacing.empty() || ones ? Provenance::assumed : Provenance::stated;
  info.spacing_provenance = {provenance, provenance,
                             tracked || shape.dims.size() < 3 ? Provenance::assumed : provenance};
  const auto any = [&](std::initializer_list<const char*> keys) {
    for (const char* key : keys)
      if (header.has(key)) return Provenance::stated;
    return Provenance::absent;
  };
  info.origin_provenance = any({"Offset", "Origin", "Position"});
  info.direction_provenance = any({"TransformMatrix", "Rotation", "Orientation"});
  if (shape.dims.size() == 4 && spacing.size() == 4) layout.frame_spacing_s = spacing[3];
  const auto io = itk::MetaImageIO::New();
  return read_through(*io, path, std::move(info), layout, context);
}

}  // namespace palpate::imaging::reading
