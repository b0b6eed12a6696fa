#include "meta_header.hpp"

#include "text_header.hpp"

#include <cmath>
#include <set>

namespace palpate::imaging::reading {
namespace {

namespace fs = std::filesystem;

/// Those that decide what comes out: to have two of one is to have none.
const std::set<std::string>& telling_keys() {
  static const std::set<std::string> keys{"NDims",
                                          "DimSize",
                                          "ElementType",
                                          "ElementNumberOfChannels",
                                          "ElementSpacing",
                                          "Offset",
                                          "Origin",
                                          "Position",
                                          "TransformMatrix",
                                          "ElementDataFile",
                                          "HeaderSize",
                                          "CompressedData",
                                          "CompressedDataSize",
                                          "BinaryData",
                                          "ElementSize",
                                          "Rotation",
                                          "Orientation",
                                          "BinaryDataByteOrderMSB"};
  return keys;
}

std::string shown(const std::string& text) { return text.size() > 60 ? text.substr(0, 60) + "..." : text; }

void take_line(MetaHeader& header, const fs::path& path, const std::string& line) {
  auto sign = line.find('=');
  if (sign == std::string::npos) sign = line.find(':');
  if (sign == std::string::npos || line.find('\0') != std::string::npos)
    fail("bad-header", path, "has a line in its header that is no \"Name = value\". It may be no MetaImage.");
  const std::string name = trimmed(line.substr(0, sign));
  const std::string value = trimmed(line.substr(sign + 1));
  const auto [place, added] = header.values.emplace(name, value);
  if (!added && place->second != value && telling_keys().count(name) != 0)
    fail("bad-header", path, "says " + name + " twice in its header, and not the same.");
}

VoxelType type_of(const MetaHeader& header, const fs::path& path) {
  static const std::map<std::string, VoxelType> types{
      {"MET_CHAR", VoxelType::int8},       {"MET_UCHAR", VoxelType::uint8},
      {"MET_SHORT", VoxelType::int16},     {"MET_USHORT", VoxelType::uint16},
      {"MET_INT", VoxelType::int32},       {"MET_UINT", VoxelType::uint32},
      {"MET_LONG", VoxelType::int32},      {"MET_ULONG", VoxelType::uint32},
      {"MET_LONG_LONG", VoxelType::int64}, {"MET_ULONG_LONG", VoxelType::uint64},
      {"MET_FLOAT", VoxelType::float32},   {"MET_DOUBLE", VoxelType::float64}};
  const auto type = types.find(header.at("ElementType"));
  if (type == types.end())
    fail("unsupported", path,
         "has voxels of type \"" + shown(header.at("ElementType")) + "\", which cannot be read.");
  return type->second;
}

std::vector<long long> sizes_of(const MetaHeader& header, const fs::path& path) {
  const auto axes = whole_number(header.at("NDims"));
  if (!axes || *axes < 1 || *axes > 4)
    fail("bad-header", path, "says NDims = " + shown(header.at("NDims")) + "; 1 to 4 are possible.");
  std::vector<long long> sizes;
  for (const auto& word : words_of(header.at("DimSize"))) {
    const auto size = whole_number(word);
    if (!size || *size < 1 || *size > (1LL << 31) - 1)
      fail(size && *size == 0 ? "no-image" : "bad-header", path,
           "says DimSize = " + shown(header.at("DimSize")) +
               "; each must be at least 1. There is no image in it.");
    sizes.push_back(*size);
  }
  if (sizes.size() != static_cast<std::size_t>(*axes))
    fail("bad-header", path,
         "gives " + std::to_string(sizes.size()) + " sizes for " + std::to_string(*axes) + " axes.");
  return sizes;
}

/// The files that a list or a pattern names: one for each entry of the axes
/// above those that a file holds, all but the last unless the header says.
std::vector<std::string> listed_files(const MetaHeader& header, const fs::path& path,
                                      const std::vector<long long>& sizes) {
  auto words = words_of(header.at("ElementDataFile"));
  const bool list = words.front() == "LIST";
  std::size_t axes_in_file = sizes.size() - 1;
  const auto take_axes = [&](std::string word) {
    if (!word.empty() && (word.back() == 'D' || word.back() == 'd')) word.pop_back();
    const auto axes = whole_number(word);
    if (!axes || *axes < 1 || *axes > static_cast<long long>(sizes.size()))
      fail("bad-header", path, "says that each of its data files has " + shown(word) + " axes.");
    axes_in_file = static_cast<std::size_t>(*axes);
  };
  if (list && words.size() > 2)
    fail("bad-header", path, "lists its data files in a way that makes no sense.");
  if (list && words.size() == 2) take_axes(words[1]);
  if (!list && words.size() == 5) take_axes(words[4]);
  double wanted = 1.0;
  for (std::size_t axis = axes_in_file; axis < sizes.size(); ++axis)
    wanted *= static_cast<double>(sizes[axis]);
  std::vector<std::string> names = header.list;
  if (!list) {
    std::array<long long, 3> range{1, static_cast<long long>(std::min(wanted, 1e9)), 1};
    for (std::size_t n = 0; n < 3 && n + 1 < words.size(); ++n) {
      const auto value = whole_number(words[n + 1]);
      if (!value || words.size() > 5)
        fail("bad-header", path, "names its data files by a pattern whose range is no numbers.");
      range[n] = *value;
      if (n == 0 && words.size() == 2) range[1] += *value - 1;
    }
    names = names_of_pattern(words.front(), range[0], range[1], range[2]);
    if (names.empty())
      fail("bad-header", path,
           "names its data files by a pattern that cannot be followed (" +
               shown(header.at("ElementDataFile")) + "); it must hold one %d, then first, last and step.");
  }
  if (static_cast<double>(names.size()) != wanted)
    fail("truncated", path,
         "lists " + std::to_string(names.size()) + " data files where its size asks for " +
             whole_text(wanted) + ". Put the missing ones back.");
  return names;
}

/// Where the voxels begin in a file.
void set_offset(const MetaHeader& header, const fs::path& path, bool local, double share, bool raw,
                VoxelFile& file) {
  const auto size = static_cast<double>(fs::file_size(file.path));
  file.offset = local ? header.bytes : 0;
  if (header.has("HeaderSize")) {
    const auto stated = whole_number(header.at("HeaderSize"));
    if (!stated || *stated < -1 || static_cast<double>(*stated) > size ||
        (local && *stated > 0 && static_cast<double>(*stated) < static_cast<double>(header.bytes)))
      fail("bad-header", path,
           "says HeaderSize = " + shown(header.at("HeaderSize")) + ", which does not fit its data file.");
    if (*stated > 0) file.offset = static_cast<std::uint64_t>(*stated);
    // Minus one: the voxels are the last bytes of the file.
    if (*stated == -1 && raw && size - share >= static_cast<double>(file.offset))
      file.offset = static_cast<std::uint64_t>(size - share);
  }
}

}  // namespace

std::string MetaHeader::at(const std::string& key) const {
  const auto found = values.find(key);
  return found == values.end() ? std::string() : found->second;
}

std::string MetaHeader::first_of(std::initializer_list<const char*> keys) const {
  for (const char* key : keys)
    if (has(key)) return key;
  return {};
}

bool MetaHeader::yes(const std::string& key) const {
  const std::string value = lower_case(at(key));
  return !value.empty() && (value[0] == 't' || value[0] == '1' || value[0] == 'y');
}

MetaHeader read_meta_header(const fs::path& path) {
  HeaderLines lines(path);
  MetaHeader header;
  while (const auto line = lines.next()) {
    if (trimmed(*line).empty()) continue;
    take_line(header, path, *line);
    header.bytes = lines.position();
    if (!header.has("ElementDataFile")) continue;
    const auto words = words_of(header.at("ElementDataFile"));
    if (words.empty()) fail("bad-header", path, "names no data file.");
    constexpr std::size_t most_files = 1000000;
    if (words.front() == "LIST")
      while (const auto name = lines.next()) {
        if (!trimmed(*name).empty()) header.list.push_back(trimmed(*name));
        if (header.list.size() > most_files) fail("bad-header", path, "lists too many data files.");
      }
    return header;
  }
  fail("bad-header", path, "has no ElementDataFile in its header: it is truncated or no MetaImage.");
}

std::vector<double> numbers_of(const MetaHeader& header, const fs::path& path, const std::string& key,
                               std::size_t least) {
  std::vector<double> values;
  if (!header.has(key)) return values;
  for (const auto& word : words_of(header.at(key))) {
    const auto value = number(word);
    if (!value || !std::isfinite(*value))
      fail("bad-header", path,
           "says " + key + " = " + shown(header.at(key)) + "; finite numbers are needed.");
    values.push_back(*value);
  }
  if (values.size() < least)
    fail("bad-header", path,
         "says " + key + " = " + shown(header.at(key)) + "; " + std::to_string(least) +
             " numbers are needed.");
  return values;
}

RawImage raw_image_of(const MetaHeader& header, const fs::path& path, bool frames_last) {
  RawImage image;
  const std::string object = header.at("ObjectType");
  if (!object.empty() && object != "Image")
    fail("unsupported", path, "holds an object of type \"" + shown(object) + "\", which is no image.");
  const auto sizes = sizes_of(header, path);
  image.type = type_of(header, path);
  long long channels = 1;
  if (header.has("ElementNumberOfChannels")) {
    const auto stated = whole_number(header.at("ElementNumberOfChannels"));
    if (!stated || *stated < 1 || *stated > 4)
      fail("bad-header", path,
           "says ElementNumberOfChannels = " + shown(header.at("ElementNumberOfChannels")) +
               "; 1 to 4 can be read.");
    if (*stated == 2)
      fail("unsupported", path, "holds 2 numbers in each voxel, which are no colour. Export a grey scan.");
    channels = *stated;
  }
  image.axes.push_back({channels, Role::component});
  if (channels > 1) image.rule = GreyRule::luma;
  constexpr std::array<Role, 4> roles{Role::i, Role::j, Role::k, Role::frame};
  for (std::size_t axis = 0; axis < sizes.size(); ++axis)
    image.axes.push_back({sizes[axis], frames_last && axis + 1 == sizes.size() ? Role::frame : roles[axis]});
  image.big_endian = header.yes(header.first_of({"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}));
  const bool packed = header.yes("CompressedData");
  if (packed)
    image.encoding = Encoding::deflate;
  else if (header.has("BinaryData") && !header.yes("BinaryData"))
    image.encoding = Encoding::text;

  const std::string value = header.at("ElementDataFile");
  const auto words = words_of(value);
  const bool local = lower_case(value) == "local";
  const bool many = words.front() == "LIST" || words.front().find('%') != std::string::npos;
  if (local)
    image.files.push_back({path});
  else if (many)
    for (const auto& name : listed_files(header, path, sizes)) image.files.push_back({companion(path, name)});
  else
    image.files.push_back({companion(path, value)});
  image.files_must_fit = many;
  const double share = bytes_of_voxels(image) / static_cast<double>(image.files.size());
  for (VoxelFile& file : image.files)
    set_offset(header, path, local, share, image.encoding == Encoding::raw, file);
  if (packed && !many && header.has("CompressedDataSize")) {
    const auto stated = whole_number(header.at("CompressedDataSize"));
    if (!stated || *stated < 0) fail("bad-header", path, "has an unusable CompressedDataSize.");
    image.files.front().length = static_cast<std::uint64_t>(*stated);
  }
  return image;
}

bool is_tracked(const MetaHeader& header) {
  const auto first = header.values.lower_bound("Seq_Frame");
  return first != header.values.end() && first->first.compare(0, 9, "Seq_Frame") == 0;
}

std::vector<double> tracked_times(const MetaHeader& header, long long frames) {
  // Four digits or more, as the program that wrote it saw fit.
  std::map<long long, double> stamps;
  for (auto field = header.values.lower_bound("Seq_Frame");
       field != header.values.end() && field->first.compare(0, 9, "Seq_Frame") == 0; ++field) {
    const auto line = field->first.find('_', 9);
    if (line == std::string::npos || field->first.substr(line) != "_Timestamp") continue;
    const auto frame = whole_number(field->first.substr(9, line - 9));
    const auto time = number(field->second);
    if (frame && time && std::isfinite(*time)) stamps[*frame] = *time;
  }
  std::vector<double> times;
  for (long long frame = 0; frame < frames; ++frame) {
    const auto stamp = stamps.find(frame);
    if (stamp == stamps.end()) return {};
    times.push_back(stamp->second - stamps[0]);
  }
  return times;
}

}  // namespace palpate::imaging::reading
