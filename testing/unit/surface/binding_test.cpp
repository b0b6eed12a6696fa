#include "palpate/surface/binding.hpp"

#include "shapes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/surface/extract.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <random>

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3f;
using palpate::core::Error;
using palpate::core::ImageGeometry;
using palpate::core::TriangleMesh;
using palpate::model::Tissue;
using palpate::surface::bind;
using palpate::surface::SurfaceBinding;
using palpate::surface::triangle_basis;
namespace core = palpate::core;
namespace model = palpate::model;
namespace shapes = palpate::surface::shapes;

namespace {

struct Case {
  Tissue tissue;
  TriangleMesh mesh;
  Vector3d center;
};

Case ball_case(const Matrix3d& direction) {
  const ImageGeometry geometry({40, 36, 24}, {0.5, 0.6, 0.9}, {10, -20, 30}, direction);
  const auto volume = shapes::volume_of(geometry, shapes::ball(geometry.center_mm(), 8.0));
  model::TissueParameters parameters;
  parameters.threshold_low = 50.0;
  palpate::surface::ExtractParameters surface;
  surface.iso_value = 50.0;
  surface.face_budget = 6000;
  return {model::generate(volume, parameters), palpate::surface::extract(volume, surface),
          geometry.center_mm()};
}

/// Points and links by hand: linked where closer than `reach_mm`.
Tissue tissue_of(const std::vector<Vector3f>& positions, float reach_mm) {
  Tissue tissue;
  tissue.points.positions_mm = positions;
  tissue.points.voxels.resize(positions.size());
  tissue.points.intensities.resize(positions.size());
  for (std::uint32_t a = 0; a < positions.size(); ++a)
    for (std::uint32_t b = a + 1; b < positions.size(); ++b) {
      const float length = (positions[a] - positions[b]).norm();
      if (length > reach_mm) continue;
      tissue.links.pairs.push_back({a, b});
      tissue.links.rest_lengths_mm.push_back(length);
    }
  return tissue;
}

TriangleMesh single(const std::vector<Vector3f>& vertices) {
  TriangleMesh mesh;
  mesh.vertices_mm = vertices;
  mesh.normals.assign(vertices.size(), Vector3f::UnitZ());
  return mesh;
}

Vector3f vertex_of(const std::vector<float>& xyz, std::size_t vertex) {
  return {xyz[3 * vertex], xyz[3 * vertex + 1], xyz[3 * vertex + 2]};
}

}  // namespace

TEST(TriangleBasis, IsThePapers) {
  const Vector3d p1(1, 2, 3);
  const Vector3d p2(4, 2.5, 2);
  const Vector3d p3(0, 5, 4);
  const Matrix3d basis = triangle_basis(p1, p2, p3);
  EXPECT_TRUE(basis.col(0).isApprox((p2 - p1).normalized()));
  EXPECT_TRUE(basis.col(1).isApprox((p2 - p1).cross(p3 - p1).normalized()));
  EXPECT_TRUE(basis.col(2).isApprox(basis.col(1).cross(basis.col(0))));
  EXPECT_LT((basis.transpose() * basis - Matrix3d::Identity()).norm(), 1e-14);
}

TEST(TriangleBasis, DegenerateTrianglesHaveAnOrthonormalContinuousBasis) {
  const Vector3d p(1, 2, 3);
  const Vector3d e(0.3, -0.4, 0.5);
  const std::vector<std::array<Vector3d, 3>> degenerate{
      {p, p, p}, {p, p + e, p}, {p, p, p + e}, {p, p + e, p + e}, {p, p + e, p - e}, {p, p + e, p + 2 * e}};
  for (const auto& corners : degenerate) {
    const Matrix3d basis = triangle_basis(corners[0], corners[1], corners[2]);
    ASSERT_TRUE(basis.allFinite());
    EXPECT_LT((basis.transpose() * basis - Matrix3d::Identity()).norm(), 1e-12);
  }
  // A triangle that closes: small steps of the angle turn the basis by little.
  Matrix3d before = triangle_basis(p, p + Vector3d::UnitX(), p + Vector3d(1, 0.01, 0));
  for (double angle = 0.01; angle > -1e-9; angle -= 1e-6) {
    const Matrix3d basis = triangle_basis(p, p + Vector3d::UnitX(), p + Vector3d(1, std::max(0.0, angle), 0));
    // Within the last thousandth the normal turns by at most a right angle and
    // a half: some 2e-3 rad per 1e-6.
    ASSERT_LT((basis - before).norm(), 1e-2) << angle;
    before = basis;
  }
}

TEST(Bind, WeightsSumToOneAndNoneIsNegative) {
  const Case ball = ball_case(shapes::oblique());
  const SurfaceBinding binding = bind(ball.mesh, ball.tissue);
  ASSERT_EQ(binding.size(), ball.mesh.vertices_mm.size());
  for (std::size_t n = 0; n < binding.size(); ++n) {
    // Three floats: two roundings of numbers up to 1.
    ASSERT_NEAR(binding.weights[n].cast<double>().sum(), 1.0, 1.5e-7);
    ASSERT_GE(binding.weights[n].minCoeff(), 0.0F);
    const auto& p = binding.points[n];
    ASSERT_TRUE(p[0] != p[1] && p[1] != p[2] && p[0] != p[2]);
    // The triangle lies close by: its corners within two steps of the lattice.
    const Vector3d place = ball.mesh.vertices_mm[n].cast<double>();
    for (const auto point : p) ASSERT_LT((ball.tissue.points.lps_mm(point) - place).norm(), 2.5);
    ASSERT_LT(binding.offsets_tnb_mm[n].norm(), 1.2F);
  }
}

TEST(Bind, RestPoseGivesTheMeshBack) {
  for (const Matrix3d& direction : {Matrix3d(Matrix3d::Identity()), shapes::mirror(), shapes::oblique()}) {
    const Case ball = ball_case(direction);
    const SurfaceBinding binding = bind(ball.mesh, ball.tissue);
    std::vector<float> vertices;
    std::vector<float> normals;
    palpate::surface::deform_reference(binding, ball.tissue.points.center_mm, ball.tissue.points.positions_mm,
                                       vertices, normals);
    ASSERT_EQ(vertices.size(), 3 * binding.size());
    for (std::size_t n = 0; n < binding.size(); ++n) {
      // Two roundings at coordinates below 64 mm (3.8e-6 each) and those of an offset of 1 mm (1e-7).
      ASSERT_LT((vertex_of(vertices, n) - ball.mesh.vertices_mm[n]).cwiseAbs().maxCoeff(), 8e-6F);
      ASSERT_LT((vertex_of(normals, n) - ball.mesh.normals[n]).norm(), 4e-7F);
    }
  }
}

TEST(Bind, ARigidMotionMovesTheSurfaceRigidly) {
  const Case ball = ball_case(shapes::oblique());
  const SurfaceBinding binding = bind(ball.mesh, ball.tissue);
  const Matrix3d rotation =
      (Eigen::AngleAxisd(2.1, Vector3d::UnitY()) * Eigen::AngleAxisd(-1.3, Vector3d::UnitZ()))
          .toRotationMatrix();
  const Vector3d shift(17.0, -250.0, 3.5);
  const auto& points = ball.tissue.points.positions_mm;
  double worst = 0.0;
  double worst_normal = 0.0;
  for (std::size_t n = 0; n < binding.size(); ++n) {
    std::array<Vector3d, 3> rest;
    std::array<Vector3d, 3> moved;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      rest[corner] = points[binding.points[n][corner]].cast<double>();
      moved[corner] = rotation * rest[corner] + shift;
    }
    const auto before = palpate::surface::deform_vertex(binding, n, rest[0], rest[1], rest[2]);
    const auto after = palpate::surface::deform_vertex(binding, n, moved[0], moved[1], moved[2]);
    worst = std::max(worst, (after.position_mm - rotation * before.position_mm - shift).norm());
    worst_normal = std::max(worst_normal, (after.normal - rotation * before.normal).norm());
  }
  // Double rounding at 250 mm is 3e-14; edges of 0.5 mm and angles above a sine of 0.1 enlarge it a
  // hundredfold.
  EXPECT_LT(worst, 1e-10);
  EXPECT_LT(worst_normal, 1e-10);
}

TEST(Bind, TrianglesAreWoundOutwardsAtRest) {
  const Case ball = ball_case(Matrix3d::Identity());
  const SurfaceBinding binding = bind(ball.mesh, ball.tissue);
  std::size_t outwards = 0;
  for (std::size_t n = 0; n < binding.size(); ++n) {
    const auto& p = binding.points[n];
    const Matrix3d basis = triangle_basis(ball.tissue.points.lps_mm(p[0]), ball.tissue.points.lps_mm(p[1]),
                                          ball.tissue.points.lps_mm(p[2]));
    const Vector3d from_center = ball.mesh.vertices_mm[n].cast<double>() - ball.center;
    outwards += basis.col(1).dot(from_center) > 0.0 ? 1U : 0U;
  }
  // Steep triangles (a corner one layer down) may go either way; nearly all lie along the surface.
  EXPECT_GT(static_cast<double>(outwards), 0.95 * static_cast<double>(binding.size()));
}

TEST(Bind, VerticesDoNotBridgeSeparatePieces) {
  // Two sheets, two spacings apart; vertices between them, closer to one.
  std::vector<Vector3f> positions;
  for (const float z : {0.0F, 2.0F})
    for (int j = 0; j < 6; ++j)
      for (int i = 0; i < 6; ++i) positions.emplace_back(static_cast<float>(i), static_cast<float>(j), z);
  const Tissue tissue = tissue_of(positions, 1.5F);
  std::vector<Vector3f> vertices;
  for (int n = 0; n < 20; ++n)
    vertices.emplace_back(0.13F + 0.24F * static_cast<float>(n), 2.3F, n % 2 == 0 ? 0.9F : 1.1F);
  const SurfaceBinding binding = bind(single(vertices), tissue);
  for (std::size_t n = 0; n < vertices.size(); ++n)
    for (const auto point : binding.points[n]) EXPECT_EQ(positions[point].z(), n % 2 == 0 ? 0.0F : 2.0F) << n;
}

TEST(Bind, AThinSheetWorks) {
  std::vector<Vector3f> positions;
  for (int j = 0; j < 8; ++j)
    for (int i = 0; i < 8; ++i) positions.emplace_back(static_cast<float>(i), static_cast<float>(j), 0.0F);
  const Tissue tissue = tissue_of(positions, 1.1F);
  const std::vector<Vector3f> vertices{{3.3F, 4.6F, 0.5F}, {3.3F, 4.6F, -0.5F}, {-1, -1, 0}, {9, 3, 2}};
  TriangleMesh mesh = single(vertices);
  mesh.normals[1] = -Vector3f::UnitZ();
  const SurfaceBinding binding = bind(mesh, tissue);
  auto bent = positions;
  for (auto& point : bent) point += Vector3f(0, 0, 5);
  std::vector<float> xyz;
  std::vector<float> normals;
  palpate::surface::deform_reference(binding, Vector3d::Zero(), bent, xyz, normals);
  for (std::size_t n = 0; n < vertices.size(); ++n) {
    // A shift by 5 mm along z; a few roundings of numbers below 16.
    EXPECT_LT((vertex_of(xyz, n) - vertices[n] - Vector3f(0, 0, 5)).norm(), 4e-6F);
    EXPECT_LT((vertex_of(normals, n) - mesh.normals[n]).norm(), 4e-7F);
  }
}

TEST(Bind, CollapsedPointsGiveFiniteVertices) {
  const Case ball = ball_case(Matrix3d::Identity());
  const SurfaceBinding binding = bind(ball.mesh, ball.tissue);
  std::vector<float> xyz;
  std::vector<float> normals;
  auto positions = ball.tissue.points.positions_mm;
  for (const int kind : {0, 1, 2}) {
    for (auto& point : positions) {
      if (kind == 0) point = Vector3f(1, 2, 3);
      if (kind == 1) point = Vector3f(point.x(), 0, 0);
      if (kind == 2) point = Vector3f::Zero();
    }
    palpate::surface::deform_reference(binding, ball.tissue.points.center_mm, positions, xyz, normals);
    for (std::size_t n = 0; n < binding.size(); ++n) {
      ASSERT_TRUE(vertex_of(xyz, n).allFinite());
      ASSERT_NEAR(vertex_of(normals, n).norm(), 1.0F, 1e-5F);  // a few float roundings of unit vectors
    }
    positions = ball.tissue.points.positions_mm;
  }
}

TEST(Bind, NeedsThreePointsThatAreNotInLine) {
  const TriangleMesh mesh = single({{0, 0, 1}});
  const auto code = [&](const std::vector<Vector3f>& positions) {
    try {
      bind(mesh, tissue_of(positions, 1.5F));
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), core::ErrorKind::input);
      return error.code();
    }
    return std::string("none");
  };
  EXPECT_EQ(code({}), "no-triangle");
  EXPECT_EQ(code({{0, 0, 0}, {1, 0, 0}}), "no-triangle");
  EXPECT_EQ(code({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}), "no-triangle");
  EXPECT_EQ(code({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}), "none");
  EXPECT_EQ(code({{0, 0, 0}, {9, 0, 0}, {9, 9, 0}}), "none");  // without links, but a triangle
  // A long straight row with one side branch: even far from the branch there is an answer.
  std::vector<Vector3f> row;
  for (int n = 0; n < 100; ++n) row.emplace_back(static_cast<float>(n), 0.0F, 0.0F);
  row.emplace_back(99.0F, 1.0F, 0.0F);
  EXPECT_EQ(code(row), "none");
}

TEST(Bind, IsDeterministicAndStops) {
  const Case ball = ball_case(Matrix3d::Identity());
  const SurfaceBinding one = bind(ball.mesh, ball.tissue);
  const SurfaceBinding two = bind(ball.mesh, ball.tissue);
  EXPECT_EQ(one.points, two.points);
  EXPECT_EQ(one.weights, two.weights);
  const core::CancelToken cancel;
  const core::Progress progress(
      [&](double fraction, const std::string&) {
        if (fraction > 0.2) cancel.cancel();
      },
      cancel);
  try {
    bind(ball.mesh, ball.tissue, progress);
    FAIL() << "was not stopped";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::cancelled);
  }
}

TEST(Bind, AHeartSizedTissueIsQuick) {
  // A shell of some 680 thousand points, without noise and with the six links, made by hand: only the binding
  // is timed.
  const ImageGeometry geometry({116, 200, 117}, {0.5, 0.5, 0.5}, {0, 0, 0});
  const auto volume = shapes::volume_of(geometry, [&](const Vector3d& place) {
    const double r = (place - geometry.center_mm()).cwiseQuotient(Vector3d(27, 47, 27)).norm();
    return 100.0 - 50.0 * std::abs(r - 0.85) / 0.14;
  });
  model::TissueParameters parameters;
  parameters.threshold_low = 50.0;
  parameters.links = model::LinkRule::six;
  const Tissue tissue = model::generate(volume, parameters);
  palpate::surface::ExtractParameters surface;
  surface.iso_value = 50.0;
  const TriangleMesh mesh = palpate::surface::extract(volume, surface);
  const auto start = std::chrono::steady_clock::now();
  const SurfaceBinding binding = bind(mesh, tissue);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf("[measured] bind %zu vertices over %zu points: %.2f s\n", binding.size(), tissue.points.size(),
              seconds);
  EXPECT_EQ(binding.size(), mesh.vertices_mm.size());
  EXPECT_LT(seconds, 10.0);  // well under a second by itself; the rest is for a busy machine
}
