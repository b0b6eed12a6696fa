#include "slice_geometry.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>

using namespace palpate;
using namespace palpate::visualization;

namespace {

core::ImageGeometry geometry(const Eigen::Matrix3d& direction) {
  return {{20, 30, 40}, {0.5, 1.0, 2.0}, {5, -7, 11}, direction};
}

}  // namespace

TEST(SliceFrame, IsRadiologicalUnderIdentity) {
  const auto scan = geometry(Eigen::Matrix3d::Identity());
  const SliceFrame axial = slice_frame(scan, SlicePlane::axial);
  EXPECT_EQ(axial.axis, 2);
  EXPECT_TRUE(axial.right.isApprox(Eigen::Vector3d::UnitX()));  // the patient's left
  EXPECT_TRUE(axial.up.isApprox(-Eigen::Vector3d::UnitY()));    // front
  EXPECT_TRUE(axial.toward.isApprox(-Eigen::Vector3d::UnitZ()));
  const SliceFrame coronal = slice_frame(scan, SlicePlane::coronal);
  EXPECT_EQ(coronal.axis, 1);
  EXPECT_TRUE(coronal.right.isApprox(Eigen::Vector3d::UnitX()));
  EXPECT_TRUE(coronal.up.isApprox(Eigen::Vector3d::UnitZ()));
  const SliceFrame sagittal = slice_frame(scan, SlicePlane::sagittal);
  EXPECT_EQ(sagittal.axis, 0);
  EXPECT_TRUE(sagittal.right.isApprox(Eigen::Vector3d::UnitY()));  // back: seen from the left
  EXPECT_TRUE(sagittal.up.isApprox(Eigen::Vector3d::UnitZ()));
}

TEST(SliceFrame, DoesNotDependOnHowTheVoxelsAreStored) {
  Eigen::Matrix3d stored;  // i runs to the feet, j to the right, k to the front
  stored << 0, -1, 0, 0, 0, -1, -1, 0, 0;
  for (const SlicePlane plane : {SlicePlane::axial, SlicePlane::coronal, SlicePlane::sagittal}) {
    const SliceFrame plain = slice_frame(geometry(Eigen::Matrix3d::Identity()), plane);
    const SliceFrame other = slice_frame(geometry(stored), plane);
    EXPECT_TRUE(other.right.isApprox(plain.right));
    EXPECT_TRUE(other.up.isApprox(plain.up));
    EXPECT_EQ(plane_of_axis(geometry(stored), other.axis), plane);
  }
  EXPECT_EQ(slice_frame(geometry(stored), SlicePlane::axial).axis, 0);
}

TEST(SliceFrame, StaysInTheVoxelsPlaneWhenSheared) {
  Eigen::Matrix3d sheared = Eigen::Matrix3d::Identity();
  sheared.col(2) = Eigen::Vector3d(0.0, 0.4, 1.0).normalized();
  sheared.col(1) = Eigen::Vector3d(0.2, 1.0, 0.0).normalized();
  const SliceFrame axial = slice_frame(geometry(sheared), SlicePlane::axial);
  // Unit vectors: their products are exact to a few roundings.
  EXPECT_NEAR(axial.toward.dot(sheared.col(0)), 0.0, 1e-12);
  EXPECT_NEAR(axial.toward.dot(sheared.col(1)), 0.0, 1e-12);
  EXPECT_NEAR(axial.right.cross(axial.up).dot(axial.toward), 1.0, 1e-12);
}

TEST(SliceFrame, PlacesOutsideTheScanShowItsLastSlice) {
  const auto scan = geometry(Eigen::Matrix3d::Identity());
  EXPECT_EQ(slice_through(scan, 2, {0, 0, 11 + 2.0 * 7}), 7);
  EXPECT_EQ(slice_through(scan, 2, {0, 0, -1e9}), 0);
  EXPECT_EQ(slice_through(scan, 2, {0, 0, 1e9}), 39);
  EXPECT_EQ(slice_through(scan, 2, Eigen::Vector3d::Constant(std::nan(""))), 0);
}

TEST(SideLetters, NameOneSideOrTwo) {
  EXPECT_EQ(side_letters({1, 0, 0}), "L");
  EXPECT_EQ(side_letters({-1, 0.1, 0}), "R");
  EXPECT_EQ(side_letters({0, -1, 0}), "A");
  EXPECT_EQ(side_letters({0, 0.9, 0.6}), "PS");
  EXPECT_EQ(side_letters({0.4, 0.3, -1}), "I");  // 21.8 and 16.7 degrees off
}

TEST(CutByPlane, LeavesACircleOfASphere) {
  // A sphere of radius 10 around (1, 2, 3), from latitudes and longitudes.
  constexpr int rings = 60;
  constexpr int around = 120;
  std::vector<float> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (int r = 0; r <= rings; ++r) {
    for (int a = 0; a < around; ++a) {
      const double polar = M_PI * r / rings;
      const double turn = 2.0 * M_PI * a / around;
      for (const double place : {1 + 10 * std::sin(polar) * std::cos(turn),
                                 2 + 10 * std::sin(polar) * std::sin(turn), 3 + 10 * std::cos(polar)})
        vertices.push_back(static_cast<float>(place));
      if (r == rings) continue;
      const auto at = [&](int ring, int step) {
        return static_cast<std::uint32_t>(ring * around + step % around);
      };
      triangles.push_back({at(r, a), at(r + 1, a), at(r + 1, a + 1)});
      triangles.push_back({at(r, a), at(r + 1, a + 1), at(r, a + 1)});
    }
  }
  const Eigen::Vector3d normal = Eigen::Vector3d(1, 1, 2).normalized();
  const Eigen::Vector3d origin = Eigen::Vector3d(1, 2, 3) + 6.0 * normal;
  const auto ends = cut_by_plane(vertices.data(), vertices.size() / 3, triangles, origin, normal);
  ASSERT_GT(ends.size(), 100U);
  double length = 0.0;
  for (std::size_t n = 0; n < ends.size(); n += 2) {
    const Eigen::Vector3d place = ends[n].cast<double>() - origin;
    EXPECT_NEAR(place.dot(normal), 0.0, 1e-4);  // floats near 10: 1e-6, times a few operations
    // The faces lie inside the sphere by at most 10 (1 - cos(pi / 60)) = 0.014.
    EXPECT_NEAR(place.norm(), 8.0, 0.03);
    length += (ends[n + 1] - ends[n]).norm();
  }
  EXPECT_NEAR(length, 2.0 * M_PI * 8.0, 0.2);  // closed: no piece is missing
}

TEST(CutByPlane, CountsAVertexOnThePlaneOnce) {
  const std::vector<float> square{-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0, 0, 0, 1};
  const auto on_edge = cut_by_plane(square.data(), 5, {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}, {7, 8, 9}},
                                    Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX());
  double length = 0.0;
  for (std::size_t n = 0; n < on_edge.size(); n += 2) length += (on_edge[n + 1] - on_edge[n]).norm();
  // Through the tip: two flanks of length sqrt(2); the face of missing vertices is left out.
  EXPECT_NEAR(length, 2.0 * std::sqrt(2.0), 1e-5);
}

TEST(Lengths, AreRoundAndNamed) {
  EXPECT_DOUBLE_EQ(nice_length(37.0), 20.0);
  EXPECT_DOUBLE_EQ(nice_length(50.0), 50.0);
  EXPECT_DOUBLE_EQ(nice_length(9.99), 5.0);
  EXPECT_DOUBLE_EQ(nice_length(0.0123), 0.01);
  EXPECT_EQ(length_text(20.0, false), "20 mm");
  EXPECT_EQ(length_text(0.5, false), "0.5 mm");
  EXPECT_EQ(length_text(1.0, true), "1 voxel");
  EXPECT_EQ(length_text(50.0, true), "50 voxels");
  EXPECT_EQ(short_number(1023.6), "1024");
  EXPECT_EQ(short_number(-0.0), "0");
}
