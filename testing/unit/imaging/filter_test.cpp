#include "palpate/core/error.hpp"
#include "palpate/imaging/filters.hpp"

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

namespace {

using palpate::core::CancelToken;
using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::core::ImageGeometry;
using palpate::core::Progress;
using palpate::core::Volume;
using palpate::imaging::filters;
using palpate::imaging::FilterStep;
using palpate::imaging::parse_filter;

Volume apply_filters(const Volume& volume, const std::vector<FilterStep>& chain,
                     const Progress& progress = {}) {
  return palpate::imaging::apply_filters(volume, chain, {}, progress).volume;
}

/// Words without pattern, the same everywhere.
std::vector<float> scattered(std::size_t count) {
  std::vector<float> values;
  std::uint32_t state = 12345;
  for (std::size_t n = 0; n < count; ++n) {
    state = state * 1664525U + 1013904223U;
    values.push_back(static_cast<float>(state >> 16U) / 97.0F - 200.0F);
  }
  return values;
}

ImageGeometry oblique(std::array<int, 3> dims, const Eigen::Vector3d& spacing) {
  Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  turn.col(1) *= -1.0;  // left-handed too
  return {dims, spacing, Eigen::Vector3d(-31.7, 12.25, 5.1), turn};
}

Volume scattered_volume(std::array<int, 3> dims) {
  const auto geometry = oblique(dims, {0.4, 0.7, 1.9});
  return {geometry, scattered(geometry.voxel_count())};
}

void expect_same_geometry(const Volume& a, const Volume& b) {
  EXPECT_EQ(a.dims(), b.dims());
  EXPECT_EQ(std::memcmp(a.geometry().ijk_to_lps_mm().data(), b.geometry().ijk_to_lps_mm().data(),
                        16 * sizeof(double)),
            0);
  EXPECT_EQ(a.geometry().spacing_mm(), b.geometry().spacing_mm());
}

/// The middle of the block around a voxel, places outside taken from the border.
float median_by_sorting(const Volume& volume, int i, int j, int k, int radius) {
  std::vector<float> block;
  const auto& dims = volume.dims();
  for (int dk = -radius; dk <= radius; ++dk)
    for (int dj = -radius; dj <= radius; ++dj)
      for (int di = -radius; di <= radius; ++di)
        block.push_back(volume.at(std::clamp(i + di, 0, dims[0] - 1), std::clamp(j + dj, 0, dims[1] - 1),
                                  std::clamp(k + dk, 0, dims[2] - 1)));
  std::sort(block.begin(), block.end());
  return block[block.size() / 2];
}

void expect_median(const Volume& volume, int radius) {
  const Volume filtered = apply_filters(volume, {{"median", {{"radius_voxels", radius}}}});
  expect_same_geometry(volume, filtered);
  for (std::size_t n = 0; n < volume.size(); ++n) {
    const auto [i, j, k] = volume.geometry().ijk_of(n);
    // The median is one of the values: no rounding, no tolerance.
    ASSERT_EQ(filtered.data()[n], median_by_sorting(volume, i, j, k, radius)) << i << ' ' << j << ' ' << k;
  }
}

TEST(MedianFilter, EqualsSortingEveryBlock) {
  expect_median(scattered_volume({11, 9, 7}), 1);
  expect_median(scattered_volume({11, 9, 7}), 2);
}

TEST(MedianFilter, TakesAPictureOfOneSliceAndALine) {
  expect_median(scattered_volume({12, 8, 1}), 2);
  expect_median(scattered_volume({9, 1, 1}), 1);
}

TEST(MedianFilter, RemovesSpecksAndKeepsAnEdge) {
  const ImageGeometry geometry({8, 8, 8}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  std::vector<float> voxels(geometry.voxel_count());
  for (std::size_t n = 0; n < voxels.size(); ++n) voxels[n] = geometry.ijk_of(n)[0] < 4 ? 10.0F : 200.0F;
  const std::vector<float> clean = voxels;
  voxels[geometry.index(2, 3, 3)] = 255.0F;
  voxels[geometry.index(6, 3, 5)] = 0.0F;
  const Volume filtered = apply_filters({geometry, voxels}, {{"median", {}}});
  EXPECT_TRUE(std::equal(clean.begin(), clean.end(), filtered.data()));
}

TEST(GaussianFilter, AnImpulseSpreadsBySigmaInMillimetres) {
  const double sigma = 1.5;
  const auto geometry = oblique({41, 31, 17}, {0.5, 0.75, 1.5});
  std::vector<float> voxels(geometry.voxel_count(), 0.0F);
  voxels[geometry.index(20, 15, 8)] = 1000.0F;
  const Volume filtered = apply_filters({geometry, voxels}, {{"gaussian", {{"sigma_mm", sigma}}}});
  double sum = 0.0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Vector3d second = Eigen::Vector3d::Zero();
  for (std::size_t n = 0; n < filtered.size(); ++n) {
    const auto [i, j, k] = geometry.ijk_of(n);
    const Eigen::Vector3d from = Eigen::Vector3d(i - 20, j - 15, k - 8).cwiseProduct(geometry.spacing_mm());
    const double weight = filtered.data()[n];
    EXPECT_GE(weight, 0.0);
    sum += weight;
    first += weight * from;
    second += weight * from.cwiseProduct(from);
  }
  // The kernel is normalised; what is left is float rounding of 20 000 values.
  EXPECT_NEAR(sum, 1000.0, 1e-2);
  // It leaves off 1e-4 of its weight, which lies beyond 3.9 sigma, so it takes
  // some 0.15 % of the variance with it; 0.5 % allows for that.
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(first[axis] / sum, 0.0, 1e-6);
    EXPECT_NEAR(second[axis] / sum, sigma * sigma, 0.005 * sigma * sigma) << "axis " << axis;
  }
  expect_same_geometry({geometry, voxels}, filtered);
}

TEST(GaussianFilter, AWaveIsDampedAsTheHeatEquationSays) {
  // cos(q x) on a grid of spacing h is damped by exp(-sigma^2 (1 - cos(q h)) / h^2):
  // the discrete Gaussian solves du/dt = half the second difference for t = sigma^2.
  const double sigma = 0.9;
  const double h = 0.3;
  const ImageGeometry geometry({160, 1, 1}, {h, 1.0, 1.0}, Eigen::Vector3d::Zero());
  const double q = 2.0 * 3.14159265358979 / (12.0 * h);
  std::vector<float> voxels;
  for (int i = 0; i < 160; ++i) voxels.push_back(static_cast<float>(100.0 * std::cos(q * h * i)));
  const Volume filtered = apply_filters({geometry, voxels}, {{"gaussian", {{"sigma_mm", sigma}}}});
  const double damping = std::exp(-sigma * sigma * (1.0 - std::cos(q * h)) / (h * h));
  // Away from the ends; 1e-4 of the weight is left off, of values up to 100.
  for (int i = 40; i < 120; ++i)
    EXPECT_NEAR(filtered.at(i, 0, 0), damping * 100.0 * std::cos(q * h * i), 0.03);
}

TEST(GaussianFilter, AVeryWideOneStaysFinite) {
  // 60 voxels of sigma: one kernel of that width is beyond ITK's Bessel functions.
  const ImageGeometry geometry({601, 1, 1}, {0.1, 1.0, 1.0}, Eigen::Vector3d::Zero());
  std::vector<float> voxels(601, 0.0F);
  voxels[300] = 1.0e6F;
  const Volume filtered = apply_filters({geometry, voxels}, {{"gaussian", {{"sigma_mm", 6.0}}}});
  double sum = 0.0;
  double second = 0.0;
  for (int i = 0; i < 601; ++i) {
    ASSERT_TRUE(std::isfinite(filtered.at(i, 0, 0)));
    sum += filtered.at(i, 0, 0);
    second += filtered.at(i, 0, 0) * 0.01 * (i - 300) * (i - 300);
  }
  EXPECT_NEAR(sum, 1.0e6, 1.0);
  // The same share is left off as above, in each of the passes.
  EXPECT_NEAR(second / sum, 36.0, 0.18);
}

TEST(GaussianFilter, RefusesAWidthThatTakesForEverAndNamesOneThatDoesNot) {
  // Microns that a header gave as millimetres: the standard sigma is a thousand voxels.
  const Volume volume(oblique({8, 8, 8}, {0.001, 0.001, 0.001}), scattered(512));
  try {
    apply_filters(volume, {parse_filter("gaussian")}, {});
    FAIL() << "it was done";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::usage);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("at most 0.1"));
  }
}

TEST(GaussianFilter, TakesAPictureOfOneSlice) {
  const Volume volume = scattered_volume({12, 9, 1});
  const Volume filtered = apply_filters(volume, {{"gaussian", {}}});
  expect_same_geometry(volume, filtered);
  EXPECT_GE(filtered.range().min, volume.range().min);
  EXPECT_LE(filtered.range().max, volume.range().max);
  EXPECT_LT(filtered.range().max, volume.range().max - 1.0F) << "nothing was smoothed";
}

TEST(FilterChain, AppliesInOrderAndAnEmptyOneSharesTheVoxels) {
  const Volume volume = scattered_volume({9, 8, 7});
  EXPECT_EQ(apply_filters(volume, {}).data(), volume.data());
  const FilterStep median{"median", {}};
  const FilterStep gaussian{"gaussian", {{"sigma", 0.8}}};
  const Volume both = apply_filters(volume, {median, gaussian});
  const Volume one_by_one = apply_filters(apply_filters(volume, {median}), {gaussian});
  const Volume other_order = apply_filters(volume, {gaussian, median});
  EXPECT_TRUE(std::equal(both.data(), both.data() + both.size(), one_by_one.data()));
  EXPECT_FALSE(std::equal(both.data(), both.data() + both.size(), other_order.data()));
}

TEST(FilterChain, ReportsProgressThatOnlyGrows) {
  std::vector<double> fractions;
  const Progress progress([&](double fraction, const std::string&) { fractions.push_back(fraction); },
                          CancelToken());
  apply_filters(scattered_volume({40, 40, 40}), {{"median", {}}, {"gaussian", {}}}, progress);
  ASSERT_GT(fractions.size(), 10U);
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_DOUBLE_EQ(fractions.front(), 0.0);
  EXPECT_DOUBLE_EQ(fractions.back(), 1.0);
}

void expect_cancel_stops(const FilterStep& step) {
  const Volume volume = scattered_volume({60, 60, 60});
  const CancelToken cancel;
  double last = 0.0;
  const Progress progress(
      [&](double fraction, const std::string&) {
        last = fraction;
        if (fraction > 0.05) cancel.cancel();
      },
      cancel);
  try {
    apply_filters(volume, {step}, progress);
    FAIL() << "ran to its end";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::cancelled);
  }
  EXPECT_LT(last, 0.5) << "stopped too late";
}

TEST(FilterChain, StopsInTheMiddleWhenCancelled) {
  expect_cancel_stops({"median", {{"radius_voxels", 2.0}}});
  expect_cancel_stops({"gaussian", {{"sigma_mm", 3.0}}});
}

TEST(FilterChain, WhatTheReportThrowsComesThrough) {
  const Progress progress(
      [](double fraction, const std::string&) {
        if (fraction > 0.02) throw std::runtime_error("the window is gone");
      },
      CancelToken());
  EXPECT_THROW(apply_filters(scattered_volume({40, 40, 40}), {{"median", {}}}, progress), std::runtime_error);
}

std::string usage_text_of(const std::string& filter) {
  try {
    parse_filter(filter);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::usage) << filter;
    return error.what();
  }
  ADD_FAILURE() << filter << " was accepted";
  return {};
}

TEST(ParseFilter, ReadsNamesShortNamesAndDefaults) {
  EXPECT_EQ(parse_filter("median"), (FilterStep{"median", {}}));
  EXPECT_EQ(parse_filter("median:radius_voxels=2"), (FilterStep{"median", {{"radius_voxels", 2.0}}}));
  EXPECT_EQ(parse_filter("median:radius=3"), (FilterStep{"median", {{"radius_voxels", 3.0}}}));
  EXPECT_EQ(parse_filter("gaussian:sigma=0.75"), (FilterStep{"gaussian", {{"sigma_mm", 0.75}}}));
}

TEST(ParseFilter, WrittenOutItReadsBack) {
  for (const auto* text : {"median", "median:radius_voxels=2", "gaussian:sigma_mm=0.1"}) {
    EXPECT_EQ(to_string(parse_filter(text)), text);
    EXPECT_EQ(parse_filter(to_string(parse_filter(text))), parse_filter(text));
  }
}

TEST(ParseFilter, RefusesWhatItDoesNotKnowAndSaysWhatItTakes) {
  using ::testing::HasSubstr;
  EXPECT_THAT(usage_text_of("blur"), HasSubstr("median, mean, gaussian"));
  EXPECT_THAT(usage_text_of(""), HasSubstr("median, mean, gaussian"));
  EXPECT_THAT(usage_text_of("Median"), HasSubstr("median, mean, gaussian"));
  EXPECT_THAT(usage_text_of("median:sigma=1"),
              HasSubstr("radius_voxels (a whole number from 1 to 8 voxels)"));
  EXPECT_THAT(usage_text_of("gaussian:sigma_voxels=1"), HasSubstr("sigma_mm"));
  EXPECT_THAT(usage_text_of("median:"), HasSubstr("key=value"));
  EXPECT_THAT(usage_text_of("median:radius"), HasSubstr("key=value"));
  EXPECT_THAT(usage_text_of("median:radius=1,"), HasSubstr("key=value"));
  EXPECT_THAT(usage_text_of("median:radius=1,radius_voxels=1"), HasSubstr("twice"));
  for (const auto* value : {"0", "9", "-1", "1.5", "", "nan", "inf", "1x", "1e400", " 1", "+1"})
    EXPECT_THAT(usage_text_of(std::string("median:radius=") + value), HasSubstr("from 1 to 8")) << value;
  for (const auto* value : {"0", "-2", "21", "nan", "two"})
    EXPECT_THAT(usage_text_of(std::string("gaussian:sigma=") + value), HasSubstr("from 0.01 to 20")) << value;
}

TEST(FilterChain, ChecksEveryStepBeforeItStarts) {
  const Volume volume = scattered_volume({5, 5, 5});
  int reports = 0;
  const Progress progress([&](double, const std::string&) { ++reports; }, CancelToken());
  for (const FilterStep& wrong : {FilterStep{"blur", {}}, FilterStep{"median", {{"sigma", 1.0}}},
                                  FilterStep{"median", {{"radius_voxels", 0.0}}},
                                  FilterStep{"gaussian", {{"sigma_mm", std::nan("")}}}}) {
    try {
      apply_filters(volume, {{"median", {}}, wrong}, progress);
      ADD_FAILURE() << to_string(wrong) << " was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::usage);
    }
  }
  EXPECT_EQ(reports, 0);
}

TEST(Filters, DescribeThemselvesWithinTheirOwnLimits) {
  ASSERT_GE(filters().size(), 8U);
  for (const auto& filter : filters()) {
    EXPECT_FALSE(filter.title.empty());
    EXPECT_FALSE(filter.text.empty());
    for (const auto& parameter : filter.parameters) {
      EXPECT_LE(parameter.min, parameter.standard);
      EXPECT_LE(parameter.standard, parameter.max);
      const FilterStep step{filter.name, {{parameter.name, parameter.standard}}};
      EXPECT_EQ(parse_filter(to_string(step)), step);
    }
  }
}

}  // namespace
