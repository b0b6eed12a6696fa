#include "mesh_source.hpp"

namespace palpate::surface {

MeshContents read_obj(const MeshSource& source) {
  if (source.bytes.find('\0') != std::string_view::npos)
    source.damaged("an OBJ file is text, and this one is not");
  MeshContents contents;
  std::vector<std::int64_t> corners;
  std::size_t lines_of_edges = 0;
  std::size_t number = 0;
  const auto place_in_file = [&] { return "line " + std::to_string(number); };
  for (TextCursor cursor(source.bytes); !cursor.at_end();) {
    const std::string_view line = cursor.line();
    ++number;
    TextCursor words(line);
    const std::string_view first = words.word();
    if (!first.empty() && first.front() == '#') {
      if (contents.stated_space.empty()) contents.stated_space = stated_space_in(line);
    } else if (first == "v") {
      Eigen::Vector3f vertex;
      for (int axis = 0; axis < 3; ++axis) {
        const auto value = number_in(words.word());
        if (!value) source.damaged(place_in_file() + " does not give a vertex three numbers");
        vertex[axis] = static_cast<float>(*value);
      }
      contents.vertices.push_back(vertex);
    } else if (first == "f") {
      corners.clear();
      for (auto corner = words.word(); !corner.empty() && corner.front() != '#'; corner = words.word()) {
        auto index = integer_in(corner.substr(0, corner.find('/')));
        if (!index || *index == 0)
          source.damaged(place_in_file() + " has a face with a corner that is no number");
        // Negative indices count back from the newest vertex.
        const auto count = static_cast<std::int64_t>(contents.vertices.size());
        corners.push_back(*index > 0 ? *index - 1 : *index < -count ? -1 : count + *index);
      }
      // Faces may stand before their vertices; those are checked at the end.
      constexpr std::size_t any = std::size_t{1} << 32;
      if (corners.size() < 3 || !add_polygon(corners, any, contents))
        source.damaged(place_in_file() + " has a face without three vertices of this file");
    } else if (first == "l" || first == "p") {
      ++lines_of_edges;
    }
  }
  for (const auto& triangle : contents.triangles)
    for (const auto corner : triangle)
      if (corner >= contents.vertices.size())
        source.damaged("a face names vertex " + std::to_string(std::size_t{corner} + 1) + " of " +
                       std::to_string(contents.vertices.size()));
  if (contents.triangles.empty() && lines_of_edges > 0)
    source.no_polygons(contents.vertices.size(), "it holds only points and lines");
  return contents;
}

}  // namespace palpate::surface
