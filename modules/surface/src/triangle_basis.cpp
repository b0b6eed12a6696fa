#include "palpate/core/error.hpp"
#include "palpate/surface/binding.hpp"

#include <Eigen/Geometry>

namespace palpate::surface {
namespace {

using Eigen::Vector3d;

// The same figures stand in kernels/surface_mapping.cl.
constexpr double short_edge_mm = 1e-6;  // below the rounding of positions in float
constexpr double thin_sine = 1e-3;      // of the angle at p1

/// norm(edge), bent towards `instead` as the edge vanishes.
Vector3d direction_of(const Vector3d& edge, const Vector3d& instead) {
  const double length = edge.norm();
  if (length > short_edge_mm) return edge / length;
  const Vector3d bent = edge + (short_edge_mm - length) * instead;
  const double bent_length = bent.norm();
  return bent_length > 0.1 * short_edge_mm ? Vector3d(bent / bent_length) : instead;
}

/// A unit vector across `t`: of the axis that `t` leans on least.
Vector3d across(const Vector3d& t) {
  Eigen::Index axis = 0;
  t.cwiseAbs().minCoeff(&axis);
  const Vector3d unit = Vector3d::Unit(axis);
  return (unit - t[axis] * t).normalized();
}

}  // namespace

// Degenerate triangles. Where p2 meets p1 (or p3 meets p1) T (or Bt) turns
// into the x (or y) axis over the last millionth of a millimetre. Where the
// three come into line, T x Bt vanishes; below a sine of 1e-3 it is filled up
// with a fixed vector across T, so N follows without a jump as the triangle
// closes and opens again on the same side. Through the line to the other side
// N turns over, as the triangle does. Above these limits the basis is exactly
// the paper's, so rigid motions stay rigid.
Eigen::Matrix3d triangle_basis(const Vector3d& p1, const Vector3d& p2, const Vector3d& p3) {
  const Vector3d t = direction_of(p2 - p1, Vector3d::UnitX());
  const Vector3d b_t = direction_of(p3 - p1, Vector3d::UnitY());
  Vector3d n = t.cross(b_t);
  const double sine = n.norm();
  if (sine > thin_sine) {
    n /= sine;
  } else {
    const Vector3d filler = across(t);
    const Vector3d filled = n + (thin_sine - sine) * filler;
    const double length = filled.norm();
    n = length > 0.1 * thin_sine ? Vector3d(filled / length) : filler;
  }
  Eigen::Matrix3d basis;
  basis.col(0) = t;
  basis.col(1) = n;
  basis.col(2) = n.cross(t);
  return basis;
}

DeformedVertex deform_vertex(const SurfaceBinding& binding, std::size_t vertex, const Vector3d& p1,
                             const Vector3d& p2, const Vector3d& p3) {
  const Eigen::Matrix3d basis = triangle_basis(p1, p2, p3);
  // w1 = 1 - w2 - w3: the sum is exactly 1, so a shift of the points shifts the vertex by the same.
  const Vector3d weights = binding.weights[vertex].cast<double>();
  const Vector3d reference = p1 + weights[1] * (p2 - p1) + weights[2] * (p3 - p1);
  return {reference + basis * binding.offsets_tnb_mm[vertex].cast<double>(),
          basis * binding.normals_tnb[vertex].cast<double>()};
}

void deform_reference(const SurfaceBinding& binding, const Vector3d& center_mm,
                      const std::vector<Eigen::Vector3f>& positions_mm, std::vector<float>& vertices_xyz_mm,
                      std::vector<float>& normals_xyz) {
  vertices_xyz_mm.resize(3 * binding.size());
  normals_xyz.resize(3 * binding.size());
  for (std::size_t vertex = 0; vertex < binding.size(); ++vertex) {
    const auto& points = binding.points[vertex];
    for (const auto point : points)
      if (point >= positions_mm.size())
        throw core::Error(core::ErrorKind::internal, "binding-size",
                          "The surface was bound to other points than it is to follow.");
    const DeformedVertex deformed =
        deform_vertex(binding, vertex, positions_mm[points[0]].cast<double>(),
                      positions_mm[points[1]].cast<double>(), positions_mm[points[2]].cast<double>());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      vertices_xyz_mm[3 * vertex + axis] = static_cast<float>(center_mm[a] + deformed.position_mm[a]);
      normals_xyz[3 * vertex + axis] = static_cast<float>(deformed.normal[a]);
    }
  }
}

}  // namespace palpate::surface
