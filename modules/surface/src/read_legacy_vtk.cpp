#include "mesh_source.hpp"

#include <limits>

namespace palpate::surface {
namespace {

/// A legacy file, section by section. Binary numbers are big-endian.
class LegacyReader {
 public:
  explicit LegacyReader(const MeshSource& source) : source_(source), cursor_(source.bytes) {}

  MeshContents read() {
    const std::string version = lower_case(cursor_.line());
    if (version.find("vtk datafile") == std::string::npos) source_.damaged("it does not begin as a VTK file");
    contents_.stated_space = stated_space_in(cursor_.line());
    const std::string form = lower_case(cursor_.word());
    if (form != "ascii" && form != "binary") source_.damaged("it is neither ASCII nor BINARY");
    binary_ = form == "binary";
    if (lower_case(cursor_.word()) != "dataset") source_.damaged("it names no data set");
    const std::string kind = lower_case(cursor_.word());
    if (kind != "polydata")
      source_.unsupported("it holds a data set of the kind " + kind.substr(0, 40) + ", not POLYDATA");
    while (read_section()) {
    }
    for (const auto& cell : polygons_)
      if (!add_polygon(cell, contents_.vertices.size(), contents_)) refuse_cell();
    for (const auto& cell : strips_) add_strip(cell);
    if (contents_.triangles.empty() && others_ > 0)
      source_.no_polygons(contents_.vertices.size(), "it holds only points and lines");
    return std::move(contents_);
  }

 private:
  using Cells = std::vector<std::vector<std::int64_t>>;

  [[noreturn]] void refuse_cell() const { source_.damaged("a polygon names a point that is not there"); }

  /// False at the end, or where the data of points and cells begin.
  bool read_section() {
    const std::string section = lower_case(cursor_.word());
    if (section.empty() || section == "point_data" || section == "cell_data") return false;
    if (section == "points") {
      read_points();
    } else if (section == "polygons") {
      polygons_ = read_cells();
    } else if (section == "triangle_strips") {
      strips_ = read_cells();
    } else if (section == "vertices" || section == "lines") {
      others_ += read_cells().size();
    } else if (section == "metadata") {
      // Ends with an empty line.
      cursor_.line();
      while (!cursor_.at_end() && !cursor_.line().empty()) {
      }
    } else if (section == "field") {
      read_field();
    } else {
      source_.damaged("its section \"" + section.substr(0, 40) + "\" cannot be understood");
    }
    return true;
  }

  std::size_t count() {
    const auto value = integer_in(cursor_.word());
    // Every number takes a byte at least.
    if (!value || *value < 0 || static_cast<std::uint64_t>(*value) > source_.bytes.size())
      source_.damaged("a count near byte " + std::to_string(cursor_.position()) +
                      " is larger than the file can hold");
    return static_cast<std::size_t>(*value);
  }

  static std::size_t bytes_of(const std::string& type) {
    if (type == "double" || type == "vtktypeint64" || type == "vtktypeuint64" || type == "long" ||
        type == "unsigned_long" || type == "vtkidtype")
      return type == "vtkidtype" ? 4 : 8;  // the legacy writer puts ids down as int
    if (type == "float" || type == "int" || type == "unsigned_int" || type == "vtktypeint32") return 4;
    if (type == "short" || type == "unsigned_short") return 2;
    if (type == "char" || type == "unsigned_char" || type == "signed_char") return 1;
    return 0;
  }

  double binary_value(const char* bytes, const std::string& type) const {
    if (type == "float") return static_cast<double>(binary_number<float>(bytes, true));
    if (type == "double") return binary_number<double>(bytes, true);
    switch (bytes_of(type)) {
      case 1:
        return binary_number<std::int8_t>(bytes, true);
      case 2:
        return binary_number<std::int16_t>(bytes, true);
      case 4:
        return binary_number<std::int32_t>(bytes, true);
      default:
        return static_cast<double>(binary_number<std::int64_t>(bytes, true));
    }
  }

  /// `count` numbers of a type; what is read is given to take(index, value).
  template <typename Take>
  void values(std::size_t count, const std::string& type, Take take) {
    const std::size_t bytes = bytes_of(type);
    if (bytes == 0) source_.unsupported("it holds values of the type " + type.substr(0, 40));
    if (!binary_) {
      for (std::size_t n = 0; n < count; ++n) {
        const auto value = number_in(cursor_.word());
        if (!value) source_.damaged("a number is missing near byte " + std::to_string(cursor_.position()));
        take(n, *value);
      }
      return;
    }
    cursor_.line();
    if (count > cursor_.left() / bytes) source_.damaged("it ends before its last number");
    const char* start = source_.bytes.data() + cursor_.position();
    for (std::size_t n = 0; n < count; ++n) take(n, binary_value(start + n * bytes, type));
    cursor_.skip(count * bytes);
  }

  void read_points() {
    const std::size_t points = count();
    const std::string type = lower_case(cursor_.word());
    if (points > source_.bytes.size() / 3 || points > std::numeric_limits<std::uint32_t>::max())
      source_.damaged("it announces more points than the file can hold");
    contents_.vertices.assign(points, Eigen::Vector3f::Zero());
    values(3 * points, type, [&](std::size_t n, double value) {
      contents_.vertices[n / 3][static_cast<Eigen::Index>(n % 3)] = static_cast<float>(value);
    });
  }

  Cells read_cells() {
    const std::size_t first = count();
    const std::size_t second = count();
    const std::size_t before = cursor_.position();
    if (lower_case(cursor_.word()) == "offsets") return read_offsets(first, second);
    cursor_ = TextCursor(source_.bytes, before);
    // Before version 5: `first` cells in `second` numbers, each its size and its points.
    std::vector<std::int64_t> numbers(second);
    values(second, "int", [&](std::size_t n, double value) { numbers[n] = whole(value); });
    Cells cells;
    std::size_t at = 0;
    while (at < numbers.size() && cells.size() < first) {
      const std::int64_t size = numbers[at];
      if (size < 0 || static_cast<std::uint64_t>(size) > numbers.size() - at - 1)
        source_.damaged("a polygon is longer than the list of polygons");
      const auto begin = numbers.begin() + static_cast<std::ptrdiff_t>(at + 1);
      cells.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(size));
      at += 1 + static_cast<std::size_t>(size);
    }
    if (cells.size() != first) source_.damaged("polygons are missing");
    return cells;
  }

  /// From version 5: where each cell begins, then the points of all.
  Cells read_offsets(std::size_t offset_count, std::size_t connectivity_count) {
    std::vector<std::int64_t> offsets(offset_count);
    values(offset_count, lower_case(cursor_.word()),
           [&](std::size_t n, double value) { offsets[n] = whole(value); });
    if (lower_case(cursor_.word()) != "connectivity")
      source_.damaged("the points of its polygons are missing");
    std::vector<std::int64_t> points(connectivity_count);
    values(connectivity_count, lower_case(cursor_.word()),
           [&](std::size_t n, double value) { points[n] = whole(value); });
    Cells cells;
    for (std::size_t n = 0; n + 1 < offsets.size(); ++n) {
      const auto end = static_cast<std::int64_t>(points.size());
      if (offsets[n] < 0 || offsets[n + 1] < offsets[n] || offsets[n + 1] > end)
        source_.damaged("the list of its polygons is out of order");
      cells.emplace_back(points.begin() + offsets[n], points.begin() + offsets[n + 1]);
    }
    return cells;
  }

  void read_field() {
    cursor_.word();  // its name
    for (std::size_t arrays = count(); arrays > 0; --arrays) {
      const std::string name(cursor_.word());
      if (lower_case(name) == "metadata") {
        while (!cursor_.at_end() && !cursor_.line().empty()) {
        }
        ++arrays;
        continue;
      }
      const std::size_t components = count();
      const std::size_t tuples = count();
      if (tuples != 0 && components > source_.bytes.size() / tuples)
        source_.damaged("a field is longer than the file");
      values(components * tuples, lower_case(cursor_.word()), [](std::size_t, double) {});
    }
  }

  static std::int64_t whole(double value) {
    constexpr double most = 4294967295.0;
    return value >= 0.0 && value <= most ? static_cast<std::int64_t>(value) : -1;
  }

  void add_strip(const std::vector<std::int64_t>& strip) {
    for (std::size_t n = 2; n < strip.size(); ++n) {
      const bool turned = n % 2 == 1;
      if (!add_polygon({strip[n - 2], strip[turned ? n : n - 1], strip[turned ? n - 1 : n]},
                       contents_.vertices.size(), contents_))
        refuse_cell();
    }
  }

  const MeshSource& source_;
  TextCursor cursor_;
  bool binary_ = false;
  MeshContents contents_;
  Cells polygons_;
  Cells strips_;
  std::size_t others_ = 0;
};

}  // namespace

MeshContents read_legacy_vtk(const MeshSource& source) { return LegacyReader(source).read(); }

}  // namespace palpate::surface
