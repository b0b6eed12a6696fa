#include "palpate/interaction/ray.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>

using namespace palpate::interaction;
using Eigen::Vector3d;

namespace {

/// Rounding of a few operations on numbers near 100.
constexpr double rounding = 1e-12;

Camera looking_down_y() {
  Camera camera;
  camera.position_mm = {10, -200, 5};
  camera.focal_point_mm = {10, 0, 5};
  camera.view_up = Vector3d::UnitZ();
  camera.view_angle_deg = 60.0;
  camera.parallel_scale_mm = 50.0;
  return camera;
}

/// Where the point is seen: the usual projection, written the other way round.
Eigen::Vector2d project(const Camera& camera, double aspect, const Vector3d& point) {
  const Vector3d forward = (camera.focal_point_mm - camera.position_mm).normalized();
  const Vector3d right = forward.cross(camera.view_up).normalized();
  const Vector3d up = right.cross(forward);
  const Vector3d relative = point - camera.position_mm;
  const double half = camera.parallel
                          ? camera.parallel_scale_mm
                          : relative.dot(forward) * std::tan(camera.view_angle_deg * std::acos(-1.0) / 360.0);
  return {relative.dot(right) / (half * aspect), relative.dot(up) / half};
}

}  // namespace

TEST(RayThrough, TheMiddleLooksAtTheFocalPoint) {
  for (const bool parallel : {false, true}) {
    Camera camera = looking_down_y();
    camera.parallel = parallel;
    const Ray ray = ray_through(camera, 0.0, 0.0, 1.6);
    EXPECT_LT((ray.origin_mm - camera.position_mm).norm(), rounding);
    EXPECT_LT((ray.direction - Vector3d::UnitY()).norm(), rounding);
  }
}

TEST(RayThrough, TheTopEdgeIsHalfTheViewAngleUp) {
  const Ray ray = ray_through(looking_down_y(), 0.0, 1.0, 1.6);
  EXPECT_NEAR(ray.direction.z() / ray.direction.y(), std::tan(std::acos(-1.0) / 6.0), rounding);
  EXPECT_NEAR(ray.direction.x(), 0.0, rounding);
}

TEST(RayThrough, XIsRightAndWidenedByTheAspect) {
  // Looking along +y with z up, right is +x.
  Camera camera = looking_down_y();
  EXPECT_NEAR(
      ray_through(camera, 1.0, 0.0, 2.0).direction.x() / ray_through(camera, 1.0, 0.0, 2.0).direction.y(),
      2.0 * std::tan(std::acos(-1.0) / 6.0), rounding);
  camera.parallel = true;
  const Ray ray = ray_through(camera, 0.5, -1.0, 2.0);
  EXPECT_LT((ray.origin_mm - Vector3d(10 + 50, -200, 5 - 50)).norm(), 1e-10);
  EXPECT_LT((ray.direction - Vector3d::UnitY()).norm(), rounding);
}

TEST(RayThrough, EveryPointOfTheRayIsSeenInItsPlace) {
  Camera camera = looking_down_y();
  camera.position_mm = {100, -60, 80};
  camera.view_up = {0.3, 0.2, 5.0};  // neither of unit length nor across the view
  for (const bool parallel : {false, true}) {
    camera.parallel = parallel;
    const Ray ray = ray_through(camera, -0.7, 0.4, 1.25);
    EXPECT_NEAR(ray.direction.norm(), 1.0, rounding);
    for (const double d : {1.0, 50.0, 300.0}) {
      const Eigen::Vector2d seen = project(camera, 1.25, ray.origin_mm + d * ray.direction);
      EXPECT_LT((seen - Eigen::Vector2d(-0.7, 0.4)).norm(), 1e-10);
    }
  }
}

TEST(RayThrough, RefusesACameraWithoutDirection) {
  Camera camera = looking_down_y();
  camera.focal_point_mm = camera.position_mm;
  EXPECT_THROW(ray_through(camera, 0, 0, 1), palpate::core::Error);
  camera = looking_down_y();
  camera.view_up = Vector3d::UnitY();
  EXPECT_THROW(ray_through(camera, 0, 0, 1), palpate::core::Error);
}

TEST(PickReach, ReachesAsManyPixelsAsAsked) {
  Camera camera = looking_down_y();
  // 20 of 400 pixels: the ray 20 pixels above the middle is at that angle.
  const PickReach cone = pick_reach(camera, 20.0, 400.0);
  const Ray above = ray_through(camera, 0.0, 2.0 * 20.0 / 400.0, 1.0);
  EXPECT_NEAR(std::cos(cone.cone_half_angle_deg * std::acos(-1.0) / 180.0), above.direction.y(), rounding);
  EXPECT_EQ(cone.cylinder_radius_mm, 0.0);

  camera.parallel = true;
  const PickReach cylinder = pick_reach(camera, 20.0, 400.0);
  EXPECT_NEAR(cylinder.cylinder_radius_mm, 5.0, rounding);  // the view is 100 mm high
}
