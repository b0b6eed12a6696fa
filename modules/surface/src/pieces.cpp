#include "pieces.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace palpate::surface {
namespace {

struct Pieces {
  std::vector<std::uint32_t> of_vertex;
  std::vector<double> volumes;
  std::vector<std::size_t> faces;
};

double tetrahedron(const RawSurface& surface, const std::array<std::uint32_t, 3>& triangle) {
  const auto& v = surface.vertices;
  // Seen from a vertex of the surface, so that far-off coordinates do not cancel.
  const Eigen::Vector3d& eye = v.front();
  return (v[triangle[0]] - eye).dot((v[triangle[1]] - eye).cross(v[triangle[2]] - eye)) / 6.0;
}

Pieces pieces_of(const RawSurface& surface) {
  std::vector<std::uint32_t> parent(surface.vertices.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t vertex) {
    while (parent[vertex] != vertex) vertex = parent[vertex] = parent[parent[vertex]];
    return vertex;
  };
  for (const auto& triangle : surface.triangles)
    for (int corner = 1; corner < 3; ++corner) {
      const auto a = root(triangle[0]);
      const auto b = root(triangle[static_cast<std::size_t>(corner)]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  Pieces pieces;
  pieces.of_vertex.resize(parent.size());
  for (std::uint32_t vertex = 0; vertex < parent.size(); ++vertex) {
    const auto top = root(vertex);  // the smallest index of its piece, so it was numbered before
    if (top == vertex) {
      pieces.of_vertex[vertex] = static_cast<std::uint32_t>(pieces.volumes.size());
      pieces.volumes.push_back(0.0);
      pieces.faces.push_back(0);
    } else {
      pieces.of_vertex[vertex] = pieces.of_vertex[top];
    }
  }
  for (const auto& triangle : surface.triangles) {
    const auto piece = pieces.of_vertex[triangle[0]];
    pieces.volumes[piece] += tetrahedron(surface, triangle);
    ++pieces.faces[piece];
  }
  return pieces;
}

void keep(RawSurface& surface, const Pieces& pieces, const std::vector<bool>& kept) {
  const auto gone = [&](const auto& triangle) { return !kept[pieces.of_vertex[triangle[0]]]; };
  surface.triangles.erase(std::remove_if(surface.triangles.begin(), surface.triangles.end(), gone),
                          surface.triangles.end());
  drop_unused_vertices(surface);
}

}  // namespace

void drop_specks(RawSurface& surface, double least_tissue) {
  if (surface.triangles.empty()) return;
  const Pieces pieces = pieces_of(surface);
  const auto by_size = [](double a, double b) { return std::abs(a) < std::abs(b); };
  const auto largest = std::max_element(pieces.volumes.begin(), pieces.volumes.end(), by_size);
  constexpr double speck_share = 1e-4;
  constexpr double largest_speck = 64.0;
  const double speck = std::min(largest_speck, speck_share * std::abs(*largest));
  std::vector<bool> kept(pieces.volumes.size());
  for (std::size_t piece = 0; piece < kept.size(); ++piece) {
    const double volume = pieces.volumes[piece];  // negative for a cavity
    kept[piece] = std::abs(volume) >= speck && (volume < 0.0 || volume >= least_tissue);
  }
  kept[static_cast<std::size_t>(largest - pieces.volumes.begin())] = true;
  keep(surface, pieces, kept);
}

void drop_smallest_pieces(RawSurface& surface, std::size_t face_budget) {
  if (surface.triangles.size() <= face_budget) return;
  const Pieces pieces = pieces_of(surface);
  std::vector<std::size_t> order(pieces.volumes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::abs(pieces.volumes[a]) > std::abs(pieces.volumes[b]);
  });
  std::vector<bool> kept(pieces.volumes.size(), false);
  std::size_t faces = 0;
  for (const auto piece : order) {
    faces += pieces.faces[piece];
    if (faces > face_budget && faces != pieces.faces[piece]) break;
    kept[piece] = true;
  }
  keep(surface, pieces, kept);
}

double enclosed_volume(const RawSurface& surface) {
  double sum = 0.0;
  for (const auto& triangle : surface.triangles) sum += tetrahedron(surface, triangle);
  return sum;
}

}  // namespace palpate::surface
