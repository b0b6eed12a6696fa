#include "palpate/interaction/move_tool.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

using namespace palpate::interaction;
using Eigen::Vector3d;
using Eigen::Vector3f;

namespace {

const Vector3d center(100, 200, -50);
constexpr double degrees = 3.14159265358979323846 / 180.0;

/// A ray along +y that starts at the centre.
Ray along_y() { return {center, Vector3d::UnitY()}; }

struct Scene {
  std::vector<Vector3f> positions;
  PointsNow now() const { return {positions, center}; }
};

std::vector<Vector3f> cloud(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> place(-20.0F, 20.0F);
  std::vector<Vector3f> positions;
  for (std::size_t n = 0; n < count; ++n) {
    const float x = place(engine);
    const float y = place(engine);
    positions.emplace_back(x, y, place(engine));
  }
  return positions;
}

palpate::model::Adjacency links(std::vector<std::array<std::uint32_t, 2>> pairs, std::size_t count) {
  palpate::model::LinkGraph graph;
  graph.rest_lengths_mm.assign(pairs.size(), 1.0F);
  graph.pairs = std::move(pairs);
  return palpate::model::adjacency_of(graph, count);
}

}  // namespace

TEST(Pick, TakesTheNearestProjectionInsideTheCone) {
  // At 10 mm a 10 degree cone is 1.763 mm wide, at 20 mm 3.527 mm.
  const Scene scene{{Vector3f(1.8F, 10, 0), Vector3f(3.5F, 20, 0), Vector3f(0, 21, 0), Vector3f(0, 30, 0)}};
  const auto hit = pick(along_y(), {10.0, 0.0}, scene.now());
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->point, 1U);  // not the one on the axis: the nearer projection counts
  EXPECT_DOUBLE_EQ(hit->distance_mm, 20.0);
  EXPECT_LT((hit->origin_mm - (center + Vector3d(0, 20, 0))).norm(), 1e-12);  // on the ray, not at the point
}

TEST(Pick, LeavesOutWhatIsBehindTheCamera) {
  const Scene behind{{Vector3f(0, -5, 0), Vector3f(0, 0, 0)}};
  EXPECT_FALSE(pick(along_y(), {80.0, 0.0}, behind.now()));
  EXPECT_FALSE(pick(along_y(), {0.0, 10.0}, behind.now()));
  EXPECT_FALSE(pick(along_y(), {10.0, 0.0}, Scene{}.now()));
}

TEST(Pick, UsesACylinderUnderParallelProjection) {
  const Scene scene{{Vector3f(2.1F, 1, 0), Vector3f(0, 40, 1.9F), Vector3f(0, 50, 0)}};
  const auto hit = pick(along_y(), {89.0, 2.0}, scene.now());
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->point, 1U);
}

TEST(Pick, IgnoresPointsThatAreNotNumbersAndTakesTheFirstOfEquals) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Scene scene{{Vector3f(nan, 1, 0), Vector3f(0, nan, 0), Vector3f(0.5F, 10, 0), Vector3f(0, 10, 0)}};
  const auto hit = pick(along_y(), {10.0, 0.0}, scene.now());
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->point, 2U);
}

TEST(Pick, AgreesWithAnglesMeasuredDirectly) {
  const Scene scene{cloud(3000, 5)};
  std::mt19937 engine(6);
  std::uniform_real_distribution<double> place(-60.0, 60.0);
  int hits = 0;
  for (int round = 0; round < 50; ++round) {
    const Vector3d start = center + Vector3d(place(engine), place(engine), place(engine));
    const Ray ray{
        start, (center + Vector3d(place(engine), place(engine), place(engine)) / 4.0 - start).normalized()};
    double nearest = std::numeric_limits<double>::infinity();
    std::uint32_t expected = 0;
    for (std::uint32_t n = 0; n < scene.positions.size(); ++n) {
      const Vector3d there = center + scene.positions[n].cast<double>() - start;
      const double angle = std::acos(there.normalized().dot(ray.direction));
      const double projection = there.norm() * std::cos(angle);
      if (angle <= 3.0 * degrees && projection < nearest) {
        nearest = projection;
        expected = n;
      }
    }
    const auto hit = pick(ray, {3.0, 0.0}, scene.now());
    ASSERT_EQ(hit.has_value(), std::isfinite(nearest));
    if (!hit) continue;
    ++hits;
    EXPECT_EQ(hit->point, expected);
    EXPECT_NEAR(hit->distance_mm, nearest, 1e-9);  // acos near 0 loses half the digits
  }
  EXPECT_GT(hits, 20);
}

TEST(Select, SphereTakesAllWithinTheRadiusOfTheOrigin) {
  const Scene scene{cloud(2000, 9)};
  const Hit hit{center + Vector3d(2, 3, 4), 12.0, 0};
  const Selection selection = select(hit, 7.5, SelectionKind::sphere, scene.now(), {});
  EXPECT_EQ(selection.origin_mm, hit.origin_mm);
  EXPECT_EQ(selection.distance_mm, 12.0);
  std::size_t next = 0;
  for (std::uint32_t n = 0; n < scene.positions.size(); ++n) {
    if ((scene.positions[n].cast<double>() - Vector3d(2, 3, 4)).norm() > 7.5) continue;
    ASSERT_LT(next, selection.points.size());
    EXPECT_EQ(selection.points[next], n);
    EXPECT_EQ(selection.alphas[next++], 1.0F);
  }
  EXPECT_EQ(next, selection.points.size());
  EXPECT_GT(next, 20U);
}

TEST(Select, FuzzyFallsFromOneToZero) {
  const Scene scene{
      {Vector3f(0, 0, 0), Vector3f(0, 1, 0), Vector3f(3, 0, 0), Vector3f(0, 0, 4), Vector3f(0, 5, 0)}};
  const Selection selection = select({center, 1.0, 0}, 4.0, SelectionKind::fuzzy, scene.now(), {});
  EXPECT_EQ(selection.points, (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_EQ(selection.alphas, (std::vector<float>{1.0F, 0.75F, 0.25F}));
}

TEST(Select, ConnectedLeavesOutOtherPiecesAndDetours) {
  // Two strands a hair apart; 3 hangs on the first one only by way of 2, outside the radius.
  const Scene scene{{Vector3f(0, 0, 0), Vector3f(1, 0, 0), Vector3f(9, 0, 0), Vector3f(2, 0, 0),
                     Vector3f(0, 0.5F, 0), Vector3f(1, 0.5F, 0)}};
  const auto adjacency = links({{0, 1}, {1, 2}, {2, 3}, {4, 5}}, 6);
  const Hit hit{center + Vector3d(0, 0.1, 0), 1.0, 4};
  const Selection connected = select(hit, 3.0, SelectionKind::connected, scene.now(), adjacency);
  EXPECT_EQ(connected.points, (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(connected.alphas, (std::vector<float>{1.0F, 1.0F}));
  const Selection sphere = select(hit, 3.0, SelectionKind::sphere, scene.now(), adjacency);
  EXPECT_EQ(sphere.points, (std::vector<std::uint32_t>{0, 1, 3, 4, 5}));
  // Nothing within the radius: nothing selected.
  EXPECT_TRUE(
      select({center + Vector3d(0, 50, 0), 1.0, 0}, 3.0, SelectionKind::connected, scene.now(), adjacency)
          .points.empty());
}

TEST(Select, RefusesARadiusThatIsNone) {
  const Scene scene{cloud(3, 1)};
  for (const double radius : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    EXPECT_THROW(select({center, 1.0, 0}, radius, SelectionKind::sphere, scene.now(), {}),
                 palpate::core::Error);
}

TEST(SelectionKind, HasWords) {
  for (const SelectionKind kind : {SelectionKind::sphere, SelectionKind::fuzzy, SelectionKind::connected})
    EXPECT_EQ(selection_kind_from(to_string(kind)), kind);
  EXPECT_THROW(selection_kind_from("geodesic"), palpate::core::Error);
  EXPECT_THROW(selection_kind_from(""), palpate::core::Error);
}

TEST(MoveTool, KeepsTheDistanceOnTheNewRay) {
  Camera camera;
  camera.position_mm = center + Vector3d(0, -100, 10);
  camera.focal_point_mm = center;
  const Scene scene{cloud(5000, 3)};
  const auto hit = pick(ray_through(camera, 0.05, -0.02, 1.5), pick_reach(camera, 8, 600), scene.now());
  ASSERT_TRUE(hit);
  MoveTool tool(select(*hit, 5.0, SelectionKind::sphere, scene.now(), {}));
  EXPECT_EQ(tool.target_mm(), hit->origin_mm);
  const Vector3d u = camera.position_mm;
  for (const double x : {-0.6, 0.0, 0.3}) {
    const Ray ray = ray_through(camera, x, 0.4, 1.5);
    const Vector3d target = tool.drag_to(ray);
    EXPECT_EQ(target, tool.target_mm());
    EXPECT_NEAR((target - u).norm(), (hit->origin_mm - u).norm(), 1e-11);
    EXPECT_LT((target - u).cross(ray.direction).norm(), 1e-11);
    EXPECT_GT((target - u).dot(ray.direction), 0.0);
    // Thesis 3.4.1, word for word: the translation is u + |s - u| v2 - s.
    const Vector3d s = tool.selection().origin_mm;
    EXPECT_LT((target - s - (u + (s - u).norm() * ray.direction - s)).norm(), 1e-11);
  }
  // Back on the first ray the origin is where it was.
  EXPECT_LT((tool.drag_to(ray_through(camera, 0.05, -0.02, 1.5)) - hit->origin_mm).norm(), 1e-11);
}

TEST(MoveTool, KeepsTheDepthUnderParallelProjection) {
  Camera camera;
  camera.parallel = true;
  camera.parallel_scale_mm = 30.0;
  camera.position_mm = center + Vector3d(0, -100, 0);
  camera.focal_point_mm = center;
  const Scene scene{cloud(2000, 3)};
  const auto hit = pick(ray_through(camera, 0.0, 0.0, 1.0), pick_reach(camera, 20, 600), scene.now());
  ASSERT_TRUE(hit);
  MoveTool tool(select(*hit, 5.0, SelectionKind::sphere, scene.now(), {}));
  const Vector3d moved = tool.drag_to(ray_through(camera, 0.5, 0.25, 1.0)) - hit->origin_mm;
  EXPECT_LT((moved - Vector3d(15.0, 0.0, 7.5)).norm(), 1e-11);
}

TEST(MoveTool, StaysWhereItIsForARayThatIsNone) {
  Selection selection;
  selection.origin_mm = center;
  selection.distance_mm = 10.0;
  MoveTool tool(selection);
  EXPECT_EQ(tool.drag_to({center, Vector3d::Constant(std::nan(""))}), center);
}
