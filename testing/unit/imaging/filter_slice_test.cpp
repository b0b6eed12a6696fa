#include "filter_volumes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/filters.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <string>
#include <sys/resource.h>

// What holds for every filter: a slice equals that of the whole, odd shapes
// work, nothing leaves the range, cancelling stops it, memory is refused.

namespace {

using filter_test::filtered;
using filter_test::made_of;
using filter_test::noise;
using filter_test::strongest;
using palpate::core::CancelToken;
using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::core::Progress;
using palpate::core::Volume;
using palpate::imaging::filter_slice;
using palpate::imaging::filters;
using palpate::imaging::FilterStep;

/// The largest difference between a slice made alone and that of the whole.
double slice_error(const Volume& volume, const Volume& whole, const std::vector<FilterStep>& chain, int axis,
                   int index) {
  const Volume slice = filter_slice(volume, chain, axis, index);
  auto dims = volume.dims();
  dims[static_cast<std::size_t>(axis)] = 1;
  EXPECT_EQ(slice.dims(), dims);
  double worst = 0.0;
  for (std::size_t n = 0; n < slice.size(); ++n) {
    auto place = slice.geometry().ijk_of(n);
    const Eigen::Vector3d at = slice.geometry().to_lps_mm(Eigen::Vector3d(place[0], place[1], place[2]));
    place[static_cast<std::size_t>(axis)] = index;
    const Eigen::Vector3d there = whole.geometry().to_lps_mm(Eigen::Vector3d(place[0], place[1], place[2]));
    EXPECT_LT((at - there).norm(), 1e-9);  // rounding of coordinates of some 30 mm
    worst = std::max(worst,
                     std::abs(static_cast<double>(slice.data()[n]) - whole.at(place[0], place[1], place[2])));
  }
  return worst;
}

double worst_slice_error(const Volume& volume, const std::vector<FilterStep>& chain) {
  const Volume whole = filtered(volume, chain);
  double worst = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const int count = volume.dims()[static_cast<std::size_t>(axis)];
    for (const int index : {0, count / 2, count - 1})
      worst = std::max(worst, slice_error(volume, whole, chain, axis, index));
  }
  return worst;
}

TEST(FilterSlice, EqualsTheWholeForEachFilter) {
  const Volume volume = noise({29, 25, 27});
  for (const auto& filter : filters()) {
    if (filter.name == "adaptive") continue;  // has a test of its own
    EXPECT_EQ(worst_slice_error(volume, {{filter.name, {}}}), 0.0) << filter.name;
  }
}

TEST(FilterSlice, EqualsTheWholeForAChainThatMeasuresNothing) {
  const std::vector<FilterStep> chain{{"median", {{"radius_voxels", 2.0}}},
                                      {"gaussian", {{"sigma_mm", 0.6}}},
                                      {"mean", {}},
                                      {"curvature-flow", {{"iterations", 3.0}}}};
  EXPECT_EQ(worst_slice_error(noise({29, 25, 27}), chain), 0.0);
}

TEST(FilterSlice, OfManyStepsOfDiffusionLacksNothingThatCounts) {
  const Volume volume = noise({70, 9, 8});
  for (const auto* name : {"gradient-diffusion", "curvature-diffusion", "curvature-flow"}) {
    const std::vector<FilterStep> chain{{name, {{"iterations", 60.0}}}};
    const Volume whole = filtered(volume, chain);
    // 0.1 % of the range, as the header says.
    EXPECT_LT(slice_error(volume, whole, chain, 0, 35), 0.25) << name;
  }
}

TEST(FilterSlice, OfAChainThatMeasuresItsInputIsClose) {
  // A ball in noise; the slab's mean slope is not quite the whole's.
  filter_test::Scatter scatter;
  const Volume volume = made_of({40, 40, 40}, Eigen::Vector3d::Ones(), [&](int i, int j, int k) {
    return (std::hypot(i - 20.0, j - 20.0, k - 20.0) < 12.0 ? 140.0 : 20.0) + 12.0 * scatter.normal();
  });
  for (const auto* name : {"gradient-diffusion", "bilateral", "patch-denoise"}) {
    const std::vector<FilterStep> chain{{"median", {}}, {name, {}}};
    const Volume whole = filtered(volume, chain);
    // A measure that differs by some 10 % moves what is half smoothed; a tenth
    // of the range at single voxels of an edge, a hundredth on average.
    EXPECT_LT(slice_error(volume, whole, chain, 2, 20), 25.0) << name;
    const Volume slice = filter_slice(volume, chain, 2, 20);
    double sum = 0.0;
    for (std::size_t n = 0; n < slice.size(); ++n)
      sum +=
          std::abs(static_cast<double>(slice.data()[n]) - whole.data()[whole.geometry().index(0, 0, 20) + n]);
    EXPECT_LT(sum / static_cast<double>(slice.size()), 1.5) << name;
  }
}

TEST(FilterSlice, RefusesAPlaceOutside) {
  const Volume volume = noise({5, 4, 3});
  EXPECT_THROW(filter_slice(volume, {{"median", {}}}, 2, 3), Error);
  EXPECT_THROW(filter_slice(volume, {{"median", {}}}, 0, -1), Error);
  EXPECT_THROW(filter_slice(volume, {{"median", {}}}, 3, 0), Error);
}

TEST(EachFilter, TakesAnyShapeAndStaysWithinTheRange) {
  for (const auto& dims : {std::array<int, 3>{1, 1, 1},
                           {5, 1, 1},
                           {1, 7, 1},
                           {1, 1, 4},
                           {12, 9, 1},
                           {1, 12, 9},
                           {2, 2, 2},
                           {3, 17, 2}}) {
    const Volume volume = noise(dims);
    std::vector<FilterStep> all = strongest();
    for (const auto& filter : filters()) all.push_back({filter.name, {}});
    for (const FilterStep& step : all) {
      const Volume result = filtered(volume, {step});
      ASSERT_EQ(result.dims(), dims) << step.name;
      for (std::size_t n = 0; n < result.size(); ++n)
        ASSERT_TRUE(std::isfinite(result.data()[n])) << to_string(step) << ' ' << dims[0] << 'x' << dims[1];
      if (step.name == "adaptive") continue;  // it may sharpen
      // The Gaussian's weights are summed in another order than they were normalised.
      const float slack = step.name == "gaussian" ? 1e-4F : 0.0F;
      EXPECT_GE(result.range().min, volume.range().min - slack) << to_string(step);
      EXPECT_LE(result.range().max, volume.range().max + slack) << to_string(step);
    }
  }
}

TEST(EachFilter, LeavesAConstantAlone) {
  const Volume constant = made_of({9, 8, 7}, {0.5, 0.7, 0.9}, [](int, int, int) { return 42.0; });
  for (const auto& filter : filters()) {
    const Volume result = filtered(constant, {{filter.name, {}}});
    for (std::size_t n = 0; n < result.size(); ++n)
      ASSERT_NEAR(result.data()[n], 42.0F, 1e-4F) << filter.name;  // float rounding of weights
  }
}

TEST(EachFilter, ReportsProgressThatOnlyGrowsAndStopsWhenCancelled) {
  const Volume volume = noise({64, 64, 64});
  for (const auto& filter : filters()) {
    if (filter.name == "adaptive") continue;  // has a test of its own
    std::vector<double> fractions;
    const CancelToken cancel;
    const Progress progress(
        [&](double fraction, const std::string&) {
          fractions.push_back(fraction);
          if (fraction > 0.1) cancel.cancel();
        },
        cancel);
    try {
      palpate::imaging::apply_filters(volume, {{filter.name, {}}}, {}, progress);
      ADD_FAILURE() << filter.name << " ran to its end";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::cancelled) << filter.name;
    }
    EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end())) << filter.name;
    EXPECT_LT(fractions.back(), 0.7) << filter.name << " stopped too late";
  }
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
/// In a process of its own that may not take more memory than it has.
void filter_without_memory(const std::string& name, const Volume& volume) {
  std::ifstream statm("/proc/self/statm");
  rlim_t pages = 0;
  statm >> pages;
  const rlim_t bytes = pages * 4096 + (rlim_t{1} << 20U);
  const rlimit limit{bytes, bytes};
  if (setrlimit(RLIMIT_AS, &limit) != 0) std::exit(3);
  try {
    palpate::imaging::apply_filters(volume, {{name, {}}});
  } catch (const Error& error) {
    std::exit(error.code() == "out-of-memory" ? 0 : 2);
  }
  std::exit(1);
}

TEST(EachFilter, WithoutMemorySaysSo) {
  GTEST_FLAG_SET(death_test_style, "fast");
  // More than the 32 MB that malloc may take from what it holds already.
  const Volume volume = made_of({256, 256, 160}, Eigen::Vector3d::Ones(),
                                [](int i, int j, int k) { return (i * 7 + j * 3 + k) % 50; });
  for (const auto* name : {"mean", "gradient-diffusion", "patch-denoise"})
    EXPECT_EXIT(filter_without_memory(name, volume), ::testing::ExitedWithCode(0), "") << name;
}
#endif

}  // namespace
