#include "palpate/imaging/speckle.hpp"

#include "filter_volumes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/phantom.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using filter_test::filtered;
using filter_test::made_of;
using filter_test::Scatter;
using palpate::core::Volume;
using palpate::imaging::measure_speckle;

/// An envelope of fully developed speckle with mean square 2 sigma^2.
double rayleigh(Scatter& scatter, double sigma) {
  return sigma * std::sqrt(-2.0 * std::log(1.0 - scatter.next()));
}

TEST(Speckle, OfARayleighEnvelopeHasItsKnownRatio) {
  Scatter scatter;
  const Volume volume =
      made_of({64, 64, 64}, Eigen::Vector3d::Ones(), [&](int, int, int) { return rayleigh(scatter, 40.0); });
  const auto found = measure_speckle(volume);
  EXPECT_EQ(found.block_voxels, (std::array<int, 3>{8, 8, 8}));
  EXPECT_EQ(found.tissue_blocks, 512);
  EXPECT_EQ(found.blocks, 128);
  // sqrt(pi/2) / sqrt(2 - pi/2) = 1.913. A block's deviation of 512 samples errs
  // by 3.4 %, the median of 128 blocks by 0.4 %; five times that.
  EXPECT_NEAR(found.snr, 1.913, 0.04);
  EXPECT_NEAR(found.mean, 40.0 * std::sqrt(std::acos(-1.0) / 2.0), 0.5);
  EXPECT_NEAR(found.looks, found.snr * found.snr, 1e-12);
}

TEST(Speckle, OfAveragedLooksCountsThem) {
  // The sum of n exponential intensities is Gamma(n): n looks, snr = sqrt(n).
  for (const int looks : {1, 4, 16}) {
    Scatter scatter;
    const Volume volume = made_of({64, 64, 48}, Eigen::Vector3d::Ones(), [&](int, int, int) {
      double sum = 0.0;
      for (int n = 0; n < looks; ++n) sum -= std::log(1.0 - scatter.next());
      return 20.0 * sum;
    });
    // A block's deviation errs by up to 6.3 % (an exponential's kurtosis), the
    // median of 96 blocks by 0.8 % and leans by 1 % to the small; looks are its
    // square.
    EXPECT_NEAR(measure_speckle(volume).looks, looks, 0.08 * looks);
  }
}

TEST(Speckle, IsMeasuredInTissueAndNotAcrossItsBorder) {
  Scatter scatter;
  const Volume volume = made_of({80, 80, 64}, Eigen::Vector3d::Ones(), [&](int i, int j, int k) {
    const bool tissue = std::hypot(i - 40.0, j - 40.0, k - 32.0) < 27.0;
    return rayleigh(scatter, tissue ? 60.0 : 3.0);
  });
  const auto found = measure_speckle(volume);
  // 82 000 voxels of tissue hold some 100 whole blocks.
  EXPECT_GT(found.blocks, 10);
  EXPECT_LT(found.tissue_blocks, 300);
  EXPECT_NEAR(found.snr, 1.913, 0.12);  // of fewer blocks
  EXPECT_NEAR(found.mean, 60.0 * 1.2533, 3.0);
  EXPECT_GT(found.bright, 5.0 * found.dark);
}

TEST(Speckle, OfThePhantomRisesWithAFilterAtTheSamePlaces) {
  palpate::imaging::PhantomParameters parameters;
  parameters.size = 96;
  const Volume volume = palpate::imaging::make_phantom(parameters).frames.front();
  const auto before = measure_speckle(volume);
  ASSERT_GT(before.blocks, 3);
  EXPECT_NEAR(before.mean, 140.0, 45.0);  // a wall of 140 that dims with depth
  const auto after = measure_speckle(filtered(volume, {{"median", {}}}), volume);
  EXPECT_EQ(after.blocks, before.blocks);
  EXPECT_EQ(after.threshold, before.threshold);
  EXPECT_GT(after.snr, 1.2 * before.snr);
  EXPECT_GT(after.cnr, before.cnr);
  EXPECT_NEAR(after.mean, before.mean, 0.05 * before.mean);
}

TEST(Speckle, OfAPictureTakesSquaresAndOfNothingSaysNone) {
  Scatter scatter;
  const Volume picture =
      made_of({128, 96, 1}, Eigen::Vector3d::Ones(), [&](int, int, int) { return rayleigh(scatter, 40.0); });
  const auto found = measure_speckle(picture);
  EXPECT_EQ(found.block_voxels, (std::array<int, 3>{16, 16, 1}));
  EXPECT_EQ(found.blocks, 12);
  EXPECT_NEAR(found.snr, 1.913, 0.15);  // 12 blocks of 256 samples: 1.9 % each way, four times that
  const Volume flat = made_of({32, 32, 32}, Eigen::Vector3d::Ones(), [](int, int, int) { return 7.0; });
  const auto none = measure_speckle(flat);
  EXPECT_EQ(none.blocks, 0);
  EXPECT_EQ(none.snr, 0.0);
  EXPECT_EQ(none.cnr, 0.0);
  EXPECT_THROW(measure_speckle(flat, picture), palpate::core::Error);
}

TEST(Speckle, OfNegativeValuesCountsFromTheSmallest) {
  Scatter scatter;
  const Volume volume = made_of({64, 64, 32}, Eigen::Vector3d::Ones(),
                                [&](int, int, int) { return rayleigh(scatter, 40.0) - 500.0; });
  EXPECT_NEAR(measure_speckle(volume).snr, 1.913, 0.05);
}

}  // namespace
