#include "palpate/imaging/adaptive.hpp"

#include "phantom_contrast.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/filters.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

// The CPU twin; testing/kernels/adaptive_test.cpp shows that the kernels agree with it.
namespace palpate::imaging {
namespace {

using Dims = std::array<int, 3>;
constexpr double pi = 3.14159265358979323846;

core::Volume made(const Dims& dims, const Eigen::Vector3d& spacing_mm,
                  const std::function<double(const Eigen::Vector3d& place_mm)>& grey) {
  const core::ImageGeometry geometry(dims, spacing_mm, Eigen::Vector3d::Zero());
  std::vector<float> voxels;
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j)
      for (int i = 0; i < dims[0]; ++i)
        voxels.push_back(static_cast<float>(grey(Eigen::Vector3d(i, j, k).cwiseProduct(spacing_mm))));
  return {geometry, std::move(voxels)};
}

core::Volume noise(const Dims& dims, double mean, double deviation, unsigned seed) {
  std::mt19937 engine(seed);
  return made(dims, Eigen::Vector3d::Ones(), [&](const Eigen::Vector3d&) {
    // Twelve uniform numbers make a nearly normal one, the same everywhere.
    double sum = -6.0;
    for (int n = 0; n < 12; ++n) sum += static_cast<double>(engine()) / 4294967296.0;
    return mean + deviation * sum;
  });
}

core::IntensityRange range(float min, float max) {
  core::IntensityRange result;
  result.min = min;
  result.max = max;
  return result;
}

core::Volume filtered(const core::Volume& volume, const AdaptiveParameters& parameters = {}) {
  return adaptive_filter(volume, parameters, volume.range(), "reference");
}
core::Volume filtered_openly(const core::Volume& volume, const AdaptiveParameters& parameters = {}) {
  return adaptive_filter(volume, parameters, range(-1000.0F, 1000.0F), "reference");
}

/// Amplitude of the wave in the middle of the volume, by projection on its sine and cosine.
double amplitude(const core::Volume& volume, const Eigen::Vector3d& radians_per_mm, int border) {
  const auto& d = volume.dims();
  // Least squares for mean, cosine and sine: the box holds no whole number of waves.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (int k = border; k < d[2] - border; ++k)
    for (int j = border; j < d[1] - border; ++j)
      for (int i = border; i < d[0] - border; ++i) {
        const double phase =
            radians_per_mm.dot(Eigen::Vector3d(i, j, k).cwiseProduct(volume.geometry().spacing_mm()));
        const Eigen::Vector3d row(1.0, std::cos(phase), std::sin(phase));
        normal += row * row.transpose();
        right += row * static_cast<double>(volume.at(i, j, k));
      }
  return (normal.inverse() * right).tail<2>().norm();
}

TEST(AdaptiveFilter, ConstantStaysConstant) {
  const core::Volume volume = made({19, 14, 11}, {1.0, 1.0, 1.5}, [](const auto&) { return 137.25; });
  const core::Volume result = filtered_openly(volume);
  // Weights of double that sum to zero: their rounding, 1e-16 of some tens, is below that of the float
  // result.
  for (std::size_t n = 0; n < result.size(); ++n) ASSERT_FLOAT_EQ(result.data()[n], 137.25F);
}

// What a wave of amplitude a on a mean m keeps follows from the definition:
// T = a R(rho) u uT, so y = a R / (contrast A m) with the response A of a unit step,
// and of the wave there remain lowpass + y^2/(y^2 + 1) highpass.
TEST(AdaptiveFilter, PlaneWaveKeepsWhatTheDefinitionSays) {
  AdaptiveParameters parameters;
  parameters.passes = 1;
  const double scale_mm = parameters.scale_voxels;
  const double rho = 1.2 / scale_mm;  // the quadrature filters' centre: R = 1
  const double unit_step = std::sqrt(std::log(2.0) / pi);
  const double lowpass = std::exp(-0.5 * 1.2 * 1.2);
  const std::vector<Eigen::Vector3d> orientations{{1, 0, 0}, {0, 0, 1}, {1, 2, 3}, {-2, 1, 1}};
  for (const double spacing_k : {1.0, 2.0})
    for (const auto& orientation : orientations)
      for (const double a : {4.0, 25.0, 90.0}) {
        const Eigen::Vector3d wave = rho * orientation.normalized();
        const core::Volume volume =
            made({30, 30, spacing_k > 1.0 ? 26 : 30}, {1.0, 1.0, spacing_k},
                 [&](const auto& place) { return 100.0 + a * std::cos(wave.dot(place)); });
        const double y = a / (parameters.contrast_percent / 100.0 * unit_step * 102.0);
        const double expected = lowpass + y * y / (y * y + 1.0) * (1.0 - lowpass);
        const double kept = amplitude(filtered(volume, parameters), wave, 9) / a;
        // 102: the mean with 2 % of the range for the dark. The kernels miss up to
        // 20 % of |q| at one place (less smoothed) and 8 % of the highpass.
        EXPECT_NEAR(kept, expected, 0.06)
            << orientation.transpose() << " amplitude " << a << " spacing " << spacing_k;
      }
}

TEST(AdaptiveFilter, FitOfTheKernelsIsAsStated) {
  for (const Eigen::Vector3d& spacing : {Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(0.5, 0.5, 1.5)})
    for (const double scale : {1.5, 2.0, 3.0, 5.0}) {
      AdaptiveParameters parameters;
      parameters.scale_voxels = scale;
      const auto fit =
          adaptive_fit(core::ImageGeometry({9, 9, 9}, spacing, Eigen::Vector3d::Zero()), parameters);
      std::printf("spacing %.1f %.1f %.1f scale %.1f: even %.3f odd %.3f highpass %.3f\n", spacing[0],
                  spacing[1], spacing[2], scale, fit.quadrature_even, fit.quadrature_odd, fit.highpass);
      // A quarter of the root energy where a filter is cut off by the grid, a tenth for what carries the
      // picture.
      EXPECT_LT(fit.quadrature_even, 0.25);
      EXPECT_LT(fit.quadrature_odd, 0.25);
      EXPECT_LT(fit.highpass, 0.20);
    }
}

TEST(AdaptiveFilter, SmoothsAlongAnEdgeAndKeepsIt) {
  const Eigen::Vector3d normal = Eigen::Vector3d(2.0, 1.0, 0.5).normalized();
  const auto side = [&](const Eigen::Vector3d& place) {
    return normal.dot(place - Eigen::Vector3d(20, 20, 20));
  };
  const core::Volume grain = noise({41, 41, 41}, 0.0, 12.0, 3);
  std::size_t n = 0;
  const core::Volume volume = made({41, 41, 41}, Eigen::Vector3d::Ones(), [&](const auto& place) {
    return (side(place) > 0.0 ? 150.0 : 40.0) + static_cast<double>(grain.data()[n++]);
  });
  const core::Volume result = filtered(volume);
  // By distance from the edge, in half voxels, well inside: mean and deviation.
  const auto bins = [&](const core::Volume& of) {
    std::vector<std::array<double, 3>> sums(41, {0.0, 0.0, 0.0});
    for (int k = 8; k < 33; ++k)
      for (int j = 8; j < 33; ++j)
        for (int i = 8; i < 33; ++i) {
          const auto bin = std::lround(2.0 * side(Eigen::Vector3d(i, j, k))) + 20;
          if (bin < 0 || bin > 40) continue;
          const double grey = static_cast<double>(of.at(i, j, k));
          auto& sum = sums[static_cast<std::size_t>(bin)];
          sum[0] += 1.0;
          sum[1] += grey;
          sum[2] += grey * grey;
        }
    std::vector<std::array<double, 2>> statistics;
    for (const auto& [count, sum, squares] : sums) {
      const double mean = sum / count;
      statistics.push_back({mean, std::sqrt(std::max(0.0, squares / count - mean * mean))});
    }
    return statistics;
  };
  const auto before = bins(volume);
  const auto after = bins(result);
  // The step is 116 % of the brightness around it: y is some 2 once T is smoothed,
  // a fifth of the highpass goes, and of the step 1.5 voxels aside less than that.
  EXPECT_GT(after[23][0] - after[17][0], 0.8 * (before[23][0] - before[17][0]));
  // Where the filter keeps only what varies along the normal, 1/5 of the energy of
  // white noise passes, and 1/9 after two passes: a third of the deviation. A half is asked for.
  for (const std::size_t bin : {15U, 16U, 24U, 25U}) EXPECT_LT(after[bin][1], 0.5 * before[bin][1]) << bin;
  // Far from it, all directions are smoothed.
  for (const std::size_t bin : {2U, 38U}) EXPECT_LT(after[bin][1], 0.25 * before[bin][1]) << bin;
}

core::Volume turned(const core::Volume& volume, const std::function<Dims(const Dims&)>& from,
                    const Dims& dims) {
  return made(dims, Eigen::Vector3d::Ones(), [&](const Eigen::Vector3d& place) {
    const Dims at =
        from({static_cast<int>(place.x()), static_cast<int>(place.y()), static_cast<int>(place.z())});
    return static_cast<double>(volume.at(at[0], at[1], at[2]));
  });
}

double largest_difference(const core::Volume& a, const core::Volume& b) {
  double largest = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n)
    largest =
        std::max(largest, std::abs(static_cast<double>(a.data()[n]) - static_cast<double>(b.data()[n])));
  return largest;
}

double root_mean_square_difference(const core::Volume& a, const core::Volume& b) {
  double sum = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n) {
    const double apart = static_cast<double>(a.data()[n]) - static_cast<double>(b.data()[n]);
    sum += apart * apart;
  }
  return std::sqrt(sum / static_cast<double>(a.size()));
}

TEST(AdaptiveFilter, CommutesWithTurns) {
  const Dims dims{26, 26, 26};
  const core::Volume grain = noise(dims, 0.0, 20.0, 8);
  std::size_t n = 0;
  const core::Volume volume = made(dims, Eigen::Vector3d::Ones(), [&](const Eigen::Vector3d& place) {
    const double inside = (place - Eigen::Vector3d(11, 13, 12)).norm() - 8.0;
    return (inside < 0.0 ? 180.0 : 60.0) + static_cast<double>(grain.data()[n++]);
  });
  const core::Volume result = filtered(volume);
  // The six directions map onto themselves when the axes are exchanged in a
  // ring or one is mirrored; then only the order of summing differs.
  const auto ring = [](const Dims& at) { return Dims{at[1], at[2], at[0]}; };
  const auto mirrored = [](const Dims& at) { return Dims{25 - at[0], at[1], at[2]}; };
  for (const std::function<Dims(const Dims&)>& turn : {std::function<Dims(const Dims&)>(ring), {mirrored}})
    EXPECT_LT(largest_difference(filtered(turned(volume, turn, dims)), turned(result, turn, dims)), 1e-3);
  // A quarter turn takes them to the icosahedron's other six. T is then the same
  // for what has one orientation but not for noise: 1 % of the range of 240, root mean square.
  const auto quarter = [](const Dims& at) { return Dims{at[1], 25 - at[0], at[2]}; };
  EXPECT_LT(
      root_mean_square_difference(filtered(turned(volume, quarter, dims)), turned(result, quarter, dims)),
      0.01 * 240.0);
}

TEST(AdaptiveFilter, ScalesWithAmplitudeFromTinyToHuge) {
  const core::Volume volume = noise({17, 12, 10}, 100.0, 25.0, 4);
  const core::Volume result = filtered(volume);
  for (const double factor : {3.0, 1e-30, 1e30}) {
    std::size_t n = 0;
    const core::Volume scaled = made(volume.dims(), Eigen::Vector3d::Ones(), [&](const auto&) {
      return factor * static_cast<double>(volume.data()[n++]);
    });
    const core::Volume scaled_result = filtered(scaled);
    // Rounding of the scaled voxels to float, 6e-8, through a filter whose weights sum to a few.
    for (std::size_t at = 0; at < volume.size(); ++at)
      ASSERT_NEAR(static_cast<double>(scaled_result.data()[at]) / factor,
                  static_cast<double>(result.data()[at]), 1e-3);
  }
}

TEST(AdaptiveFilter, StaysFiniteAndWithinTheScan) {
  std::vector<core::Volume> volumes;
  volumes.push_back(made({12, 9, 7}, {1, 1, 1}, [](const auto&) { return 0.0; }));
  volumes.push_back(
      made({12, 9, 7}, {1, 1, 1}, [](const auto& place) { return place.x() == 5.0 ? 255.0 : 0.0; }));
  volumes.push_back(made({15, 15, 15}, {1, 1, 1}, [](const Eigen::Vector3d& place) {
    return (place - Eigen::Vector3d(7, 7, 7)).norm() < 1.5 ? 255.0 : 0.0;
  }));
  volumes.push_back(
      made({12, 9, 7}, {1, 1, 9}, [](const auto& place) { return -1000.0 + 100.0 * place.y(); }));
  volumes.push_back(noise({14, 14, 1}, -5.0, 30.0, 2));
  volumes.push_back(noise({2, 1, 3}, 50.0, 30.0, 2));
  for (const auto& volume : volumes) {
    const core::Volume result = filtered(volume);
    for (std::size_t n = 0; n < result.size(); ++n) {
      ASSERT_TRUE(std::isfinite(result.data()[n]));
      ASSERT_GE(result.data()[n], volume.range().min);
      ASSERT_LE(result.data()[n], volume.range().max);
    }
    EXPECT_EQ(result.geometry(), volume.geometry());
  }
}

TEST(AdaptiveFilter, SmoothsAPictureAsAPicture) {
  const core::Volume grain = noise({60, 50, 1}, 0.0, 12.0, 5);
  std::size_t n = 0;
  const core::Volume picture = made({60, 50, 1}, Eigen::Vector3d::Ones(), [&](const Eigen::Vector3d& place) {
    return (place.x() > 29.5 ? 150.0 : 40.0) + static_cast<double>(grain.data()[n++]);
  });
  EXPECT_EQ(adaptive_reach(picture.geometry(), {})[2], 0);
  const core::Volume result = filtered(picture);
  const auto deviation = [](const core::Volume& of, int from, int to) {
    double sum = 0.0, squares = 0.0;
    const int count = (to - from) * of.dims()[1];
    for (int j = 0; j < of.dims()[1]; ++j)
      for (int i = from; i < to; ++i) {
        const double grey = static_cast<double>(of.at(i, j, 0));
        sum += grey;
        squares += grey * grey;
      }
    return std::sqrt(squares / count - (sum / count) * (sum / count));
  };
  // Of white noise the lowpass of two voxels alone leaves 1/(2 sqrt(pi) 2) = 14 % in a plane.
  EXPECT_LT(deviation(result, 5, 20), 0.4 * deviation(picture, 5, 20));
  double step = 0.0;
  for (int j = 0; j < 50; ++j) step += static_cast<double>(result.at(31, j, 0) - result.at(28, j, 0)) / 50.0;
  EXPECT_GT(step, 0.85 * 110.0);
}

TEST(AdaptiveFilter, ProgressOnlyGrowsToItsEnd) {
  const core::Volume volume = noise({20, 20, 20}, 100.0, 25.0, 4);
  std::vector<double> fractions;
  const core::Progress progress([&](double fraction, const std::string&) { fractions.push_back(fraction); },
                                {});
  adaptive_filter(volume, {}, volume.range(), "reference", progress);
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_GT(fractions.size(), 20U);
  EXPECT_EQ(fractions.back(), 1.0);
}

TEST(AdaptiveFilter, CancelEndsItAtOnce) {
  const core::Volume volume = noise({30, 30, 30}, 100.0, 25.0, 4);
  const core::CancelToken token;
  int reports_after = 0;
  const core::Progress progress(
      [&](double fraction, const std::string&) {
        if (token.cancelled()) ++reports_after;
        if (fraction > 0.2) token.cancel();
      },
      token);
  try {
    adaptive_filter(volume, {}, volume.range(), "reference", progress);
    FAIL() << "ran to its end";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::cancelled);
  }
  EXPECT_EQ(reports_after, 0);
}

TEST(AdaptiveFilter, RefusesParametersOutsideTheirRanges) {
  const core::Volume volume = noise({8, 8, 8}, 100.0, 25.0, 4);
  AdaptiveParameters parameters;
  parameters.scale_voxels = 50.0;
  try {
    filtered(volume, parameters);
    FAIL() << "taken";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::usage);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("scale_voxels"));
  }
}

TEST(AdaptiveFilter, IsAFilterOfTheChain) {
  const core::Volume volume = noise({20, 18, 30}, 100.0, 25.0, 4);
  const FilterStep step = parse_filter("adaptive:contrast=30,passes=1");
  const FilterOptions options{"reference"};
  const core::Volume whole = apply_filters(volume, {step}, options).volume;
  AdaptiveParameters parameters;
  parameters.contrast_percent = 30.0;
  parameters.passes = 1;
  EXPECT_EQ(largest_difference(whole, filtered(volume, parameters)), 0.0);
  const core::Volume slice = filter_slice(volume, {step}, 2, 3, options);
  for (int j = 0; j < 18; ++j)
    for (int i = 0; i < 20; ++i) ASSERT_EQ(slice.at(i, j, 0), whole.at(i, j, 3));
}

// On a small phantom and as it comes: a narrower border than the smallest
// median leaves, and clearly more contrast. The kernels' test compares edges of one width.
TEST(AdaptiveFilter, TellsWallFromCavityBetterThanAMedian) {
  const testing::PhantomContrast phantom(72, 11);
  const auto median = apply_filters(phantom.speckled(), {{"median", {{"radius_voxels", 1.0}}}}).volume;
  const auto adaptive = filtered(phantom.speckled());
  std::printf("median 1: edge %.3f mm, contrast-to-noise %.3f; adaptive: %.3f mm, %.3f\n",
              phantom.edge_width_mm(median), phantom.contrast_to_noise(median),
              phantom.edge_width_mm(adaptive), phantom.contrast_to_noise(adaptive));
  EXPECT_LT(phantom.edge_width_mm(adaptive), 1.05 * phantom.edge_width_mm(median));
  EXPECT_GT(phantom.contrast_to_noise(adaptive), 1.1 * phantom.contrast_to_noise(median));
}

}  // namespace
}  // namespace palpate::imaging
