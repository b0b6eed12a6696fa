#include "palpate/core/geometry.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

using palpate::core::Error;
using palpate::core::ImageGeometry;

namespace {

Eigen::Matrix3d oblique() {
  return (Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(-0.7, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace

TEST(ImageGeometry, ColumnsAreDirectionTimesSpacing) {
  const ImageGeometry geometry({4, 5, 6}, {0.5, 1.0, 2.0}, {10, -20, 30}, oblique());
  const Eigen::Vector3d step_j = geometry.to_lps_mm({0, 1, 0}) - geometry.to_lps_mm({0, 0, 0});
  EXPECT_TRUE(step_j.isApprox(oblique().col(1) * 1.0));
  const Eigen::Vector3d step_k = geometry.to_lps_mm({0, 0, 1}) - geometry.to_lps_mm({0, 0, 0});
  EXPECT_TRUE(step_k.isApprox(oblique().col(2) * 2.0));
  EXPECT_TRUE(geometry.to_lps_mm({0, 0, 0}).isApprox(Eigen::Vector3d(10, -20, 30)));
}

TEST(ImageGeometry, GoesThereAndBackUnderFlippedAndOblique) {
  const Eigen::Matrix3d flipped = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  for (const Eigen::Matrix3d& direction : {flipped, oblique()}) {
    const ImageGeometry geometry({40, 50, 60}, {0.3, 0.7, 1.1}, {-5, 6, 7}, direction);
    const Eigen::Vector3d ijk(12.5, 3.25, 59);
    // A few roundings of numbers below 100.
    EXPECT_LT((geometry.to_ijk(geometry.to_lps_mm(ijk)) - ijk).norm(), 1e-11);
  }
}

TEST(ImageGeometry, IndexRunsFastestAlongI) {
  const ImageGeometry geometry({4, 5, 6}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  EXPECT_EQ(geometry.index(1, 0, 0), 1U);
  EXPECT_EQ(geometry.index(0, 1, 0), 4U);
  EXPECT_EQ(geometry.index(0, 0, 1), 20U);
  EXPECT_EQ(geometry.ijk_of(geometry.index(3, 2, 5)), (std::array<int, 3>{3, 2, 5}));
}

TEST(ImageGeometry, FindsTheAxisOfAPlaneWhenAxesArePermuted) {
  Eigen::Matrix3d sagittal;  // i -> P, j -> S (downwards), k -> L
  sagittal << 0, 0, 1, 1, 0, 0, 0, -1, 0;
  const ImageGeometry geometry({4, 5, 6}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero(), sagittal);
  EXPECT_EQ(geometry.axis_closest_to(0), 2);
  EXPECT_EQ(geometry.axis_closest_to(1), 0);
  EXPECT_EQ(geometry.axis_closest_to(2), 1);
}

TEST(ImageGeometry, RefusesWhatCannotBeGeometry) {
  const Eigen::Vector3d one = Eigen::Vector3d::Ones();
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  EXPECT_THROW(ImageGeometry({0, 1, 1}, one, zero), Error);
  EXPECT_THROW(ImageGeometry({1, 1, 1}, {1, 0, 1}, zero), Error);
  EXPECT_THROW(ImageGeometry({1, 1, 1}, {1, -1, 1}, zero), Error);
  EXPECT_THROW(ImageGeometry({1, 1, 1}, {1, std::nan(""), 1}, zero), Error);
  EXPECT_THROW(ImageGeometry({1, 1, 1}, one, zero, Eigen::Matrix3d::Zero()), Error);
}
