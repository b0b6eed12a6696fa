#include "mesh_source.hpp"

#include <algorithm>

namespace palpate::surface {
namespace {

enum class Type { i8, u8, i16, u16, i32, u32, f32, f64 };

std::optional<Type> type_named(std::string_view name) {
  if (name == "char" || name == "int8") return Type::i8;
  if (name == "uchar" || name == "uint8") return Type::u8;
  if (name == "short" || name == "int16") return Type::i16;
  if (name == "ushort" || name == "uint16") return Type::u16;
  if (name == "int" || name == "int32") return Type::i32;
  if (name == "uint" || name == "uint32") return Type::u32;
  if (name == "float" || name == "float32") return Type::f32;
  if (name == "double" || name == "float64") return Type::f64;
  return std::nullopt;
}

std::size_t bytes_of(Type type) {
  switch (type) {
    case Type::i8:
    case Type::u8:
      return 1;
    case Type::i16:
    case Type::u16:
      return 2;
    case Type::i32:
    case Type::u32:
    case Type::f32:
      return 4;
    case Type::f64:
      return 8;
  }
  return 1;
}

struct Property {
  std::string name;
  bool list = false;
  Type count_type = Type::u8;
  Type type = Type::f32;
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  bool ascii = false;
  bool big_endian = false;
  std::vector<Element> elements;
  std::string space;
  std::size_t bytes = 0;
};

Header read_header(const MeshSource& source) {
  Header header;
  TextCursor cursor(source.bytes);
  if (cursor.line() != "ply") source.damaged("it does not begin with \"ply\"");
  bool format_found = false;
  while (true) {
    constexpr std::size_t longest = 1U << 20;
    if (cursor.at_end() || cursor.position() > longest) source.damaged("its header does not end");
    const std::string_view line = cursor.line();
    TextCursor words(line);
    const std::string_view first = words.word();
    if (first == "end_header") break;
    if (first == "format") {
      const std::string_view format = words.word();
      header.ascii = format == "ascii";
      header.big_endian = format == "binary_big_endian";
      format_found = header.ascii || header.big_endian || format == "binary_little_endian";
    } else if (first == "comment" || first == "obj_info") {
      if (header.space.empty()) header.space = stated_space_in(line);
    } else if (first == "element") {
      Element element;
      element.name = words.word();
      const auto count = integer_in(words.word());
      // Every entry takes a byte at least.
      if (!count || *count < 0 || static_cast<std::uint64_t>(*count) > source.bytes.size())
        source.damaged("it announces more of \"" + element.name + "\" than the file can hold");
      element.count = static_cast<std::size_t>(*count);
      header.elements.push_back(std::move(element));
    } else if (first == "property") {
      Property property;
      std::string_view type = words.word();
      property.list = type == "list";
      if (property.list) {
        const auto count_type = type_named(words.word());
        if (!count_type) source.damaged("its header names an unknown type");
        property.count_type = *count_type;
        type = words.word();
      }
      const auto known = type_named(type);
      if (!known || header.elements.empty())
        source.damaged("its header has a property that cannot be understood");
      property.type = *known;
      property.name = words.word();
      header.elements.back().properties.push_back(std::move(property));
    }
  }
  if (!format_found) source.damaged("its header names no known format");
  header.bytes = cursor.position();
  return header;
}

/// Numbers one after another, as text or bytes.
class Values {
 public:
  Values(const MeshSource& source, const Header& header)
      : source_(source), header_(header), cursor_(source.bytes, header.bytes) {}

  double next(Type type) {
    if (header_.ascii) {
      const auto value = number_in(cursor_.word());
      if (!value) source_.damaged("a number is missing near byte " + std::to_string(cursor_.position()));
      return *value;
    }
    if (cursor_.left() < bytes_of(type)) source_.damaged("it ends before its last number");
    const char* bytes = source_.bytes.data() + cursor_.position();
    cursor_.skip(bytes_of(type));
    switch (type) {
      case Type::i8:
        return binary_number<std::int8_t>(bytes, header_.big_endian);
      case Type::u8:
        return binary_number<std::uint8_t>(bytes, header_.big_endian);
      case Type::i16:
        return binary_number<std::int16_t>(bytes, header_.big_endian);
      case Type::u16:
        return binary_number<std::uint16_t>(bytes, header_.big_endian);
      case Type::i32:
        return binary_number<std::int32_t>(bytes, header_.big_endian);
      case Type::u32:
        return binary_number<std::uint32_t>(bytes, header_.big_endian);
      case Type::f32:
        return static_cast<double>(binary_number<float>(bytes, header_.big_endian));
      case Type::f64:
        return binary_number<double>(bytes, header_.big_endian);
    }
    return 0.0;
  }

  std::size_t next_count(Type type) {
    const double count = next(type);
    if (!(count >= 0.0) || count > static_cast<double>(cursor_.left()) ||
        count != static_cast<double>(static_cast<std::size_t>(count)))
      source_.damaged("a list near byte " + std::to_string(cursor_.position()) + " is longer than the file");
    return static_cast<std::size_t>(count);
  }

 private:
  const MeshSource& source_;
  const Header& header_;
  TextCursor cursor_;
};

void read_vertices(const Element& element, const MeshSource& source, Values& values, MeshContents& contents) {
  std::array<int, 3> found{-1, -1, -1};
  int intensity = -1;
  for (std::size_t n = 0; n < element.properties.size(); ++n) {
    const Property& property = element.properties[n];
    if (property.list) continue;
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (property.name == std::string(1, "xyz"[axis])) found[axis] = static_cast<int>(n);
    if (property.name == "intensity") intensity = static_cast<int>(n);
  }
  if (*std::min_element(found.begin(), found.end()) < 0) source.damaged("its vertices have no x, y and z");
  for (std::size_t row = 0; row < element.count; ++row) {
    Eigen::Vector3f vertex = Eigen::Vector3f::Zero();
    for (std::size_t n = 0; n < element.properties.size(); ++n) {
      const Property& property = element.properties[n];
      if (property.list) {
        for (std::size_t left = values.next_count(property.count_type); left > 0; --left)
          values.next(property.type);
        continue;
      }
      const auto value = static_cast<float>(values.next(property.type));
      for (std::size_t axis = 0; axis < 3; ++axis)
        if (found[axis] == static_cast<int>(n)) vertex[static_cast<Eigen::Index>(axis)] = value;
      if (intensity == static_cast<int>(n)) contents.intensities.push_back(value);
    }
    contents.vertices.push_back(vertex);
  }
}

void read_faces(const Element& element, const MeshSource& source, std::size_t vertex_count, Values& values,
                MeshContents& contents) {
  std::vector<std::int64_t> corners;
  for (std::size_t row = 0; row < element.count; ++row)
    for (const Property& property : element.properties) {
      const bool is_face =
          property.list && (property.name == "vertex_indices" || property.name == "vertex_index");
      const std::size_t count = property.list ? values.next_count(property.count_type) : 1;
      corners.clear();
      for (std::size_t n = 0; n < count; ++n) {
        const double value = values.next(property.type);
        if (!is_face) continue;
        corners.push_back(value >= 0.0 && value < 4294967296.0 ? static_cast<std::int64_t>(value) : -1);
      }
      if (is_face && !add_polygon(corners, vertex_count, contents))
        source.damaged("face " + std::to_string(row) + " names a vertex that is not there");
    }
}

void skip(const Element& element, Values& values) {
  for (std::size_t row = 0; row < element.count; ++row)
    for (const Property& property : element.properties)
      for (std::size_t left = property.list ? values.next_count(property.count_type) : 1; left > 0; --left)
        values.next(property.type);
}

}  // namespace

MeshContents read_ply(const MeshSource& source) {
  const Header header = read_header(source);
  MeshContents contents;
  contents.stated_space = header.space;
  Values values(source, header);
  std::size_t vertex_count = 0;
  bool strips = false;
  for (const Element& element : header.elements)
    if (element.name == "vertex") vertex_count = element.count;
  for (const Element& element : header.elements) {
    if (element.properties.empty()) continue;
    if (element.name == "vertex") {
      if (!contents.vertices.empty()) source.damaged("it lists its vertices twice");
      read_vertices(element, source, values, contents);
    } else if (element.name == "face") {
      read_faces(element, source, vertex_count, values, contents);
    } else {
      strips |= element.name == "tristrips" && element.count > 0;
      skip(element, values);
    }
  }
  if (contents.vertices.size() != vertex_count) source.damaged("its vertices are missing");
  if (contents.triangles.empty() && strips)
    source.no_polygons(vertex_count, "it stores triangle strips, which are not read. Export it as triangles");
  return contents;
}

}  // namespace palpate::surface
