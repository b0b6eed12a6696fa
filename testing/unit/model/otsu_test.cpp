#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

using palpate::core::ImageGeometry;
using palpate::core::Volume;
using palpate::model::CropBox;
using palpate::model::otsu_threshold;

namespace {

Volume volume_of(std::vector<float> voxels) {
  const ImageGeometry geometry({static_cast<int>(voxels.size()), 1, 1}, Eigen::Vector3d::Ones(),
                               Eigen::Vector3d::Zero());
  return Volume(geometry, std::move(voxels));
}

std::vector<float> two_gaussians(int count, double low, double high, double spread, double share_of_high) {
  std::mt19937 engine(7);
  std::normal_distribution<double> normal(0.0, spread);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<float> voxels;
  for (int n = 0; n < count; ++n)
    voxels.push_back(static_cast<float>((uniform(engine) < share_of_high ? high : low) + normal(engine)));
  return voxels;
}

double spread_between(const std::vector<float>& voxels, double threshold) {
  double count[2] = {0, 0};
  double sum[2] = {0, 0};
  for (const float value : voxels) {
    const int side = static_cast<double>(value) >= threshold ? 1 : 0;
    count[side] += 1;
    sum[side] += static_cast<double>(value);
  }
  if (count[0] == 0 || count[1] == 0) return 0.0;
  const double apart = sum[0] / count[0] - sum[1] / count[1];
  return count[0] * count[1] * apart * apart;
}

}  // namespace

TEST(Otsu, SplitsTwoEqualGaussiansInTheMiddle) {
  const Volume volume = volume_of(two_gaussians(40000, 20.0, 140.0, 12.0, 0.5));
  // By symmetry (20 + 140) / 2; a bin is about 0.85 wide and the optimum is flat.
  EXPECT_NEAR(otsu_threshold(volume), 80.0, 3.0);
}

TEST(Otsu, NoOtherThresholdSeparatesBetter) {
  const std::vector<float> voxels = two_gaussians(5000, 10.0, 60.0, 14.0, 0.25);
  const double found = spread_between(voxels, otsu_threshold(volume_of(voxels)));
  for (double threshold = -30.0; threshold < 110.0; threshold += 0.5)
    // 256 bins of about 0.6 place the optimum to within a bin: 0.2 % of a flat maximum.
    EXPECT_LE(spread_between(voxels, threshold), found * 1.002) << threshold;
}

TEST(Otsu, LiesInTheMiddleOfAGap) {
  EXPECT_NEAR(otsu_threshold(volume_of({0, 0, 0, 1, 1})), 0.5, 0.01);
  EXPECT_NEAR(otsu_threshold(volume_of({-50, -50, 150})), 50.0, 1.0);
}

TEST(Otsu, ConstantGivesTheConstant) { EXPECT_EQ(otsu_threshold(volume_of({42, 42, 42, 42})), 42.0); }

TEST(Otsu, LooksAtFiniteVoxelsOnly) {
  const float infinite = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(otsu_threshold(volume_of({0, 0, infinite, nan, 10, 10})),
            otsu_threshold(volume_of({0, 0, 10, 10})));
}

TEST(Otsu, LooksInTheCropOnly) {
  const Volume volume = volume_of({0, 0, 10, 10, 1000, 1000});
  EXPECT_NEAR(otsu_threshold(volume, CropBox{{0, 0, 0}, {4, 1, 1}}), 5.0, 0.1);
  EXPECT_NEAR(otsu_threshold(volume, CropBox{{2, 0, 0}, {99, 99, 99}}), 505.0, 4.0);
}

TEST(Otsu, RefusesAnEmptyCropAndNoVolume) {
  EXPECT_THROW(otsu_threshold(volume_of({1, 2}), CropBox{{2, 0, 0}, {5, 1, 1}}), palpate::core::Error);
  EXPECT_THROW(otsu_threshold(Volume()), palpate::core::Error);
}
