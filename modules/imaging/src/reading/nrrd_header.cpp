#include "nrrd_header.hpp"

#include "text_header.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace palpate::imaging::reading {
namespace {

namespace fs = std::filesystem;

std::string shown(const std::string& text) { return text.size() > 60 ? text.substr(0, 60) + "..." : text; }

/// Names are written with blanks and without: "data file", "datafile".
std::string field_name(const std::string& text) {
  std::string name = lower_case(text);
  name.erase(std::remove_if(name.begin(), name.end(), [](char c) { return c == ' ' || c == '\t'; }),
             name.end());
  if (name == "centerings") return "centers";
  return name;
}

void take_line(NrrdHeader& header, const fs::path& path, const std::string& line) {
  if (line[0] == '#') return;
  const auto colon = line.find(':');
  if (colon == std::string::npos)
    fail("bad-header", path, "has a line in its header that is no \"field: value\" (" + shown(line) + ").");
  if (line.compare(colon, 2, ":=") == 0) {
    header.keys[line.substr(0, colon)] = trimmed(line.substr(colon + 2));
    return;
  }
  const std::string name = field_name(line.substr(0, colon));
  const std::string value = trimmed(line.substr(colon + 1));
  const auto [place, added] = header.fields.emplace(name, value);
  if (!added && place->second != value)
    fail("bad-header", path, "says " + name + " twice in its header, and not the same.");
}

VoxelType type_of(const NrrdHeader& header, const fs::path& path) {
  static const std::map<std::string, VoxelType> types{{"signed char", VoxelType::int8},
                                                      {"int8", VoxelType::int8},
                                                      {"int8_t", VoxelType::int8},
                                                      {"uchar", VoxelType::uint8},
                                                      {"unsigned char", VoxelType::uint8},
                                                      {"uint8", VoxelType::uint8},
                                                      {"uint8_t", VoxelType::uint8},
                                                      {"short", VoxelType::int16},
                                                      {"short int", VoxelType::int16},
                                                      {"signed short", VoxelType::int16},
                                                      {"signed short int", VoxelType::int16},
                                                      {"int16", VoxelType::int16},
                                                      {"int16_t", VoxelType::int16},
                                                      {"ushort", VoxelType::uint16},
                                                      {"unsigned short", VoxelType::uint16},
                                                      {"unsigned short int", VoxelType::uint16},
                                                      {"uint16", VoxelType::uint16},
                                                      {"uint16_t", VoxelType::uint16},
                                                      {"int", VoxelType::int32},
                                                      {"signed int", VoxelType::int32},
                                                      {"int32", VoxelType::int32},
                                                      {"int32_t", VoxelType::int32},
                                                      {"uint", VoxelType::uint32},
                                                      {"unsigned int", VoxelType::uint32},
                                                      {"uint32", VoxelType::uint32},
                                                      {"uint32_t", VoxelType::uint32},
                                                      {"longlong", VoxelType::int64},
                                                      {"long long", VoxelType::int64},
                                                      {"long long int", VoxelType::int64},
                                                      {"signed long long", VoxelType::int64},
                                                      {"signed long long int", VoxelType::int64},
                                                      {"int64", VoxelType::int64},
                                                      {"int64_t", VoxelType::int64},
                                                      {"ulonglong", VoxelType::uint64},
                                                      {"unsigned long long", VoxelType::uint64},
                                                      {"unsigned long long int", VoxelType::uint64},
                                                      {"uint64", VoxelType::uint64},
                                                      {"uint64_t", VoxelType::uint64},
                                                      {"float", VoxelType::float32},
                                                      {"double", VoxelType::float64}};
  const auto found = types.find(lower_case(header.at("type")));
  if (found == types.end())
    fail("unsupported", path,
         "has voxels of type \"" + shown(header.at("type")) + "\", which cannot be read.");
  return found->second;
}

Encoding encoding_of(const NrrdHeader& header, const fs::path& path) {
  static const std::map<std::string, Encoding> encodings{
      {"raw", Encoding::raw},   {"gz", Encoding::deflate},  {"gzip", Encoding::deflate},
      {"bz2", Encoding::bzip2}, {"bzip2", Encoding::bzip2}, {"txt", Encoding::text},
      {"text", Encoding::text}, {"ascii", Encoding::text},  {"hex", Encoding::hex}};
  const auto found = encodings.find(lower_case(header.at("encoding")));
  if (found == encodings.end())
    fail("unsupported", path,
         "has voxels packed as \"" + shown(header.at("encoding")) + "\", which cannot be read.");
  return found->second;
}

std::vector<long long> sizes_of(const NrrdHeader& header, const fs::path& path) {
  const auto axes = whole_number(header.at("dimension"));
  if (!axes || *axes < 1 || *axes > 16)
    fail("bad-header", path, "says dimension: " + shown(header.at("dimension")) + "; 1 to 16 are possible.");
  std::vector<long long> sizes;
  for (const auto& word : words_of(header.at("sizes"))) {
    const auto size = whole_number(word);
    if (!size || *size < 1 || *size > (1LL << 31) - 1)
      fail("bad-header", path, "says sizes: " + shown(header.at("sizes")) + "; each must be at least 1.");
    sizes.push_back(*size);
  }
  if (sizes.size() != static_cast<std::size_t>(*axes))
    fail("bad-header", path,
         "gives " + std::to_string(sizes.size()) + " sizes for " + std::to_string(*axes) + " axes.");
  return sizes;
}

/// Names of the data files: none for voxels that follow the header.
std::vector<std::string> data_names(const NrrdHeader& header, const fs::path& path,
                                    const std::vector<NrrdAxis>& axes) {
  const std::string value = header.at("datafile");
  const auto words = words_of(value);
  if (words.empty()) return {};
  const bool list = words.front() == "LIST";
  // A pattern has its range behind it; a name may hold blanks.
  const bool pattern = !list && words.size() >= 4 && words.front().find('%') != std::string::npos;
  if (!list && !pattern) return {value};
  const std::size_t extra = list ? 1 : 4;  // where the axes of each file may be said
  std::size_t axes_in_file = axes.size() - 1;
  if (words.size() > extra) {
    const auto stated = whole_number(words[extra]);
    if (!stated || *stated < 1 || *stated > static_cast<long long>(axes.size()) || words.size() > extra + 1)
      fail("bad-header", path, "says data file: " + shown(value) + ", which makes no sense.");
    axes_in_file = static_cast<std::size_t>(*stated);
  }
  std::vector<std::string> names = header.list;
  if (pattern) {
    const auto first = whole_number(words[1]);
    const auto last = whole_number(words[2]);
    const auto step = whole_number(words[3]);
    if (first && last && step) names = names_of_pattern(words.front(), *first, *last, *step);
    if (names.empty())
      fail("bad-header", path,
           "names its data files by a pattern that cannot be followed (" + shown(value) + ").");
  }
  if (names.empty()) fail("truncated", path, "lists no data files.");
  double wanted = 1.0;
  for (std::size_t axis = axes_in_file; axis < axes.size(); ++axis)
    wanted *= static_cast<double>(axes[axis].size);
  // Files of all axes are slabs along the slowest.
  const bool slabs =
      axes_in_file == axes.size() && axes.back().size % static_cast<long long>(names.size()) == 0;
  if (static_cast<double>(names.size()) != wanted && !slabs)
    fail("truncated", path,
         "lists " + std::to_string(names.size()) + " data files where its sizes ask for " +
             whole_text(wanted) + ". Put the missing ones back.");
  return names;
}

long long skip_of(const NrrdHeader& header, const fs::path& path, const std::string& field, long long least) {
  if (!header.has(field)) return 0;
  const auto skip = whole_number(header.at(field));
  if (!skip || *skip < least || *skip > (1LL << 40))
    fail("bad-header", path, "has an unusable " + field + " (" + shown(header.at(field)) + ").");
  return *skip;
}

/// Where the line after so many begins.
std::uint64_t behind_lines(const fs::path& path, const VoxelFile& file, long long lines) {
  std::ifstream stream(file.path, std::ios::binary);
  stream.seekg(static_cast<std::streamoff>(file.offset));
  std::uint64_t place = file.offset;
  std::vector<char> block(65536);
  while (lines > 0) {
    stream.read(block.data(), static_cast<std::streamsize>(block.size()));
    const auto got = static_cast<std::size_t>(stream.gcount());
    if (got == 0) fail("truncated", path, "has fewer lines in its data file than are to be skipped.");
    for (std::size_t n = 0; n < got && lines > 0; ++n, ++place)
      if (block[n] == '\n') --lines;
  }
  return place;
}

template <typename Use>
void for_each_axis(const NrrdHeader& header, const fs::path& path, const std::string& field,
                   const std::vector<std::string>& words, std::vector<NrrdAxis>& axes, const Use& use) {
  if (!header.has(field)) return;
  if (words.size() != axes.size())
    fail("bad-header", path,
         "gives " + std::to_string(words.size()) + " " + field + " for " + std::to_string(axes.size()) +
             " axes.");
  for (std::size_t axis = 0; axis < axes.size(); ++axis) use(axes[axis], words[axis]);
}

}  // namespace

std::string NrrdHeader::at(const std::string& field) const {
  const auto found = fields.find(field);
  return found == fields.end() ? std::string() : found->second;
}

NrrdHeader read_nrrd_header(const fs::path& path) {
  HeaderLines lines(path);
  NrrdHeader header;
  const auto first = lines.next();
  if (!first) fail("bad-header", path, "is empty.");
  if (first->compare(0, 7, "NRRD000") != 0) fail("bad-header", path, "does not begin like an NRRD file.");
  while (const auto line = lines.next()) {
    if (line->empty()) break;
    take_line(header, path, *line);
    if (words_of(header.at("datafile")).empty() || words_of(header.at("datafile")).front() != "LIST")
      continue;
    constexpr std::size_t most_files = 1000000;
    while (const auto name = lines.next()) {
      if (!trimmed(*name).empty()) header.list.push_back(trimmed(*name));
      if (header.list.size() > most_files) fail("bad-header", path, "lists too many data files.");
    }
  }
  header.bytes = lines.position();
  return header;
}

std::vector<std::optional<std::vector<double>>> nrrd_vectors(const std::string& text, const fs::path& path) {
  std::vector<std::optional<std::vector<double>>> vectors;
  for (std::size_t at = text.find_first_not_of(" \t"); at < text.size();
       at = text.find_first_not_of(" \t", at)) {
    if (text[at] != '(') {
      const std::string word = text.substr(at, text.find_first_of(" \t", at) - at);
      if (word != "none") fail("bad-header", path, "has \"" + shown(word) + "\" among its vectors.");
      vectors.emplace_back();
      at += word.size();
      continue;
    }
    const auto end = text.find(')', at);
    if (end == std::string::npos)
      fail("bad-header", path, "has a vector without its end: " + shown(text) + ".");
    std::string inner = text.substr(at + 1, end - at - 1);
    std::replace(inner.begin(), inner.end(), ',', ' ');
    std::vector<double> vector;
    for (const auto& word : words_of(inner)) {
      const auto value = number(lower_case(word));
      if (!value) fail("bad-header", path, "has \"" + shown(word) + "\" in a vector.");
      vector.push_back(*value);
    }
    vectors.emplace_back(std::move(vector));
    at = end + 1;
  }
  return vectors;
}

std::vector<std::string> quoted_words(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t at = text.find_first_not_of(" \t"); at < text.size();
       at = text.find_first_not_of(" \t", at)) {
    const bool quoted = text[at] == '"';
    const std::size_t from = quoted ? at + 1 : at;
    const std::size_t to =
        std::min(text.size(), quoted ? text.find('"', from) : text.find_first_of(" \t", from));
    words.push_back(text.substr(from, to - from));
    at = std::min(text.size(), quoted ? to + 1 : to);
  }
  return words;
}

std::vector<NrrdAxis> nrrd_axes(const NrrdHeader& header, const fs::path& path) {
  std::vector<NrrdAxis> axes;
  for (const long long size : sizes_of(header, path)) axes.push_back({size, {}, {}, {}, {}, {}, {}, true});
  const auto words = [&](const char* field) { return words_of(header.at(field)); };
  const auto finite = [](const std::string& word) {
    const auto value = number(lower_case(word));
    return value && std::isfinite(*value) ? value : std::optional<double>();
  };
  for_each_axis(header, path, "kinds", words("kinds"), axes,
                [](NrrdAxis& axis, const std::string& word) { axis.kind = lower_case(word); });
  for_each_axis(header, path, "spacings", words("spacings"), axes,
                [&](NrrdAxis& axis, const std::string& word) { axis.spacing = finite(word); });
  for_each_axis(header, path, "axismins", words("axismins"), axes,
                [&](NrrdAxis& axis, const std::string& word) { axis.min = finite(word); });
  for_each_axis(header, path, "axismaxs", words("axismaxs"), axes,
                [&](NrrdAxis& axis, const std::string& word) { axis.max = finite(word); });
  for_each_axis(header, path, "centers", words("centers"), axes,
                [](NrrdAxis& axis, const std::string& word) { axis.cells = lower_case(word) != "node"; });
  for_each_axis(header, path, "units", quoted_words(header.at("units")), axes,
                [](NrrdAxis& axis, const std::string& word) { axis.unit = word; });
  if (header.has("spacedirections")) {
    const auto vectors = nrrd_vectors(header.at("spacedirections"), path);
    if (vectors.size() != axes.size())
      fail("bad-header", path,
           "gives " + std::to_string(vectors.size()) + " space directions for " +
               std::to_string(axes.size()) + " axes.");
    for (std::size_t axis = 0; axis < axes.size(); ++axis) {
      axes[axis].direction = vectors[axis];
      // (nan,nan,nan) is an older way to write none.
      if (vectors[axis] && std::all_of(vectors[axis]->begin(), vectors[axis]->end(),
                                       [](double value) { return std::isnan(value); }))
        axes[axis].direction.reset();
    }
  }
  return axes;
}

RawImage nrrd_voxels(const NrrdHeader& header, const fs::path& path, const std::vector<NrrdAxis>& axes) {
  RawImage image;
  image.type = type_of(header, path);
  image.encoding = encoding_of(header, path);
  const std::string endian = lower_case(header.at("endian"));
  const bool order_matters = bytes_of(image.type) > 1 && image.encoding != Encoding::text;
  if (order_matters && endian != "little" && endian != "big")
    fail("bad-header", path,
         "does not say whether the low or the high byte comes first (endian: little or big). Nothing was "
         "guessed: add that line, or export the scan again.");
  image.big_endian = endian == "big";
  const auto names = data_names(header, path, axes);
  for (const auto& name : names) image.files.push_back({companion(path, name)});
  if (names.empty()) image.files.push_back({path, header.bytes});
  image.files_must_fit = names.size() > 1;

  double share = static_cast<double>(bytes_of(image.type)) / static_cast<double>(image.files.size());
  for (const NrrdAxis& axis : axes) share *= static_cast<double>(axis.size);
  const long long lines = skip_of(header, path, "lineskip", 0);
  const long long bytes = skip_of(header, path, "byteskip", -1);
  for (VoxelFile& file : image.files) {
    if (lines > 0) file.offset = behind_lines(path, file, lines);
    if (bytes > 0 && (image.encoding == Encoding::raw || image.encoding == Encoding::hex ||
                      image.encoding == Encoding::text))
      file.offset += static_cast<std::uint64_t>(bytes);
    if (bytes != -1) continue;
    // Minus one: the voxels are the last bytes of the file.
    if (image.encoding != Encoding::raw)
      fail("unsupported", path, "looks for its voxels at the end of a packed file. Export it again as raw.");
    const auto size = static_cast<double>(fs::file_size(file.path));
    if (size - share >= static_cast<double>(file.offset))
      file.offset = static_cast<std::uint64_t>(size - share);
  }
  if (bytes > 0 && (image.encoding == Encoding::deflate || image.encoding == Encoding::bzip2))
    image.skipped_bytes = static_cast<std::uint64_t>(bytes);
  return image;
}

}  // namespace palpate::imaging::reading
