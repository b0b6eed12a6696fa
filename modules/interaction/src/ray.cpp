#include "palpate/interaction/ray.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>

#include <cmath>

namespace palpate::interaction {
namespace {

constexpr double radians_per_degree = 3.14159265358979323846 / 180.0;

struct Axes {
  Eigen::Vector3d forward;
  Eigen::Vector3d right;
  Eigen::Vector3d up;
};

Axes axes_of(const Camera& camera) {
  Axes axes;
  axes.forward = (camera.focal_point_mm - camera.position_mm).stableNormalized();
  axes.right = axes.forward.cross(camera.view_up.stableNormalized());
  // Below this the view-up has no direction left across the view.
  if (!axes.right.allFinite() || !(axes.right.norm() > 1e-9))
    core::throw_usage(
        "The camera has no direction: its position and focal point coincide, or it looks along its view-up.");
  axes.right.normalize();
  axes.up = axes.right.cross(axes.forward);
  return axes;
}

double half_height(const Camera& camera) {
  return std::tan(0.5 * camera.view_angle_deg * radians_per_degree);
}

}  // namespace

Ray ray_through(const Camera& camera, double x, double y, double aspect) {
  const Axes axes = axes_of(camera);
  const double scale = camera.parallel ? camera.parallel_scale_mm : half_height(camera);
  const Eigen::Vector3d across = scale * (x * aspect * axes.right + y * axes.up);
  if (camera.parallel) return {camera.position_mm + across, axes.forward};
  return {camera.position_mm, (axes.forward + across).normalized()};
}

PickReach pick_reach(const Camera& camera, double reach_px, double height_px) {
  const double share = 2.0 * reach_px / height_px;  // of half the viewport's height
  PickReach reach;
  if (camera.parallel) {
    reach.cone_half_angle_deg = 0.0;
    reach.cylinder_radius_mm = share * camera.parallel_scale_mm;
  } else {
    reach.cone_half_angle_deg = std::atan(share * half_height(camera)) / radians_per_degree;
  }
  return reach;
}

}  // namespace palpate::interaction
