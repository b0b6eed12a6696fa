#include "mesh_source.hpp"

#include "palpate/core/error.hpp"
#include "palpate/surface/extract.hpp"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <limits>
#include <new>
#include <system_error>
#include <unordered_map>

namespace palpate::surface {
namespace {

using core::Error;
using core::ErrorKind;

std::string read_file(const std::filesystem::path& path) {
  std::error_code problem;
  const auto refuse = [&](const std::string& why) {
    throw Error(ErrorKind::input, "unreadable",
                "The mesh " + path.string() + " cannot be read: " + why + ".");
  };
  if (!std::filesystem::exists(path, problem)) refuse("there is no such file");
  if (!std::filesystem::is_regular_file(path, problem)) refuse("it is not a file");
  const std::uintmax_t size = std::filesystem::file_size(path, problem);
  constexpr std::uintmax_t largest = std::uintmax_t{4} << 30;
  if (problem || size > largest) refuse(problem ? problem.message() : "it is larger than 4 GB");
  if (size == 0) refuse("it is empty");
  std::ifstream file(path, std::ios::binary);
  if (!file) refuse("it may not be opened");
  std::string bytes(static_cast<std::size_t>(size), '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (static_cast<std::uintmax_t>(file.gcount()) != size) refuse("it ends early");
  return bytes;
}

MeshContents read_by_kind(const MeshSource& source, const std::string& ending) {
  if (ending == ".stl") return read_stl(source);
  if (ending == ".ply") return read_ply(source);
  if (ending == ".obj") return read_obj(source);
  // .vtp and .vtk: both endings are met on both formats, so what the file begins with decides.
  constexpr std::string_view legacy = "# vtk datafile";
  constexpr std::size_t looked_at = 4096;
  if (lower_case(source.bytes.substr(0, legacy.size())) == legacy) return read_legacy_vtk(source);
  if (source.bytes.substr(0, looked_at).find("<VTKFile") != std::string_view::npos) return read_vtp(source);
  source.damaged("it begins neither as a VTK XML file nor as a legacy VTK file");
}

struct PlaceHash {
  std::size_t operator()(const std::array<std::uint32_t, 3>& bits) const noexcept {
    std::uint64_t hash = 0xcbf29ce484222325ULL;
    for (const auto part : bits) hash = (hash ^ part) * 0x9e3779b97f4a7c15ULL ^ hash >> 29;
    return static_cast<std::size_t>(hash);
  }
};

/// One vertex for each place, only those that triangles use, and no triangle
/// that has a corner twice: readers split points by normal and texture.
core::TriangleMesh welded(const MeshContents& contents) {
  constexpr std::uint32_t unseen = std::numeric_limits<std::uint32_t>::max();
  core::TriangleMesh mesh;
  const bool with_intensities = contents.intensities.size() == contents.vertices.size();
  std::unordered_map<std::array<std::uint32_t, 3>, std::uint32_t, PlaceHash> vertex_at;
  std::vector<std::uint32_t> renumbered(contents.vertices.size(), unseen);
  const auto number_of = [&](std::uint32_t vertex) {
    if (renumbered[vertex] != unseen) return renumbered[vertex];
    // Adding zero makes -0 and 0 the same place.
    const Eigen::Vector3f place = contents.vertices[vertex] + Eigen::Vector3f::Zero();
    std::array<std::uint32_t, 3> bits{};
    std::memcpy(bits.data(), place.data(), sizeof(bits));
    const auto [entry, is_new] =
        vertex_at.try_emplace(bits, static_cast<std::uint32_t>(mesh.vertices_mm.size()));
    if (is_new) {
      mesh.vertices_mm.push_back(place);
      if (with_intensities) mesh.intensities.push_back(contents.intensities[vertex]);
    }
    return renumbered[vertex] = entry->second;
  };
  for (const auto& triangle : contents.triangles) {
    const auto same_place = [&](std::uint32_t a, std::uint32_t b) {
      return contents.vertices[a] == contents.vertices[b];
    };
    if (same_place(triangle[0], triangle[1]) || same_place(triangle[1], triangle[2]) ||
        same_place(triangle[2], triangle[0]))
      continue;
    mesh.triangles.push_back({number_of(triangle[0]), number_of(triangle[1]), number_of(triangle[2])});
  }
  return mesh;
}

void check_finite(const MeshSource& source, const MeshContents& contents) {
  for (const auto& triangle : contents.triangles)
    for (const auto vertex : triangle)
      if (!contents.vertices[vertex].allFinite())
        source.damaged("vertex " + std::to_string(vertex) + " is not at a finite place");
}

}  // namespace

LoadedMesh load_mesh(const std::filesystem::path& path, MeshSpace space) {
  const std::string ending = lower_case(path.extension().string());
  constexpr std::array<std::string_view, 5> known{".stl", ".ply", ".obj", ".vtp", ".vtk"};
  MeshSource source{path.string(), {}};
  if (std::find(known.begin(), known.end(), ending) == known.end())
    source.unsupported(ending.empty() ? "its name has no ending that tells the format"
                                      : "the format " + ending + " is not read");
  const std::string bytes = read_file(path);
  source.bytes = bytes;
  MeshContents contents;
  try {
    contents = read_by_kind(source, ending);
  } catch (const std::bad_alloc&) {
    source.damaged("it asks for more memory than there is");
  }
  if (contents.triangles.empty()) source.no_polygons(contents.vertices.size(), {});
  check_finite(source, contents);

  LoadedMesh loaded;
  loaded.mesh = welded(contents);
  if (loaded.mesh.triangles.empty())
    source.no_polygons(contents.vertices.size(), "all its polygons are without area");
  if (space != MeshSpace::automatic) {
    loaded.space = space;
    loaded.space_reason = "chosen";
  } else if (contents.stated_space == "RAS" || contents.stated_space == "LPS") {
    loaded.space = contents.stated_space == "RAS" ? MeshSpace::ras : MeshSpace::lps;
    loaded.space_reason = "stated by SPACE=" + contents.stated_space + " in the file";
  } else {
    loaded.space = MeshSpace::lps;
    loaded.space_reason =
        contents.stated_space.empty()
            ? "assumed"
            : "assumed; the file's SPACE=" + contents.stated_space.substr(0, 40) + " is not known";
  }
  if (loaded.space == MeshSpace::ras)  // a half turn about the third axis, so the winding stays
    for (auto& vertex : loaded.mesh.vertices_mm)
      vertex = Eigen::Vector3f(-vertex.x(), -vertex.y(), vertex.z());
  loaded.mesh.normals = core::vertex_normals(loaded.mesh);
  return loaded;
}

}  // namespace palpate::surface
