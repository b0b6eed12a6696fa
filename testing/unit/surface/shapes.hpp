#pragma once

#include "palpate/core/mesh.hpp"
#include "palpate/core/volume.hpp"

#include <Eigen/Geometry>

#include <cmath>
#include <functional>
#include <map>
#include <utility>

namespace palpate::surface::shapes {

inline Eigen::Matrix3d oblique() {
  return (Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(-0.7, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}
inline Eigen::Matrix3d mirror() { return Eigen::Vector3d(-1, 1, 1).asDiagonal(); }

inline core::Volume volume_of(const core::ImageGeometry& geometry,
                              const std::function<double(const Eigen::Vector3d& lps_mm)>& value) {
  std::vector<float> voxels;
  voxels.reserve(geometry.voxel_count());
  const auto dims = geometry.dims();
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j)
      for (int i = 0; i < dims[0]; ++i)
        voxels.push_back(static_cast<float>(value(geometry.to_lps_mm(Eigen::Vector3d(i, j, k)))));
  return core::Volume(geometry, std::move(voxels));
}

/// 100 at the centre, 0 at twice the radius: the iso value 50 is the sphere.
inline std::function<double(const Eigen::Vector3d&)> ball(const Eigen::Vector3d& center_mm,
                                                          double radius_mm) {
  return [=](const Eigen::Vector3d& place) { return 100.0 - 50.0 * (place - center_mm).norm() / radius_mm; };
}

inline double volume_of(const core::TriangleMesh& mesh) {
  const Eigen::Vector3d eye = mesh.vertices_mm.front().cast<double>();
  double sum = 0.0;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices_mm[triangle[0]].cast<double>() - eye;
    const Eigen::Vector3d b = mesh.vertices_mm[triangle[1]].cast<double>() - eye;
    const Eigen::Vector3d c = mesh.vertices_mm[triangle[2]].cast<double>() - eye;
    sum += a.dot(b.cross(c)) / 6.0;
  }
  return sum;
}

/// Every directed edge once, and its reverse once: closed, manifold along
/// edges, consistently wound.
inline bool closed_and_manifold(const core::TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& triangle : mesh.triangles)
    for (std::size_t n = 0; n < 3; ++n) ++edges[{triangle[n], triangle[(n + 1) % 3]}];
  for (const auto& [edge, count] : edges) {
    if (count != 1) return false;
    if (edges.find({edge.second, edge.first}) == edges.end()) return false;
  }
  return !mesh.triangles.empty();
}

}  // namespace palpate::surface::shapes
