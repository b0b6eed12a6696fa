#include "palpate/imaging/adaptive.hpp"

#include "adaptive/engine.hpp"
#include "device_test.hpp"
#include "phantom_contrast.hpp"

#include "palpate/imaging/filters.hpp"
#include "palpate/testing/support.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

namespace palpate::imaging {
namespace {

using testing::PhantomContrast;

class AdaptiveKernels : public testing::DeviceTest {};

core::Volume noise(const std::array<int, 3>& dims, const Eigen::Vector3d& spacing_mm, unsigned seed) {
  std::mt19937 engine(seed);
  const core::ImageGeometry geometry(dims, spacing_mm, Eigen::Vector3d::Zero());
  std::vector<float> voxels(geometry.voxel_count());
  for (float& voxel : voxels) voxel = static_cast<float>(engine() % 256U);
  return {geometry, std::move(voxels)};
}

double largest_difference(const core::Volume& a, const core::Volume& b) {
  double largest = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n)
    largest =
        std::max(largest, std::abs(static_cast<double>(a.data()[n]) - static_cast<double>(b.data()[n])));
  return largest;
}

/// A float keeps 6e-8 of a grey value; a response sums some 350 products of
/// weights whose sizes add to less than 10, and the control tensor turns the
/// error of a ratio of eigenvalues into at most a few times it. Two passes: 2e-5
/// of the range leaves a factor of about ten over what was seen (2.4e-6).
constexpr double tolerance = 2e-5 * 255.0;

TEST_F(AdaptiveKernels, AgreeWithTheTwinInDouble) {
  struct Case {
    std::array<int, 3> dims;
    Eigen::Vector3d spacing_mm;
    AdaptiveParameters parameters;
  };
  AdaptiveParameters wide;
  wide.scale_voxels = 3.3;
  wide.contrast_percent = 120.0;
  AdaptiveParameters fine;
  fine.scale_voxels = 1.0;
  fine.neighbourhood_scales = 0.5;
  fine.contrast_percent = 5.0;
  fine.passes = 1;
  const std::vector<Case> cases{
      {{27, 23, 16}, {1.0, 1.0, 1.0}, {}},  {{13, 10, 6}, {0.4, 0.4, 1.1}, wide},
      {{25, 7, 12}, {0.8, 0.3, 0.5}, fine}, {{50, 41, 1}, {0.5, 0.5, 1.0}, {}},
      {{1, 30, 19}, {1.0, 0.7, 0.7}, {}},   {{40, 1, 1}, {1.0, 1.0, 1.0}, fine},
      {{3, 2, 2}, {1.0, 1.0, 1.0}, {}},     {{1, 1, 1}, {1.0, 1.0, 1.0}, {}},
  };
  unsigned seed = 1;
  for (const Case& one : cases) {
    const core::Volume volume = noise(one.dims, one.spacing_mm, seed++);
    const auto twin = adaptive_filter(volume, one.parameters, volume.range(), "reference");
    // All widths once, then the one that suits the device.
    const std::vector<int> widths = seed == 2 ? std::vector<int>{1, 4, 8, 16} : std::vector<int>{0};
    for (const int lanes : widths) {
      const adaptive::Work work{device(), lanes, 4.0e6};
      const auto result = adaptive::run(volume, one.parameters, volume.range(), work, {});
      EXPECT_LT(largest_difference(result, twin), tolerance)
          << one.dims[0] << "x" << one.dims[1] << "x" << one.dims[2] << ", " << lanes << " lanes";
    }
  }
}

TEST_F(AdaptiveKernels, GiveTheSameInBlocksOfAnySize) {
  const core::Volume volume = noise({61, 44, 38}, {1.0, 1.0, 1.2}, 5);
  const AdaptiveParameters parameters;
  const auto whole = adaptive::run(volume, parameters, volume.range(), {device(), 0, 4.0e6}, {});
  const auto blocks = adaptive::run(volume, parameters, volume.range(), {device(), 0, 9.0e4}, {});
  // A voxel sees the same numbers in the same order, whatever block it lies in.
  EXPECT_EQ(largest_difference(whole, blocks), 0.0);
  const auto twin = adaptive::run(volume, parameters, volume.range(), {std::nullopt, 0, 9.0e4}, {});
  EXPECT_LT(largest_difference(twin, blocks), tolerance);
}

TEST_F(AdaptiveKernels, SliceOfASlabIsTheSliceOfTheWhole) {
  const core::Volume volume = noise({24, 20, 90}, {1.0, 1.0, 1.0}, 6);
  AdaptiveParameters parameters;
  parameters.passes = 1;
  const int reach = adaptive_reach(volume.geometry(), parameters)[2];
  const int middle = 45;
  ASSERT_LT(reach, middle);
  const core::ImageGeometry slab_geometry({24, 20, 2 * reach + 1}, Eigen::Vector3d::Ones(),
                                          Eigen::Vector3d::Zero());
  const float* const begin = volume.data() + volume.geometry().index(0, 0, middle - reach);
  const core::Volume slab(slab_geometry, std::vector<float>(begin, begin + slab_geometry.voxel_count()));
  const auto whole = adaptive_filter(volume, parameters, volume.range());
  const auto part = adaptive_filter(slab, parameters, volume.range());
  for (int j = 0; j < 20; ++j)
    for (int i = 0; i < 24; ++i) ASSERT_EQ(part.at(i, j, reach), whole.at(i, j, middle)) << i << " " << j;
}

TEST_F(AdaptiveKernels, ReportProgressThatOnlyGrowsAndStopWhenCancelled) {
  const core::Volume volume = noise({61, 44, 38}, {1.0, 1.0, 1.2}, 5);
  std::vector<double> fractions;
  const core::CancelToken token;
  const core::Progress progress(
      [&](double fraction, const std::string&) {
        fractions.push_back(fraction);
        if (fraction > 0.6) token.cancel();
      },
      token);
  try {
    adaptive::run(volume, {}, volume.range(), {device(), 0, 9.0e4}, progress);
    FAIL() << "ran to its end";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::cancelled);
  }
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_LT(fractions.back(), 0.7);  // the report that asked for it is the last
}

// The claim of the filter. A median's radius is a whole number of voxels, so
// the adaptive filter is set to the median: `contrast_percent` is bisected, all
// else as it comes, until the border is as wide as the median leaves it.
void expect_more_contrast_than_medians(int size, std::uint64_t seed, int largest_radius) {
  const PhantomContrast phantom(size, seed);
  const core::Volume& speckled = phantom.speckled();
  ASSERT_GT(phantom.border_places(), 1000U);
  const auto print = [&](const std::string& name, double edge_mm, double contrast) {
    std::printf("size %d seed %d  %-34s  edge %.3f mm  contrast-to-noise %.3f\n", size,
                static_cast<int>(seed), name.c_str(), edge_mm, contrast);
  };
  print("unfiltered", phantom.edge_width_mm(speckled), phantom.contrast_to_noise(speckled));
  AdaptiveParameters parameters;
  const auto standard = adaptive_filter(speckled, parameters, speckled.range());
  print("adaptive as it comes", phantom.edge_width_mm(standard), phantom.contrast_to_noise(standard));
  for (int radius = 1; radius <= largest_radius; ++radius) {
    const auto median =
        apply_filters(speckled, {{"median", {{"radius_voxels", static_cast<double>(radius)}}}}).volume;
    const double edge_mm = phantom.edge_width_mm(median);
    const double contrast = phantom.contrast_to_noise(median);
    print("median, radius " + std::to_string(radius), edge_mm, contrast);
    double low = adaptive_contrast_percent.low;
    double high = adaptive_contrast_percent.high;
    double found_edge_mm = 0.0;
    double found_contrast = 0.0;
    for (int step = 0; step < 12 && std::abs(found_edge_mm / edge_mm - 1.0) > 0.03; ++step) {
      parameters.contrast_percent = std::sqrt(low * high);
      const auto adaptive = adaptive_filter(speckled, parameters, speckled.range());
      found_edge_mm = phantom.edge_width_mm(adaptive);
      found_contrast = phantom.contrast_to_noise(adaptive);
      (found_edge_mm < edge_mm ? low : high) = parameters.contrast_percent;
    }
    print("adaptive, contrast_percent " + std::to_string(parameters.contrast_percent), found_edge_mm,
          found_contrast);
    EXPECT_NEAR(found_edge_mm / edge_mm, 1.0, 0.05) << "no setting gives the median's edge";
    EXPECT_GT(found_contrast, contrast) << "median radius " << radius;
  }
}

TEST_F(AdaptiveKernels, RaiseContrastToNoiseMoreThanAMedianWithTheSameEdge) {
  expect_more_contrast_than_medians(96, 3, 2);
  if (testing::repetitions(0, 1) == 0) return;
  expect_more_contrast_than_medians(128, 2, 3);
  expect_more_contrast_than_medians(128, 9, 3);
  expect_more_contrast_than_medians(160, 4, 3);
}

}  // namespace
}  // namespace palpate::imaging
