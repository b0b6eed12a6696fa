#include "mesh_source.hpp"

namespace palpate::surface {
namespace {

constexpr std::size_t header_bytes = 80;
constexpr std::size_t facet_bytes = 50;

void add_corner(MeshContents& contents, const Eigen::Vector3f& place) {
  contents.vertices.push_back(place);
  if (contents.vertices.size() % 3 == 0) {
    const auto last = static_cast<std::uint32_t>(contents.vertices.size() - 1);
    contents.triangles.push_back({last - 2, last - 1, last});
  }
}

MeshContents read_binary(const MeshSource& source, std::size_t facets) {
  MeshContents contents;
  contents.stated_space = stated_space_in(source.bytes.substr(0, header_bytes));
  contents.vertices.reserve(3 * facets);
  contents.triangles.reserve(facets);
  const char* facet = source.bytes.data() + header_bytes + 4;
  for (std::size_t n = 0; n < facets; ++n, facet += facet_bytes)
    for (int corner = 0; corner < 3; ++corner) {
      const char* place = facet + 12 + 12 * corner;  // behind the facet's normal
      add_corner(contents, {binary_number<float>(place, false), binary_number<float>(place + 4, false),
                            binary_number<float>(place + 8, false)});
    }
  return contents;
}

MeshContents read_ascii(const MeshSource& source) {
  MeshContents contents;
  TextCursor cursor(source.bytes);
  contents.stated_space = stated_space_in(cursor.line());
  bool ended = false;
  while (!cursor.at_end()) {
    const std::string word = lower_case(cursor.word());
    if (word == "vertex") {
      Eigen::Vector3f place;
      for (int axis = 0; axis < 3; ++axis) {
        const auto value = number_in(cursor.word());
        if (!value)
          source.damaged("a vertex near byte " + std::to_string(cursor.position()) + " is not three numbers");
        place[axis] = static_cast<float>(*value);
      }
      add_corner(contents, place);
    } else if (word == "endloop" || word == "endfacet") {
      if (contents.vertices.size() % 3 != 0)
        source.damaged("a facet near byte " + std::to_string(cursor.position()) +
                       " does not have three corners");
    } else if (word == "endsolid" || word == "end") {  // some write "end solid NAME"
      ended = true;
      cursor.line();
    } else if (word == "solid") {
      ended = false;
      cursor.line();
    }
  }
  if (!ended || contents.vertices.size() % 3 != 0)
    source.damaged("it ends before its last facet (no \"endsolid\")");
  return contents;
}

}  // namespace

MeshContents read_stl(const MeshSource& source) {
  const std::string_view bytes = source.bytes;
  std::size_t facets = 0;
  bool counted = bytes.size() >= header_bytes + 4;
  if (counted) facets = binary_number<std::uint32_t>(bytes.data() + header_bytes, false);
  const std::size_t expected = header_bytes + 4 + facet_bytes * facets;
  // Binary files that begin with "solid" exist; the count tells them apart.
  if (counted && bytes.size() == expected) return read_binary(source, facets);
  TextCursor start(bytes);
  constexpr std::size_t looked_at = 1024;
  if (lower_case(start.word()) == "solid") {
    const std::string beginning = lower_case(bytes.substr(0, looked_at));
    if (beginning.find("facet") != std::string::npos || beginning.find("endsolid") != std::string::npos ||
        beginning.find("end solid") != std::string::npos)
      return read_ascii(source);
  }
  if (!counted) source.damaged("it is too short for an STL file");
  if (bytes.size() < expected)
    source.damaged("it announces " + std::to_string(facets) + " facets, which take " +
                   std::to_string(expected) + " bytes, and has " + std::to_string(bytes.size()));
  return read_binary(source, facets);
}

}  // namespace palpate::surface
