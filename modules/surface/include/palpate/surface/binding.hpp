#pragma once

#include "palpate/compute/buffer.hpp"
#include "palpate/core/mesh.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/model/tissue.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

namespace palpate::surface {

/// How each surface vertex follows a triangle of points (mapping paper 3.3.1):
/// v = sum w_i p_i + ot.x T + ot.y N + ot.z B with T = norm(p2 - p1),
/// Bt = norm(p3 - p1), N = norm(T x Bt), B = N x T. All arrays have one entry
/// a vertex. Offsets in mm; normals in the same basis.
struct SurfaceBinding {
  std::vector<std::array<std::uint32_t, 3>> points;  ///< p1, p2, p3
  std::vector<Eigen::Vector3f> weights;              ///< sum 1, none negative
  std::vector<Eigen::Vector3f> offsets_tnb_mm;
  std::vector<Eigen::Vector3f> normals_tnb;
  std::size_t size() const noexcept { return points.size(); }
};

/// Binds every vertex to a well-shaped triangle of nearby points of one
/// component, its reference point the closest point of the triangle. Needs at
/// least three points that are not in line; Error(input, "no-triangle") else.
SurfaceBinding bind(const core::TriangleMesh& mesh, const model::Tissue& tissue,
                    const core::Progress& progress = {});

/// The basis at given places, columns T, N, B. Degenerate triangles: where T
/// or N cannot be formed the nearest defined basis is used (documented in the
/// source), never NaN. As the paper has it, det(T, N, B) is -1.
Eigen::Matrix3d triangle_basis(const Eigen::Vector3d& p1, const Eigen::Vector3d& p2,
                               const Eigen::Vector3d& p3);

/// One bound vertex where its three points are, all in double and in the
/// frame of the points.
struct DeformedVertex {
  Eigen::Vector3d position_mm;
  Eigen::Vector3d normal;
};
DeformedVertex deform_vertex(const SurfaceBinding& binding, std::size_t vertex, const Eigen::Vector3d& p1,
                             const Eigen::Vector3d& p2, const Eigen::Vector3d& p3);

/// Host twin of kernels/surface_mapping.cl in double: positions relative to
/// tissue centre in, LPS mm out.
void deform_reference(const SurfaceBinding& binding, const Eigen::Vector3d& center_mm,
                      const std::vector<Eigen::Vector3f>& positions_mm, std::vector<float>& vertices_xyz_mm,
                      std::vector<float>& normals_xyz);

/// Arrays that VTK draws from and a kernel writes into: x y z for each vertex,
/// LPS mm, 64-byte aligned. Filled by one thread, then handed on as const.
class DeformedSurface {
 public:
  /// A device's view of the arrays; made by the Deformer that writes them.
  struct DeviceView;

  explicit DeformedSurface(std::size_t vertex_count);
  ~DeformedSurface();
  DeformedSurface(const DeformedSurface&) = delete;
  DeformedSurface& operator=(const DeformedSurface&) = delete;
  std::size_t vertex_count() const noexcept { return vertex_count_; }
  float* vertices() noexcept { return vertices_; }
  const float* vertices() const noexcept { return vertices_; }
  float* normals() noexcept { return normals_; }
  const float* normals() const noexcept { return normals_; }

 private:
  friend class Deformer;
  std::size_t vertex_count_;
  float* vertices_;
  float* normals_;
  std::unique_ptr<DeviceView> view_;  ///< goes before the memory that it looks at
};

/// Runs surface_mapping.cl on the solver's device straight into the arrays of
/// a DeformedSurface. One thread: that of the solver. A surface is written by
/// one Deformer after another, never by two at a time.
class Deformer {
 public:
  Deformer(const compute::Device& device, const SurfaceBinding& binding, const Eigen::Vector3d& center_mm);
  ~Deformer();
  Deformer(const Deformer&) = delete;
  Deformer& operator=(const Deformer&) = delete;
  /// positions: Solver::positions_buffer(). Waits until `out` is written.
  void deform(const compute::Buffer& positions, DeformedSurface& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::surface
