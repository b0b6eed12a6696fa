#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate::core {

/// A triangle surface in LPS millimetres. `normals` is empty or one unit
/// vector per vertex; `intensities` is empty or one value per vertex (the
/// scan's value there, for colour).
struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices_mm;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<Eigen::Vector3f> normals;
  std::vector<float> intensities;

  bool empty() const noexcept { return triangles.empty(); }
};

/// Area-weighted vertex normals; a vertex of no triangle gets (0,0,1).
std::vector<Eigen::Vector3f> vertex_normals(const TriangleMesh& mesh);

}  // namespace palpate::core
