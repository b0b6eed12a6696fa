#include "filter_volumes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/filters.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <itkCurvatureAnisotropicDiffusionImageFilter.h>
#include <itkCurvatureFlowImageFilter.h>
#include <itkGradientAnisotropicDiffusionImageFilter.h>
#include <itkImage.h>

#include <algorithm>
#include <cmath>
#include <string>

// Each filter against its definition written out, against ITK, or against what
// its equation says of a case that can be solved by hand.

namespace {

using filter_test::filtered;
using filter_test::made_of;
using filter_test::noise;
using filter_test::Scatter;
using palpate::core::Volume;
using palpate::imaging::apply_filters;
using palpate::imaging::FilterStep;

float clamped(const Volume& volume, int i, int j, int k) {
  const auto& dims = volume.dims();
  return volume.at(std::clamp(i, 0, dims[0] - 1), std::clamp(j, 0, dims[1] - 1),
                   std::clamp(k, 0, dims[2] - 1));
}

template <typename Visit>
void each_of_block(const Volume& volume, std::size_t n, int radius, Visit visit) {
  const auto place = volume.geometry().ijk_of(n);
  std::array<int, 3> reach{};
  for (std::size_t axis = 0; axis < 3; ++axis) reach[axis] = volume.dims()[axis] == 1 ? 0 : radius;
  for (int dk = -reach[2]; dk <= reach[2]; ++dk)
    for (int dj = -reach[1]; dj <= reach[1]; ++dj)
      for (int di = -reach[0]; di <= reach[0]; ++di)
        visit(std::array<int, 3>{di, dj, dk}, clamped(volume, place[0] + di, place[1] + dj, place[2] + dk));
}

TEST(MeanFilter, EqualsTheAverageOfEveryBlock) {
  for (const auto& dims : {std::array<int, 3>{11, 9, 7}, {12, 9, 1}, {9, 1, 1}, {3, 2, 2}})
    for (const int radius : {1, 2, 5}) {
      const Volume volume = noise(dims);
      const Volume result = filtered(volume, {{"mean", {{"radius_voxels", radius}}}});
      for (std::size_t n = 0; n < volume.size(); ++n) {
        double sum = 0.0;
        int count = 0;
        each_of_block(volume, n, radius, [&](const auto&, float value) {
          sum += value;
          ++count;
        });
        // Both sum in double: what is left is the rounding of the result to float.
        ASSERT_FLOAT_EQ(result.data()[n], static_cast<float>(sum / count)) << n;
      }
    }
}

TEST(BilateralFilter, EqualsItsDefinition) {
  for (const auto& dims : {std::array<int, 3>{11, 9, 7}, {12, 9, 1}}) {
    const Volume volume = noise(dims);
    const int radius = 3;
    const double range = 0.2 * (static_cast<double>(volume.range().max) - volume.range().min);
    const double sigma_mm = 0.5 * radius * 0.4;
    const Volume result =
        filtered(volume, {{"bilateral", {{"radius_voxels", radius}, {"range_percent", 20.0}}}});
    for (std::size_t n = 0; n < volume.size(); ++n) {
      double sum = 0.0;
      double weights = 0.0;
      each_of_block(volume, n, radius, [&](const std::array<int, 3>& offset, float value) {
        const Eigen::Vector3d away =
            Eigen::Vector3d(offset[0], offset[1], offset[2]).cwiseProduct(volume.geometry().spacing_mm());
        const double difference = static_cast<double>(value) - volume.data()[n];
        const double weight = std::exp(-0.5 * away.squaredNorm() / (sigma_mm * sigma_mm)) *
                              std::exp(-0.5 * difference * difference / (range * range));
        sum += weight * value;
        weights += weight;
      });
      // Weights are floats there: 1e-6 of values up to 250.
      ASSERT_NEAR(result.data()[n], sum / weights, 5e-4) << n;
    }
  }
}

/// The noise of what is brighter than on average, as patch-denoise measures it.
double noise_by_residuals(const Volume& volume) {
  std::vector<double> found;
  for (std::size_t n = 0; n < volume.size(); ++n) {
    const auto place = volume.geometry().ijk_of(n);
    double sum = 0.0;
    int count = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (volume.dims()[axis] == 1) continue;
      for (const int step : {-1, 1}) {
        auto next = place;
        next[axis] += step;
        if (next[axis] < 0 || next[axis] >= volume.dims()[axis]) next[axis] = place[axis] - step;
        sum += volume.at(next[0], next[1], next[2]);
        ++count;
      }
    }
    if (sum / count >= volume.range().mean)
      found.push_back(std::abs(volume.data()[n] - sum / count) / std::sqrt(1.0 + 1.0 / count));
  }
  std::sort(found.begin(), found.end());
  return found[found.size() / 2] / 0.6745;
}

TEST(PatchDenoise, EqualsItsDefinition) {
  for (const auto& dims : {std::array<int, 3>{9, 8, 7}, {14, 11, 1}}) {
    const Volume volume = noise(dims);
    const int search = 2;
    const int patch = 1;
    const double strength = 1.5;
    const double variance = std::pow(noise_by_residuals(volume), 2);
    const Volume result = filtered(
        volume,
        {{"patch-denoise", {{"radius_voxels", search}, {"patch_voxels", patch}, {"strength", strength}}}});
    for (std::size_t n = 0; n < volume.size(); ++n) {
      const auto place = volume.geometry().ijk_of(n);
      double sum = volume.data()[n];
      double weights = 1.0;
      each_of_block(volume, n, search, [&](const std::array<int, 3>& offset, float value) {
        if (offset == std::array<int, 3>{0, 0, 0}) return;
        double squares = 0.0;
        int count = 0;
        each_of_block(volume, n, patch, [&](const std::array<int, 3>& near, float here) {
          const double there = clamped(volume, place[0] + offset[0] + near[0], place[1] + offset[1] + near[1],
                                       place[2] + offset[2] + near[2]);
          squares += (here - there) * (here - there);
          ++count;
        });
        const double beyond = std::max(0.0, squares / count - 2.0 * variance);
        const double left = std::max(0.0, 1.0 - beyond / (4.0 * strength * strength * variance));
        sum += left * left * value;
        weights += left * left;
      });
      // Squares of 250 summed in float: 1e-5 of the weights.
      ASSERT_NEAR(result.data()[n], sum / weights, 5e-3) << n;
    }
  }
}

/// A ball of 140 in a ground of 20.
double ball(int i, int j, int k) { return std::hypot(i - 20.0, j - 20.0, k - 20.0) < 12.0 ? 140.0 : 20.0; }

double rms_error(const Volume& volume) {
  double sum = 0.0;
  for (std::size_t n = 0; n < volume.size(); ++n) {
    const auto [i, j, k] = volume.geometry().ijk_of(n);
    sum += std::pow(volume.data()[n] - ball(i, j, k), 2);
  }
  return std::sqrt(sum / static_cast<double>(volume.size()));
}

TEST(PatchDenoise, IsNotMisledByShadowsThatOutnumberTheTissue) {
  Scatter scatter;
  // A seventh is tissue; the rest is all but black, and not quite flat.
  const auto tissue = [](int i) { return i >= 36; };
  const Volume noisy = made_of({42, 30, 30}, Eigen::Vector3d::Ones(), [&](int i, int, int) {
    return tissue(i) ? 140.0 + 12.0 * scatter.normal() : 3.0 * scatter.next();
  });
  const Volume result = filtered(noisy, {{"patch-denoise", {}}});
  double squares = 0.0;
  double count = 0.0;
  for (std::size_t n = 0; n < result.size(); ++n) {
    if (!tissue(noisy.geometry().ijk_of(n)[0])) continue;
    squares += std::pow(result.data()[n] - 140.0, 2);
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 4.0);  // of 12; as below
}

TEST(PatchDenoise, RemovesMostOfTheNoiseAndKeepsTheEdge) {
  Scatter scatter;
  const Volume noisy = made_of({40, 40, 40}, Eigen::Vector3d::Ones(),
                               [&](int i, int j, int k) { return ball(i, j, k) + 12.0 * scatter.normal(); });
  const double before = rms_error(noisy);
  const double after = rms_error(filtered(noisy, {{"patch-denoise", {}}}));
  const double blurred = rms_error(filtered(noisy, {{"mean", {}}}));
  RecordProperty("before", std::to_string(before));
  RecordProperty("after", std::to_string(after));
  EXPECT_NEAR(before, 12.0, 0.2);
  // 343 voxels are averaged: a noise of 12 / sqrt(343) = 0.6 were the best; a
  // third of 12 allows for weights and for voxels at the edge that find few alike.
  EXPECT_LT(after, 4.0);
  EXPECT_LT(after, blurred) << "the edge was lost";
}

const std::vector<FilterStep>& diffusions() {
  static const std::vector<FilterStep> all{
      {"gradient-diffusion", {}}, {"curvature-diffusion", {}}, {"curvature-flow", {}}};
  return all;
}

TEST(GradientDiffusion, KeepsTheMean) {
  const Volume volume = noise({23, 17, 12});
  const Volume result = filtered(volume, {{"gradient-diffusion", {{"iterations", 20.0}}}});
  double before = 0.0;
  double after = 0.0;
  for (std::size_t n = 0; n < volume.size(); ++n) {
    before += volume.data()[n];
    after += result.data()[n];
  }
  const double spread = static_cast<double>(result.range().max) - result.range().min;
  EXPECT_LT(spread, 0.9 * (static_cast<double>(volume.range().max) - volume.range().min))
      << "nothing happened";
  // What leaves one voxel enters the next: only the rounding to float in each of
  // 20 steps is left, 8e-6 of a value of 125 a step, and most of that cancels.
  EXPECT_NEAR(after / before, 1.0, 1e-6);
}

TEST(Diffusions, LeaveAConstantAndARampAlone) {
  const Volume constant = made_of({9, 8, 7}, {0.5, 0.7, 0.9}, [](int, int, int) { return 42.0; });
  const auto ramp_value = [](int i, int j, int k) { return 3.0 * i - 2.0 * j + 1.5 * k + 40.0; };
  const Volume ramp = made_of({21, 20, 19}, {0.5, 0.7, 0.9}, ramp_value);
  for (const FilterStep& step : diffusions()) {
    const Volume still = filtered(constant, {step});
    EXPECT_TRUE(std::all_of(still.data(), still.data() + still.size(), [](float v) { return v == 42.0F; }))
        << step.name;
    const Volume result = filtered(ramp, {step});
    // Five steps reach five voxels in from the border, where the ramp ends.
    for (int k = 6; k < 13; ++k)
      for (int j = 6; j < 14; ++j)
        for (int i = 6; i < 15; ++i)
          ASSERT_NEAR(result.at(i, j, k), ramp_value(i, j, k), 1e-4) << step.name;  // float rounding
  }
}

using Image = itk::Image<float, 3>;

Image::Pointer to_itk(const Volume& volume) {
  const auto image = Image::New();
  Image::SizeType size;
  Image::SpacingType spacing;
  for (unsigned axis = 0; axis < 3; ++axis) {
    size[axis] = static_cast<itk::SizeValueType>(volume.dims()[axis]);
    spacing[axis] = volume.geometry().spacing_mm()[axis];
  }
  image->SetRegions(Image::RegionType(size));
  image->SetSpacing(spacing);
  image->Allocate();
  std::copy_n(volume.data(), volume.size(), image->GetBufferPointer());
  return image;
}

void expect_equals_itk(const Volume& ours, Image* theirs, const std::string& name) {
  for (std::size_t n = 0; n < ours.size(); ++n)
    // ITK rounds each update and each sum of five steps to float: 1.5e-5 of 200 each.
    ASSERT_NEAR(ours.data()[n], theirs->GetBufferPointer()[n], 1e-3) << name << ' ' << n;
}

/// Smooth enough that no step would leave the neighbours' values.
Volume waves() {
  return made_of({24, 22, 20}, {0.8, 1.1, 0.9}, [](int i, int j, int k) {
    return 100.0 + 40.0 * std::cos(0.5 * i) * std::sin(0.4 * j + 0.3) + 30.0 * std::sin(0.35 * k + 0.1 * i);
  });
}

TEST(GradientDiffusion, EqualsItk) {
  for (const Volume& volume : {waves(), noise({24, 22, 20}, {0.8, 1.1, 0.9})}) {
    const auto filter = itk::GradientAnisotropicDiffusionImageFilter<Image, Image>::New();
    filter->SetInput(to_itk(volume));
    filter->SetUseImageSpacing(true);
    filter->SetTimeStep(0.8 / 16.0);
    filter->SetNumberOfIterations(5);
    filter->SetConductanceParameter(1.2);
    filter->SetConductanceScalingUpdateInterval(100);  // measured once, as here
    filter->Update();
    const Volume ours =
        filtered(volume, {{"gradient-diffusion", {{"iterations", 5.0}, {"conductance", 1.2}}}});
    expect_equals_itk(ours, filter->GetOutput(), "gradient");
  }
}

TEST(CurvatureDiffusion, EqualsItkWhereThatKeepsBetweenTheNeighbours) {
  const Volume volume = waves();
  const auto filter = itk::CurvatureAnisotropicDiffusionImageFilter<Image, Image>::New();
  filter->SetInput(to_itk(volume));
  filter->SetUseImageSpacing(true);
  filter->SetTimeStep(0.8 / 16.0);
  filter->SetNumberOfIterations(5);
  filter->SetConductanceParameter(1.2);
  filter->SetConductanceScalingUpdateInterval(100);
  filter->Update();
  const Volume ours =
      filtered(volume, {{"curvature-diffusion", {{"iterations", 5.0}, {"conductance", 1.2}}}});
  expect_equals_itk(ours, filter->GetOutput(), "curvature");
}

TEST(CurvatureFlow, EqualsItk) {
  const Volume volume = waves();
  const auto filter = itk::CurvatureFlowImageFilter<Image, Image>::New();
  filter->SetInput(to_itk(volume));
  filter->SetUseImageSpacing(true);
  filter->SetTimeStep(0.8 * 0.8 / 16.0);
  filter->SetNumberOfIterations(5);
  filter->Update();
  expect_equals_itk(filtered(volume, {{"curvature-flow", {{"iterations", 5.0}}}}), filter->GetOutput(),
                    "flow");
}

/// Where the values along i fall below `level`, outward from `begin`, in mm.
double crossing_mm(const Volume& volume, int begin, int j, int k, double level) {
  for (int i = begin;; ++i) {
    const double here = volume.at(i, j, k);
    const double next = volume.at(i + 1, j, k);
    if (next < level) return (i - begin + (here - level) / (here - next)) * volume.geometry().spacing_mm()[0];
  }
}

TEST(CurvatureFlow, ShrinksABallByTwoOverItsRadius) {
  // dr/dt = -2/r gives r^2 = r0^2 - 4 t; a circle has -1/r and r^2 = r0^2 - 2 t.
  const double spacing = 0.5;
  const int steps = 60;
  const double time_mm2 = steps * spacing * spacing / 16.0;
  for (const int deep : {49, 1}) {
    const double middle = deep / 2;
    const Volume cone = made_of({49, 49, deep}, {spacing, spacing, spacing}, [&](int i, int j, int k) {
      return 200.0 - 10.0 * spacing * std::hypot(i - 24.0, j - 24.0, k - middle);
    });
    const Volume result = filtered(cone, {{"curvature-flow", {{"iterations", steps}}}});
    const double curvature = deep == 1 ? 1.0 : 2.0;
    for (const double radius_mm : {5.0, 8.0}) {
      const double expected = std::sqrt(radius_mm * radius_mm - 2.0 * curvature * time_mm2);
      const double found = crossing_mm(result, 24, 24, deep / 2, 200.0 - 10.0 * radius_mm);
      // Central differences err by (h/r)^2/12 of the speed, so 0.1 % of the way
      // of some 0.4 mm; the straight line between voxels adds h^2/(8 r) = 6 um.
      EXPECT_NEAR(found, expected, 0.01) << deep << ' ' << radius_mm;
      EXPECT_LT(found, radius_mm - 0.1);
    }
  }
}

TEST(Diffusions, AStepThatIsNotStableIsShortenedAndSaid) {
  using ::testing::HasSubstr;
  const Volume volume = noise({12, 11, 10}, {0.5, 0.8, 2.0});
  for (const FilterStep& step : diffusions()) {
    const bool flow = step.name == "curvature-flow";
    const double largest = flow ? 0.25 / 16.0 : 0.5 / 16.0;
    FilterStep long_step = step;
    long_step.parameters["time_step"] = 0.7;
    const auto result = apply_filters(volume, {long_step, long_step});
    ASSERT_EQ(result.warnings.size(), 1U) << step.name << ": said once";
    EXPECT_EQ(result.warnings.front().code, "time-step-clamped");
    EXPECT_THAT(result.warnings.front().text, HasSubstr("0.7"));
    EXPECT_THAT(result.warnings.front().text, HasSubstr(flow ? "0.015625" : "0.03125"));
    FilterStep largest_step = step;
    largest_step.parameters["time_step"] = largest;
    const auto stable = apply_filters(volume, {largest_step, step});
    EXPECT_TRUE(stable.warnings.empty()) << step.name;
    EXPECT_TRUE(std::equal(stable.volume.data(), stable.volume.data() + volume.size(), result.volume.data()))
        << step.name;
  }
}

TEST(Diffusions, AShorterStepDoesLess) {
  const Volume volume = noise({12, 11, 10});
  for (FilterStep step : diffusions()) {
    const auto change = [&] {
      const Volume result = filtered(volume, {step});
      double sum = 0.0;
      for (std::size_t n = 0; n < volume.size(); ++n) sum += std::abs(result.data()[n] - volume.data()[n]);
      return sum / static_cast<double>(volume.size());
    };
    const double most = change();
    step.parameters["time_step"] = 0.001;
    EXPECT_LT(change(), 0.5 * most) << step.name;
    EXPECT_GT(change(), 0.0) << step.name;
  }
}

}  // namespace
