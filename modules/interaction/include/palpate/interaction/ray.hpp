#pragma once

#include <Eigen/Core>

namespace palpate::interaction {

/// A ray in LPS mm; direction has unit length.
struct Ray {
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// The view that a ray came from. Enough to make it again, and to say how far
/// a reach in pixels is in the scene.
struct Camera {
  Eigen::Vector3d position_mm = Eigen::Vector3d(0, -1, 0);
  Eigen::Vector3d focal_point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d view_up = Eigen::Vector3d::UnitZ();
  double view_angle_deg = 30.0;       ///< vertical, perspective
  bool parallel = false;
  double parallel_scale_mm = 100.0;   ///< half the height of the view, parallel
};

/// The ray through a place of the viewport: x, y in [-1, 1], y up;
/// aspect = width / height (thesis 3.4). Under a parallel projection the rays
/// start in the camera's plane.
Ray ray_through(const Camera& camera, double x, double y, double aspect);
/// The half-angle of the cone that reaches `reach_px` of a viewport
/// `height_px` high; for a parallel camera 0 with the cylinder's radius in mm.
struct PickReach {
  double cone_half_angle_deg = 1.0;
  double cylinder_radius_mm = 0.0;  ///< used instead of the cone where > 0
};
PickReach pick_reach(const Camera& camera, double reach_px, double height_px);

}  // namespace palpate::interaction
