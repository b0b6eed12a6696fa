#include "build.hpp"
#include "model_shapes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

using namespace palpate::model;
using palpate::core::Volume;
using palpate::testing::full_box;
using palpate::testing::shape;
using palpate::testing::shell;
using palpate::testing::sponge;

namespace {

TissueParameters blue_noise(int stride = 1, std::uint64_t seed = 1) {
  TissueParameters parameters;
  parameters.threshold_low = 50.0;
  parameters.points = PointRule::blue_noise;
  parameters.stride = stride;
  parameters.seed = seed;
  return parameters;
}

/// Distance of each point to its nearest other, in units of `edge_mm`.
std::vector<double> nearest_of(const PointCloud& points, double edge_mm) {
  const auto& links =
      link_nearest(points, Eigen::Vector3d::Constant(edge_mm), 8);  // mutual: the globally nearest are in
  std::vector<double> nearest(points.size(), 1e9);
  for (std::size_t link = 0; link < links.size(); ++link)
    for (const std::uint32_t end : links.pairs[link])
      nearest[end] = std::min(nearest[end], static_cast<double>(links.rest_lengths_mm[link]) / edge_mm);
  return nearest;
}

double least(const std::vector<double>& values) { return *std::min_element(values.begin(), values.end()); }

}  // namespace

TEST(BlueNoise, HasAsManyPointsAsTheLatticeOfTheStride) {
  const Volume volume = shell({40, 44, 36}, {1, 1, 1}, 0.5);
  TissueParameters lattice;
  lattice.threshold_low = 50.0;
  const std::size_t voxels = generate(volume, lattice).points.size();
  ASSERT_GT(voxels, 10000U);
  EXPECT_EQ(generate(volume, blue_noise()).points.size(), voxels);
  EXPECT_EQ(generate(volume, blue_noise(2)).points.size(),
            static_cast<std::size_t>(std::llround(static_cast<double>(voxels) / 8.0)));
  EXPECT_EQ(generate(volume, blue_noise(3)).points.size(),
            static_cast<std::size_t>(std::llround(static_cast<double>(voxels) / 27.0)));
  // Few voxels and a wide stride still give a point.
  EXPECT_EQ(generate(full_box(2), blue_noise(8)).points.size(), 1U);
}

TEST(BlueNoise, LiesInTheTissueAndKnowsItsVoxel) {
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const Volume volume = shape(
      {20, 22, 18}, {0.5, 0.7, 1.4}, [](int i, int j, int k) { return (i / 3 + j / 4 + k / 2) % 2 == 0; },
      turned);
  TissueParameters parameters = blue_noise(2);
  parameters.crop = CropBox{{2, 3, 4}, {19, 20, 17}};
  const Tissue tissue = generate(volume, parameters);
  ASSERT_GT(tissue.points.size(), 200U);
  for (std::size_t p = 0; p < tissue.points.size(); ++p) {
    const auto& voxel = tissue.points.voxels[p];
    EXPECT_EQ(volume.at(voxel[0], voxel[1], voxel[2]), 100.0F);
    EXPECT_EQ(tissue.points.intensities[p], 100.0F);
    const Eigen::Vector3d off =
        tissue.geometry.to_ijk(tissue.points.lps_mm(p)) - Eigen::Vector3d(voxel[0], voxel[1], voxel[2]);
    // Half a voxel, and float32 of 20 mm in voxels of 0.5 mm.
    EXPECT_LE(off.cwiseAbs().maxCoeff(), 0.5 + 4e-6);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_GE(voxel[axis], parameters.crop->begin[axis]);
      EXPECT_LT(voxel[axis], parameters.crop->end[axis]);
    }
  }
  EXPECT_TRUE(std::is_sorted(
      tissue.points.voxels.begin(), tissue.points.voxels.end(), [&](const auto& a, const auto& b) {
        return tissue.geometry.index(a[0], a[1], a[2]) < tissue.geometry.index(b[0], b[1], b[2]);
      }));
  EXPECT_FALSE(tissue.on_lattice);
  EXPECT_EQ(tissue.stride, 2);
  // A cube of eight voxels' volume.
  EXPECT_TRUE(tissue.spacing_mm.isApproxToConstant(2.0 * std::cbrt(0.5 * 0.7 * 1.4), 1e-12));
}

TEST(BlueNoise, KeepsItsPointsApartInMillimetres) {
  // Darts that are thrown and never moved fill space up to a least distance of
  // 0.90 of the cube root of a point's share; with a wish for the last point
  // somewhat less. A random scatter would have pairs at a hundredth.
  for (const Eigen::Vector3d& spacing : {Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(0.5, 0.5, 1.5)})
    for (const int stride : {1, 2}) {
      const Tissue tissue = generate(full_box(16 * stride, spacing), blue_noise(stride));
      ASSERT_EQ(tissue.points.size(), 4096U);
      const auto nearest = nearest_of(tissue.points, tissue.spacing_mm.x());
      EXPECT_GT(least(nearest), 0.6) << spacing.transpose() << " stride " << stride;
      double mean = 0.0;
      for (const double one : nearest) mean += one / static_cast<double>(nearest.size());
      EXPECT_GT(mean, 0.75) << "a random scatter has 0.55";
    }
}

TEST(BlueNoise, IsEvenOverTheTissueAndNotOnALattice) {
  const Tissue tissue = generate(full_box(24), blue_noise());
  // Counts in blocks of 4^3 voxels: 64 each. A random scatter would have a
  // variance of 64, this far below a third of it.
  std::map<std::array<int, 3>, int> counts;
  double phase = 0.0;
  for (std::size_t p = 0; p < tissue.points.size(); ++p) {
    const auto& voxel = tissue.points.voxels[p];
    ++counts[{voxel[0] / 4, voxel[1] / 4, voxel[2] / 4}];
    const Eigen::Vector3d at = tissue.geometry.to_ijk(tissue.points.lps_mm(p));
    phase += std::cos(2.0 * 3.14159265358979 * at.x()) / static_cast<double>(tissue.points.size());
  }
  ASSERT_EQ(counts.size(), 216U);
  double variance = 0.0;
  for (const auto& [block, count] : counts) variance += (count - 64.0) * (count - 64.0) / 216.0;
  EXPECT_LT(variance, 64.0 / 3.0);
  // A lattice would give 1 here; five standard errors of 13824 independent phases.
  EXPECT_LT(std::abs(phase), 5.0 * std::sqrt(0.5 / 13824.0));
}

TEST(BlueNoise, FollowsFromTheSeedAndNotFromTheThreads) {
  const Volume volume = sponge({40, 30, 35}, {0.4, 0.4, 1.0}, 0.4, 5);
  const Tissue one = generate_with(volume, blue_noise(), 1, {});
  for (const unsigned threads : {2U, 5U}) {
    const Tissue other = generate_with(volume, blue_noise(), threads, {});
    EXPECT_EQ(one.points.positions_mm, other.points.positions_mm);
    EXPECT_EQ(one.points.voxels, other.points.voxels);
    EXPECT_EQ(one.links.pairs, other.links.pairs);
    EXPECT_EQ(one.links.rest_lengths_mm, other.links.rest_lengths_mm);
  }
  EXPECT_NE(generate(volume, blue_noise(1, 2)).points.positions_mm, one.points.positions_mm);
  TissueParameters noisy = blue_noise();
  noisy.noise = 0.5;
  EXPECT_EQ(generate(volume, noisy).points.positions_mm, one.points.positions_mm)
      << "there is no lattice that the noise could shift";
}

TEST(BlueNoise, IsLinkedByMutualNearestOnly) {
  const Volume volume = shell({20, 20, 20}, {1, 1, 1}, 0.4);
  const Tissue tissue = generate(volume, blue_noise());
  EXPECT_EQ(tissue.links.pairs, link_nearest(tissue.points, tissue.spacing_mm, 12).pairs);
  EXPECT_GT(statistics_of(tissue).mean_links_per_point, 9.0);
  for (const LinkRule rule : {LinkRule::six, LinkRule::lattice18, LinkRule::lattice26}) {
    TissueParameters parameters = blue_noise();
    parameters.links = rule;
    try {
      generate(volume, parameters);
      ADD_FAILURE() << "nothing was refused";
    } catch (const palpate::core::Error& error) {
      EXPECT_EQ(error.kind(), palpate::core::ErrorKind::usage);
      EXPECT_NE(std::string(error.what()).find("nearest"), std::string::npos) << error.what();
    }
  }
}

TEST(BlueNoise, OfOddShapesIsMadeToo) {
  Eigen::Matrix3d sheared = Eigen::Matrix3d::Identity();
  sheared.col(2) = Eigen::Vector3d(0.7, 0.0, 0.7);
  const std::vector<Volume> volumes{
      full_box(1),
      shape({30, 30, 1}, {1, 1, 1}, [](int, int, int) { return true; }),
      shape({40, 1, 1}, {1, 1, 4}, [](int, int, int) { return true; }),
      shape({12, 12, 12}, {0.1, 0.1, 5.0}, [](int, int, int) { return true; }),
      shape(
          {12, 12, 12}, {1, 1, 1}, [](int, int, int) { return true; }, sheared),
      sponge({30, 30, 30}, {1, 1, 1}, 0.01, 3),
  };
  for (const Volume& volume : volumes) {
    TissueParameters lattice;
    lattice.threshold_low = 50.0;
    EXPECT_EQ(generate(volume, blue_noise()).points.size(), generate(volume, lattice).points.size());
    EXPECT_GE(generate(volume, blue_noise(3)).points.size(), 1U);
  }
}

TEST(BlueNoise, ItsEstimateIsExactInPointsAndCloseInLinks) {
  const std::vector<std::pair<const char*, Volume>> volumes{{"shell", shell({60, 70, 64}, {1, 1, 1}, 0.6)},
                                                            {"box", full_box(36)}};
  for (const auto& [name, volume] : volumes) {
    const TissueEstimate guess = estimate(volume, blue_noise());
    const TissueStatistics real = statistics_of(generate(volume, blue_noise()));
    EXPECT_TRUE(guess.sampled) << name;
    EXPECT_FALSE(guess.sample.on_lattice);
    EXPECT_EQ(guess.statistics.points, real.points) << name;
    // Counted in one block of 20 thousand points: its share of borders is not that of the whole.
    const double ratio = static_cast<double>(guess.statistics.links) / static_cast<double>(real.links);
    EXPECT_NEAR(ratio, 1.0, 0.05) << name;
    EXPECT_EQ(guess.statistics.components, real.components) << name;
  }
  TissueParameters parameters = blue_noise();
  parameters.min_component = 3;
  const Volume specks = sponge({60, 60, 60}, {1, 1, 1}, 0.2, 8);
  EXPECT_EQ(estimate(specks, parameters).statistics.points, generate(specks, parameters).points.size());
}

TEST(BlueNoise, StopsWhenAsked) {
  const palpate::core::CancelToken token;
  const palpate::core::Progress progress(
      [&](double fraction, const std::string&) {
        if (fraction >= 0.2) token.cancel();
      },
      token);
  try {
    generate(full_box(40), blue_noise(), progress);
    ADD_FAILURE() << "it went on";
  } catch (const palpate::core::Error& error) {
    EXPECT_EQ(error.kind(), palpate::core::ErrorKind::cancelled);
  }
}
