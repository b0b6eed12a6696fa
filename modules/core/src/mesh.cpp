#include "palpate/core/mesh.hpp"

#include <Eigen/Geometry>

namespace palpate::core {

std::vector<Eigen::Vector3f> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3f> normals(mesh.vertices_mm.size(), Eigen::Vector3f::Zero());
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.vertices_mm[triangle[0]];
    const Eigen::Vector3f& b = mesh.vertices_mm[triangle[1]];
    const Eigen::Vector3f& c = mesh.vertices_mm[triangle[2]];
    const Eigen::Vector3f weighted = (b - a).cross(c - a);
    for (const auto vertex : triangle) normals[vertex] += weighted;
  }
  for (auto& normal : normals) {
    const float length = normal.norm();
    normal = length > 0.0F ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
  }
  return normals;
}

}  // namespace palpate::core
