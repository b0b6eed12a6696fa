#include "palpate/model/generate.hpp"

#include "build.hpp"
#include "model_shapes.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

using namespace palpate::model;
using palpate::core::CancelToken;
using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::core::Progress;
using palpate::core::Volume;
using palpate::testing::full_box;
using palpate::testing::shape;
using palpate::testing::shell;
using palpate::testing::sponge;

namespace {

TissueParameters with_threshold(double low) {
  TissueParameters parameters;
  parameters.threshold_low = low;
  return parameters;
}

Volume ramp(std::array<int, 3> dims) {
  const palpate::core::ImageGeometry geometry(dims, {0.5, 0.7, 1.1}, {1, 2, 3});
  std::vector<float> voxels(geometry.voxel_count());
  for (std::size_t n = 0; n < voxels.size(); ++n) voxels[n] = static_cast<float>(n);
  return Volume(geometry, std::move(voxels));
}

/// Noise of every point, in point spacings along the image's axes.
std::vector<Eigen::Vector3d> noise_of(const Tissue& tissue, int stride) {
  std::vector<Eigen::Vector3d> noise;
  for (std::size_t n = 0; n < tissue.points.size(); ++n) {
    const auto& voxel = tissue.points.voxels[n];
    noise.push_back(
        (tissue.geometry.to_ijk(tissue.points.lps_mm(n)) - Eigen::Vector3d(voxel[0], voxel[1], voxel[2])) /
        stride);
  }
  return noise;
}

bool same(const Tissue& a, const Tissue& b) {
  return a.points.positions_mm == b.points.positions_mm && a.points.voxels == b.points.voxels &&
         a.points.intensities == b.points.intensities && a.links.pairs == b.links.pairs &&
         a.links.rest_lengths_mm == b.links.rest_lengths_mm;
}

Error error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorKind::internal, "none", "nothing was thrown");
}

}  // namespace

TEST(Points, AreTheVoxelsInTheRangeInVoxelOrder) {
  TissueParameters parameters = with_threshold(17.0);
  parameters.threshold_high = 31.0;
  const Tissue tissue = generate(ramp({4, 3, 5}), parameters);
  ASSERT_EQ(tissue.points.size(), 15U);  // 17..31, both ends in
  for (std::size_t n = 0; n < tissue.points.size(); ++n) {
    EXPECT_EQ(tissue.points.intensities[n], static_cast<float>(17 + n));
    const auto& voxel = tissue.points.voxels[n];
    EXPECT_EQ(tissue.geometry.index(voxel[0], voxel[1], voxel[2]), 17 + n);
  }
}

TEST(Points, StandAtTheirVoxelsUnderFlippedAndObliqueDirections) {
  const Eigen::Matrix3d oblique =
      (Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-0.7, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  const Eigen::Matrix3d flipped = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  for (const Eigen::Matrix3d& direction : {oblique, flipped}) {
    const Volume volume = shape(
        {7, 6, 5}, {0.5, 0.8, 1.3}, [](int i, int, int k) { return i != k; }, direction);
    TissueParameters parameters;
    parameters.noise = 0.0;
    const Tissue tissue = generate(volume, parameters);
    EXPECT_EQ(tissue.points.center_mm, volume.geometry().center_mm());
    for (std::size_t n = 0; n < tissue.points.size(); ++n) {
      const auto& voxel = tissue.points.voxels[n];
      const Eigen::Vector3d expected =
          volume.geometry().to_lps_mm(Eigen::Vector3d(voxel[0], voxel[1], voxel[2]));
      // float32 of coordinates below 8 mm.
      EXPECT_LT((tissue.points.lps_mm(n) - expected).norm(), 1e-6);
    }
  }
}

TEST(Points, AreCroppedAndStridedFromTheCropsFirstVoxel) {
  TissueParameters parameters = with_threshold(-1.0);
  parameters.crop = CropBox{{1, 0, 2}, {6, 99, 7}};  // the end beyond the volume is clipped
  parameters.stride = 2;
  parameters.noise = 0.0;
  const Tissue tissue = generate(ramp({8, 5, 9}), parameters);
  EXPECT_EQ(tissue.points.size(), 3U * 3U * 3U);
  for (const auto& voxel : tissue.points.voxels) {
    EXPECT_TRUE(voxel[0] == 1 || voxel[0] == 3 || voxel[0] == 5);
    EXPECT_EQ(voxel[1] % 2, 0);
    EXPECT_EQ(voxel[2] % 2, 0);
    EXPECT_TRUE(voxel[2] >= 2 && voxel[2] <= 6);
  }
  EXPECT_TRUE(tissue.spacing_mm.isApprox(Eigen::Vector3d(1.0, 1.4, 2.2)));
}

TEST(Points, LeaveOutWhatIsNotFinite) {
  const float infinite = std::numeric_limits<float>::infinity();
  const palpate::core::ImageGeometry geometry({4, 1, 1}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  const Volume volume(geometry, std::vector<float>{1, infinite, std::nanf(""), 2});
  EXPECT_EQ(generate(volume, with_threshold(0.0)).points.size(), 2U);
}

TEST(Points, AConstantVolumeIsAllTissueByDefault) { EXPECT_EQ(generate(full_box(4), {}).points.size(), 64U); }

TEST(Noise, IsUniformWithinItsBoundsOnEachAxis) {
  for (const int stride : {1, 2}) {
    TissueParameters parameters;
    parameters.noise = 0.3;
    parameters.stride = stride;
    const Tissue tissue = generate(full_box(40 * stride, {0.4, 0.6, 1.5}), parameters);
    const auto noise = noise_of(tissue, stride);
    ASSERT_EQ(noise.size(), 64000U);
    Eigen::Array3d sum = Eigen::Array3d::Zero();
    Eigen::Array3d squares = Eigen::Array3d::Zero();
    double cross = 0.0;
    double most = 0.0;
    for (const Eigen::Vector3d& value : noise) {
      sum += value.array();
      squares += value.array().square();
      cross += value.x() * value.y();
      most = std::max(most, value.cwiseAbs().maxCoeff());
    }
    const double count = 64000.0;
    // float32 of coordinates up to 60 mm, in units of 0.4 mm: 1e-5.
    EXPECT_LE(most, 0.3 + 1e-5);
    EXPECT_GT(most, 0.2999);
    const double deviation = 0.3 / std::sqrt(3.0);
    // Five standard errors: of a mean, and of a mean square (variance 4 A^4 / 45).
    const double mean_margin = 5.0 * deviation / std::sqrt(count);
    const double square_margin = 5.0 * 0.09 * std::sqrt(4.0 / 45.0) / std::sqrt(count);
    EXPECT_LT((sum / count).abs().maxCoeff(), mean_margin);
    EXPECT_LT((squares / count - 0.03).abs().maxCoeff(), square_margin);
    EXPECT_LT(std::abs(cross / count), 5.0 * 0.03 / std::sqrt(count));
  }
}

TEST(Noise, DependsOnSeedAndVoxelOnly) {
  const Volume volume = full_box(12);
  TissueParameters parameters = with_threshold(50.0);
  const Tissue whole = generate(volume, parameters);
  parameters.crop = CropBox{{3, 4, 5}, {9, 10, 11}};
  const Tissue part = generate(volume, parameters);
  std::size_t found = 0;
  for (std::size_t p = 0; p < part.points.size(); ++p)
    for (std::size_t w = 0; w < whole.points.size(); ++w)
      if (part.points.voxels[p] == whole.points.voxels[w]) {
        EXPECT_EQ(part.points.positions_mm[p], whole.points.positions_mm[w]);
        ++found;
      }
  EXPECT_EQ(found, 216U);
  parameters.seed = 2;
  const Tissue other = generate(volume, parameters);
  for (std::size_t p = 0; p < part.points.size(); ++p)
    EXPECT_NE(part.points.positions_mm[p], other.points.positions_mm[p]);
}

TEST(Generate, GivesTheSameForAnyNumberOfThreads) {
  const Volume volume = sponge({50, 40, 45}, {0.4, 0.4, 1.0}, 0.3, 5);
  for (const LinkRule rule : {LinkRule::nearest, LinkRule::six, LinkRule::lattice18, LinkRule::lattice26}) {
    TissueParameters parameters;
    parameters.links = rule;
    parameters.min_component = 20;
    const Tissue one = generate_with(volume, parameters, 1, {});
    EXPECT_GT(one.links.size(), 10000U);
    for (const unsigned threads : {2U, 3U, 7U})
      EXPECT_TRUE(same(one, generate_with(volume, parameters, threads, {})));
    EXPECT_TRUE(same(one, generate(volume, parameters)));
  }
}

TEST(Generate, RefusesParametersOutOfRange) {
  const Volume volume = full_box(3);
  const double nan = std::nan("");
  const std::vector<std::pair<const char*, std::function<void(TissueParameters&)>>> wrong{
      {"noise", [](auto& p) { p.noise = 0.51; }},
      {"noise", [](auto& p) { p.noise = -0.1; }},
      {"noise", [&](auto& p) { p.noise = nan; }},
      {"stride", [](auto& p) { p.stride = 0; }},
      {"links", [](auto& p) { p.max_links = 0; }},
      {"links", [](auto& p) { p.max_links = 65; }},
      {"threshold", [&](auto& p) { p.threshold_low = nan; }},
      {"threshold", [&](auto& p) { p.threshold_high = nan; }},
      {"threshold", [](auto& p) { p.threshold_low = 5.0, p.threshold_high = 4.0; }},
      {"crop",
       [](auto& p) {
         p.crop = CropBox{{0, 0, 3}, {3, 3, 5}};
       }},
      {"crop",
       [](auto& p) {
         p.crop = CropBox{{0, 2, 0}, {3, 1, 3}};
       }},
  };
  for (const auto& [word, spoil] : wrong) {
    TissueParameters parameters;
    spoil(parameters);
    for (const Error& error : {error_of([&, &p = parameters] { generate(volume, p); }),
                               error_of([&, &p = parameters] { estimate(volume, p); })}) {
      EXPECT_EQ(error.kind(), ErrorKind::usage) << word;
      EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
    }
  }
  EXPECT_EQ(error_of([] { generate(Volume(), {}); }).kind(), ErrorKind::usage);
}

TEST(Generate, SaysWhereTheVolumesValuesLieWhenThereIsNoTissue) {
  const Error error = error_of([] { generate(ramp({4, 3, 5}), with_threshold(1000.0)); });
  EXPECT_EQ(error.kind(), ErrorKind::input);
  EXPECT_EQ(error.code(), "no-tissue");
  EXPECT_NE(std::string(error.what()).find("from 0 to 59"), std::string::npos) << error.what();
  EXPECT_EQ(error_of([] { estimate(ramp({4, 3, 5}), with_threshold(1000.0)); }).code(), "no-tissue");
}

TEST(Generate, ReportsRisingProgressToItsEnd) {
  double last = 0.0;
  const auto watch = [&](double fraction, const std::string& what) {
    EXPECT_GE(fraction, last - 1e-12);  // the parts of a progress meet but for rounding
    EXPECT_FALSE(what.empty());
    last = fraction;
  };
  TissueParameters parameters;
  parameters.min_component = 2;
  generate(sponge({40, 40, 40}, Eigen::Vector3d::Ones(), 0.2, 3), parameters, Progress(watch, CancelToken()));
  EXPECT_DOUBLE_EQ(last, 1.0);
}

TEST(Generate, StopsAtEveryStage) {
  const Volume volume = sponge({40, 40, 40}, Eigen::Vector3d::Ones(), 0.2, 3);
  TissueParameters parameters;
  parameters.min_component = 2;
  const auto calls = std::vector<std::function<void(const Progress&)>>{
      [&](const Progress& p) { generate(volume, parameters, p); },
      [&](const Progress& p) {
        estimate(shell({60, 60, 60}, Eigen::Vector3d::Ones(), 0.4), parameters, p);
      }};
  for (const auto& call : calls)
    for (const double when : {0.0, 0.05, 0.3, 0.6, 0.9}) {
      const CancelToken token;
      const Progress progress(
          [&](double fraction, const std::string&) {
            if (fraction >= when) token.cancel();
          },
          token);
      EXPECT_EQ(error_of([&] { call(progress); }).kind(), ErrorKind::cancelled) << when;
    }
}
