#include "decimate.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <queue>

#include <algorithm>
#include <limits>

namespace palpate::surface {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Triangle = std::array<std::uint32_t, 3>;

/// x'Ax - 2b'x + c: the area-weighted squared distance to a set of planes.
struct Quadric {
  Matrix3d a = Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  double c = 0.0;
  double area = 0.0;

  void add_plane(const Vector3d& normal, double distance, double weight) {
    a += weight * normal * normal.transpose();
    b += weight * distance * normal;
    c += weight * distance * distance;
    area += weight;
  }
  void add(const Quadric& other) {
    a += other.a;
    b += other.b;
    c += other.c;
    area += other.area;
  }
  double at(const Vector3d& x) const { return x.dot(a * x) - 2.0 * b.dot(x) + c; }
};

struct Collapse {
  double cost;
  std::uint32_t from, to;
  std::uint32_t from_version, to_version;

  bool operator<(const Collapse& other) const {  // the queue's top is the cheapest
    if (cost != other.cost) return cost > other.cost;
    if (from != other.from) return from > other.from;
    return to > other.to;
  }
};

class Decimator {
 public:
  Decimator(RawSurface surface, const core::Progress& progress)
      : vertices_(std::move(surface.vertices)),
        triangles_(std::move(surface.triangles)),
        progress_(progress) {
    alive_.assign(triangles_.size(), true);
    faces_.resize(vertices_.size());
    quadrics_.resize(vertices_.size());
    versions_.assign(vertices_.size(), 0);
    for (std::uint32_t face = 0; face < triangles_.size(); ++face) {
      for (const auto vertex : triangles_[face]) faces_[vertex].push_back(face);
      add_plane(triangles_[face]);
    }
    left_ = triangles_.size();
  }

  RawSurface run(std::size_t budget) {
    const std::size_t start = left_;
    std::size_t before = 0;
    do {  // an edge that was refused may be allowed once its neighbourhood has changed
      before = left_;
      push_all();
      drain(start, budget);
    } while (left_ > budget && before - left_ > before / 50);
    RawSurface result;
    result.vertices = std::move(vertices_);
    for (std::size_t face = 0; face < triangles_.size(); ++face)
      if (alive_[face]) result.triangles.push_back(triangles_[face]);
    drop_unused_vertices(result);
    return result;
  }

 private:
  void push_all() {
    for (std::size_t face = 0; face < triangles_.size(); ++face) {
      if (!alive_[face]) continue;
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const auto from = triangles_[face][corner];
        const auto to = triangles_[face][(corner + 1) % 3];
        // Each inner edge is seen from both sides, so one direction is enough.
        if (from < to) push(from, to);
      }
    }
  }

  void drain(std::size_t start, std::size_t budget) {
    std::size_t taken = 0;
    while (left_ > budget && !queue_.empty()) {
      const Collapse next = queue_.top();
      queue_.pop();
      if ((++taken & 0xFFFU) == 0)
        progress_.report(static_cast<double>(start - left_) / static_cast<double>(start - budget),
                         "Simplifying");
      if (versions_[next.from] != next.from_version || versions_[next.to] != next.to_version) continue;
      collapse(next.from, next.to);
    }
  }

  void add_plane(const Triangle& triangle) {
    const Vector3d& a = vertices_[triangle[0]];
    const Vector3d cross = (vertices_[triangle[1]] - a).cross(vertices_[triangle[2]] - a);
    const double twice_area = cross.norm();
    if (!(twice_area > 0.0)) return;
    const Vector3d normal = cross / twice_area;
    for (const auto vertex : triangle) quadrics_[vertex].add_plane(normal, normal.dot(a), twice_area / 6.0);
  }

  /// Where the merged vertex goes and what that costs. The pull towards the
  /// edge's middle keeps flat regions well-posed and their triangles even.
  std::pair<Vector3d, double> best_place(std::uint32_t from, std::uint32_t to) const {
    Quadric sum = quadrics_[from];
    sum.add(quadrics_[to]);
    const Vector3d middle = 0.5 * (vertices_[from] + vertices_[to]);
    constexpr double pull = 1e-3;
    const double weight = pull * sum.area + std::numeric_limits<double>::min();
    const Matrix3d system = sum.a + weight * Matrix3d::Identity();
    Vector3d place = system.ldlt().solve(sum.b + weight * middle);
    const double reach = (vertices_[from] - vertices_[to]).squaredNorm();
    if (!place.allFinite() || (place - middle).squaredNorm() > 4.0 * reach) place = middle;
    return {place,
            std::max(0.0, sum.at(place)) + weight * (place - middle).squaredNorm() + weight * 0.25 * reach};
  }

  void push(std::uint32_t from, std::uint32_t to) {
    queue_.push({best_place(from, to).second, from, to, versions_[from], versions_[to]});
  }

  static bool has(const Triangle& triangle, std::uint32_t vertex) {
    return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
  }

  void neighbours_of(std::uint32_t vertex, std::vector<std::uint32_t>& out) const {
    out.clear();
    for (const auto face : faces_[vertex])
      for (const auto corner : triangles_[face])
        if (corner != vertex) out.push_back(corner);
    std::sort(out.begin(), out.end());
  }

  /// The link condition: `from` and `to` share exactly the corners of their
  /// two faces, and none of these would be left with two faces.
  bool keeps_manifold(std::uint32_t from, std::uint32_t to) {
    int shared_faces = 0;
    for (const auto face : faces_[from]) {
      if (!has(triangles_[face], to)) continue;
      ++shared_faces;
      for (const auto corner : triangles_[face])
        if (corner != from && corner != to && faces_[corner].size() <= 3) return false;
    }
    if (shared_faces != 2) return false;
    neighbours_of(from, ring_from_);
    neighbours_of(to, ring_to_);
    // A neighbour that is met once only lies on an open border: leave those be.
    for (const auto* ring : {&ring_from_, &ring_to_})
      for (std::size_t n = 0; n < ring->size(); n += 2)
        if (n + 1 >= ring->size() || (*ring)[n] != (*ring)[n + 1]) return false;
    std::size_t common = 0;
    for (std::size_t m = 0, n = 0; m < ring_from_.size() && n < ring_to_.size();) {
      if (ring_from_[m] == ring_to_[n]) {
        ++common;
        m += 2;
        n += 2;
      } else if (ring_from_[m] < ring_to_[n]) {
        m += 2;
      } else {
        n += 2;
      }
    }
    return common == 2;
  }

  bool turns_over(std::uint32_t moved, std::uint32_t other, const Vector3d& place) const {
    for (const auto face : faces_[moved]) {
      const Triangle& triangle = triangles_[face];
      if (has(triangle, other)) continue;
      std::array<Vector3d, 3> corners;
      for (std::size_t n = 0; n < 3; ++n) corners[n] = triangle[n] == moved ? place : vertices_[triangle[n]];
      const Vector3d before = (vertices_[triangle[1]] - vertices_[triangle[0]])
                                  .cross(vertices_[triangle[2]] - vertices_[triangle[0]]);
      const Vector3d edge1 = corners[1] - corners[0];
      const Vector3d edge2 = corners[2] - corners[0];
      const Vector3d after = edge1.cross(edge2);
      constexpr double least_cosine = 0.2;  // some 78 degrees
      if (after.dot(before) <= least_cosine * after.norm() * before.norm()) return true;
      const double longest =
          std::max({edge1.squaredNorm(), edge2.squaredNorm(), (edge2 - edge1).squaredNorm()});
      constexpr double least_shape = 0.02;  // twice the area over the longest edge squared
      if (after.norm() < least_shape * longest && after.squaredNorm() < before.squaredNorm()) return true;
    }
    return false;
  }

  void collapse(std::uint32_t from, std::uint32_t to) {
    if (!keeps_manifold(from, to)) return;
    const Vector3d place = best_place(from, to).first;
    if (turns_over(from, to, place) || turns_over(to, from, place)) return;
    vertices_[to] = place;
    quadrics_[to].add(quadrics_[from]);
    for (const auto face : faces_[from]) {
      Triangle& triangle = triangles_[face];
      if (has(triangle, to)) {
        alive_[face] = false;
        --left_;
        for (const auto corner : triangle)
          if (corner != from) remove_face(corner, face);
      } else {
        std::replace(triangle.begin(), triangle.end(), from, to);
        faces_[to].push_back(face);
      }
    }
    faces_[from] = {};
    ++versions_[from];
    ++versions_[to];
    neighbours_of(to, ring_to_);
    for (std::size_t n = 0; n < ring_to_.size(); n += 2)
      push(std::min(to, ring_to_[n]), std::max(to, ring_to_[n]));
  }

  void remove_face(std::uint32_t vertex, std::uint32_t face) {
    auto& list = faces_[vertex];
    list.erase(std::find(list.begin(), list.end(), face));
  }

  std::vector<Vector3d> vertices_;
  std::vector<Triangle> triangles_;
  std::vector<bool> alive_;
  std::vector<std::vector<std::uint32_t>> faces_;  ///< living faces of each vertex
  std::vector<Quadric> quadrics_;
  std::vector<std::uint32_t> versions_;
  std::priority_queue<Collapse> queue_;
  std::vector<std::uint32_t> ring_from_, ring_to_;
  std::size_t left_ = 0;
  const core::Progress& progress_;
};

}  // namespace

void drop_unused_vertices(RawSurface& surface) {
  constexpr std::uint32_t unused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> renumbered(surface.vertices.size(), unused);
  for (const auto& triangle : surface.triangles)
    for (const auto vertex : triangle) renumbered[vertex] = 0;
  std::uint32_t next = 0;
  for (std::size_t vertex = 0; vertex < renumbered.size(); ++vertex) {
    if (renumbered[vertex] == unused) continue;
    surface.vertices[next] = surface.vertices[vertex];
    renumbered[vertex] = next++;
  }
  surface.vertices.resize(next);
  for (auto& triangle : surface.triangles)
    for (auto& vertex : triangle) vertex = renumbered[vertex];
}

RawSurface decimate(RawSurface surface, std::size_t face_budget, const core::Progress& progress) {
  if (surface.triangles.size() <= face_budget) return surface;
  return Decimator(std::move(surface), progress).run(face_budget);
}

}  // namespace palpate::surface
