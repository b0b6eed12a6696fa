#include "model_shapes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

using namespace palpate::model;
using palpate::core::Volume;
using palpate::testing::full_box;
using palpate::testing::shape;
using palpate::testing::shell;
using palpate::testing::sponge;

namespace {

using Pairs = std::vector<std::array<std::uint32_t, 2>>;

/// The thesis's words, in O(N^2): the n closest of each, and links where both agree.
template <typename Squared>
Pairs brute_force(std::size_t count, std::size_t n, const Squared& squared) {
  std::vector<std::set<std::uint32_t>> closest(count);
  for (std::uint32_t a = 0; a < count; ++a) {
    std::vector<std::pair<double, std::uint32_t>> others;
    for (std::uint32_t b = 0; b < count; ++b)
      if (a != b) others.emplace_back(squared(a, b), b);
    const auto keep = static_cast<std::ptrdiff_t>(std::min(n, others.size()));
    std::partial_sort(others.begin(), others.begin() + keep, others.end());
    for (std::ptrdiff_t place = 0; place < keep; ++place)
      closest[a].insert(others[static_cast<std::size_t>(place)].second);
  }
  Pairs pairs;
  for (std::uint32_t a = 0; a < count; ++a)
    for (const std::uint32_t b : closest[a])
      if (b > a && closest[b].count(a) != 0) pairs.push_back({a, b});
  return pairs;
}

Pairs brute_force(const PointCloud& points, int n) {
  return brute_force(points.size(), static_cast<std::size_t>(n), [&](std::uint32_t a, std::uint32_t b) {
    return (points.positions_mm[a].cast<double>() - points.positions_mm[b].cast<double>()).squaredNorm();
  });
}

void expect_brute_force(const Volume& volume, TissueParameters parameters, const std::string& name) {
  const Tissue tissue = generate(volume, parameters);
  EXPECT_EQ(tissue.links.pairs, brute_force(tissue.points, parameters.max_links)) << name;
  // link_nearest() sees positions only; the cases here are chosen without near-ties.
  EXPECT_EQ(link_nearest(tissue.points, tissue.spacing_mm, parameters.max_links).pairs, tissue.links.pairs)
      << name;
}

/// A blob, a hole in it, and specks far away, alone and in pairs.
Volume blob_with_specks(const Eigen::Vector3d& spacing_mm) {
  std::mt19937 engine(11);
  std::set<std::array<int, 3>> specks{{69, 49, 29}, {0, 49, 0},  {1, 49, 0},
                                      {69, 0, 0},   {60, 5, 28}, {61, 5, 29}};
  for (int n = 0; n < 12; ++n)
    specks.insert({30 + static_cast<int>(engine() % 40), static_cast<int>(engine() % 50),
                   static_cast<int>(engine() % 30)});
  return shape({70, 50, 30}, spacing_mm, [&](int i, int j, int k) {
    const double radius = Eigen::Vector3d(i - 10, j - 12, k - 9).norm();
    return (radius < 6.2 && radius > 2.4) || specks.count({i, j, k}) != 0;
  });
}

}  // namespace

TEST(NearestLinks, AreThoseOfBruteForce) {
  unsigned seed = 1;
  for (const Eigen::Vector3d& spacing : {Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(0.5, 0.5, 1.0),
                                         Eigen::Vector3d(0.25, 0.25, 0.75), Eigen::Vector3d(2.0, 0.5, 1.0)})
    for (const double noise : {0.1, 0.5})
      for (const int n : {1, 4, 12, 33, 64}) {
        TissueParameters parameters;
        parameters.noise = noise;
        parameters.max_links = n;
        parameters.seed = seed;
        const std::string name = "z " + std::to_string(spacing.z()) + " noise " + std::to_string(noise) +
                                 " n " + std::to_string(n);
        expect_brute_force(sponge({9, 8, 10}, spacing, 0.75, seed), parameters, name);
        expect_brute_force(sponge({16, 15, 14}, spacing, 0.08, seed), parameters, name + " sparse");
        ++seed;
      }
}

TEST(NearestLinks, AreThoseOfBruteForceForSpecksFarFromAll) {
  for (const Eigen::Vector3d& spacing : {Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(0.5, 0.5, 1.5)})
    for (const double noise : {0.1, 0.5})
      for (const int n : {3, 12}) {
        TissueParameters parameters;
        parameters.noise = noise;
        parameters.max_links = n;
        expect_brute_force(blob_with_specks(spacing), parameters, "noise " + std::to_string(noise));
      }
}

TEST(NearestLinks, AreThoseOfBruteForceWithStrideObliqueAndShearedAxes) {
  Eigen::Matrix3d sheared = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()).toRotationMatrix();
  sheared.col(2) = (sheared.col(2) + 0.4 * sheared.col(0)).eval();
  Eigen::Matrix3d flat = Eigen::Matrix3d::Identity();  // axes nearly in one plane
  flat.col(2) = Eigen::Vector3d(0.99, 0.0, 0.1);
  const Eigen::Matrix3d oblique =
      Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  for (const Eigen::Matrix3d& direction : {oblique, sheared, flat})
    for (const int stride : {1, 2}) {
      std::mt19937 engine(3);
      const Volume volume = shape(
          {15, 16, 14}, {0.5, 0.6, 1.0}, [&](int, int, int) { return engine() % 2 == 0; }, direction);
      TissueParameters parameters;
      parameters.stride = stride;
      expect_brute_force(volume, parameters, "stride " + std::to_string(stride));
    }
}

TEST(NearestLinks, BreakTiesByVoxelIndex) {
  // Without noise a lattice is full of ties. These spacings are not exact in
  // binary, so the distances here are of whole lattice steps.
  struct Case {
    Eigen::Vector3d spacing;
    std::array<int, 3> steps;
  };
  for (const Case& c :
       {Case{{0.3, 0.3, 0.3}, {1, 1, 1}}, Case{{0.3, 0.3, 0.9}, {1, 1, 3}}, Case{{0.7, 0.7, 1.4}, {1, 1, 2}}})
    for (const int n : {5, 8, 12, 20, 40}) {
      TissueParameters parameters;
      parameters.noise = 0.0;
      parameters.max_links = n;
      const Tissue tissue =
          generate(sponge({9, 10, 8}, c.spacing, 0.8, static_cast<unsigned>(n)), parameters);
      const auto& voxels = tissue.points.voxels;
      const Pairs expected =
          brute_force(voxels.size(), static_cast<std::size_t>(n), [&](std::uint32_t a, std::uint32_t b) {
            int sum = 0;
            for (std::size_t axis = 0; axis < 3; ++axis) {
              const int step = (voxels[a][axis] - voxels[b][axis]) * c.steps[axis];
              sum += step * step;
            }
            return static_cast<double>(sum);
          });
      EXPECT_EQ(tissue.links.pairs, expected) << c.spacing.transpose() << " n " << n;
    }
}

TEST(NearestLinks, FewerPointsThanLinksAreAllJoined) {
  TissueParameters parameters;
  parameters.max_links = 64;
  const Tissue tissue = generate(sponge({30, 30, 30}, {1, 1, 3}, 0.001, 4), parameters);
  const std::size_t count = tissue.points.size();
  ASSERT_GT(count, 10U);
  ASSERT_LT(count, 64U);
  EXPECT_EQ(tissue.links.size(), count * (count - 1) / 2);
}

TEST(NearestLinks, ALonePointHasNone) {
  const Tissue tissue = generate(full_box(1), {});
  EXPECT_EQ(tissue.points.size(), 1U);
  EXPECT_EQ(tissue.links.size(), 0U);
}

TEST(NearestLinks, OfTheStandardCaseLieInThe26Neighbourhood) {
  const Tissue tissue = generate(shell({60, 70, 50}, Eigen::Vector3d::Ones()), {});  // noise 0.1, n = 12
  ASSERT_GT(tissue.links.size(), 100000U);
  std::size_t beyond_18 = 0;
  for (const auto& pair : tissue.links.pairs) {
    int farthest = 0;
    int steps = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int step = std::abs(tissue.points.voxels[pair[0]][axis] - tissue.points.voxels[pair[1]][axis]);
      farthest = std::max(farthest, step);
      steps += step;
    }
    if (farthest > 1) {
      ADD_FAILURE() << "a link leaves the 26 neighbours";
      return;
    }
    if (steps > 2) ++beyond_18;
  }
  EXPECT_LT(static_cast<double>(beyond_18), 0.01 * static_cast<double>(tissue.links.size()));
}

TEST(NearestLinks, NoiseMakesMoreOfThem) {
  // Thesis 3.1: with noise, mutual choice gives more links than with index ties.
  TissueParameters parameters;
  parameters.noise = 0.0;
  const std::size_t without = generate(full_box(20), parameters).links.size();
  parameters.noise = 0.1;
  EXPECT_GT(generate(full_box(20), parameters).links.size(), without);
}

TEST(NearestLinks, RestAtTheirLengthAfterTheNoise) {
  for (const LinkRule rule : {LinkRule::six, LinkRule::nearest, LinkRule::lattice18, LinkRule::lattice26}) {
    TissueParameters parameters;
    parameters.links = rule;
    parameters.noise = 0.4;
    const Tissue tissue = generate(sponge({10, 10, 10}, {0.5, 0.5, 1.5}, 0.6, 9), parameters);
    ASSERT_EQ(tissue.links.rest_lengths_mm.size(), tissue.links.pairs.size());
    for (std::size_t link = 0; link < tissue.links.size(); ++link) {
      const auto& pair = tissue.links.pairs[link];
      const double length = (tissue.points.lps_mm(pair[0]) - tissue.points.lps_mm(pair[1])).norm();
      // One rounding to float32 of a length below 8 mm.
      EXPECT_NEAR(static_cast<double>(tissue.links.rest_lengths_mm[link]), length, 5e-7);
    }
  }
}

TEST(NearestLinks, RefuseWhatIsNoSpacingOrNumber) {
  EXPECT_THROW(link_nearest(PointCloud(), {1, 1, 0}, 12), palpate::core::Error);
  EXPECT_THROW(link_nearest(PointCloud(), {1, 1, 1}, 65), palpate::core::Error);
  EXPECT_EQ(link_nearest(PointCloud(), {1, 1, 1}, 12).size(), 0U);
}

TEST(NearestLinks, OfPointsInOnePlaceAndOnALine) {
  PointCloud points;
  points.positions_mm.assign(40, Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(link_nearest(points, {1, 1, 1}, 5).pairs, brute_force(points, 5));
  for (std::size_t n = 0; n < 40; ++n) points.positions_mm[n].x() = static_cast<float>(n * n);
  EXPECT_EQ(link_nearest(points, {0.01, 0.01, 0.01}, 5).pairs, brute_force(points, 5));
}

TEST(SixLinks, OfAFullBox) {
  TissueParameters parameters;
  parameters.links = LinkRule::six;
  const std::size_t n = 12;
  EXPECT_EQ(generate(full_box(static_cast<int>(n)), parameters).links.size(), 3 * n * n * n - 3 * n * n);
}

TEST(SixLinks, JoinTheAxisNeighboursThatExist) {
  for (const int stride : {1, 3}) {
    TissueParameters parameters;
    parameters.links = LinkRule::six;
    parameters.stride = stride;
    const Tissue tissue = generate(sponge({17, 13, 11}, {1, 2, 3}, 0.5, 21), parameters);
    Pairs expected;
    for (std::uint32_t a = 0; a < tissue.points.size(); ++a)
      for (std::uint32_t b = a + 1; b < tissue.points.size(); ++b) {
        int steps = 0;
        for (std::size_t axis = 0; axis < 3; ++axis)
          steps += std::abs(tissue.points.voxels[a][axis] - tissue.points.voxels[b][axis]);
        if (steps == stride) expected.push_back({a, b});
      }
    EXPECT_EQ(tissue.links.pairs, expected);
    EXPECT_FALSE(expected.empty());
  }
}

TEST(LatticeLinks, JoinTheNeighboursThatExistAlongUpToSoManyAxes) {
  for (const auto& [rule, most_axes] : {std::pair{LinkRule::lattice18, 2}, {LinkRule::lattice26, 3}})
    for (const int stride : {1, 2}) {
      TissueParameters parameters;
      parameters.links = rule;
      parameters.stride = stride;
      parameters.max_links = 1;  // does not count here
      const Tissue tissue = generate(sponge({17, 13, 11}, {1, 2, 3}, 0.5, 23), parameters);
      Pairs expected;
      for (std::uint32_t a = 0; a < tissue.points.size(); ++a)
        for (std::uint32_t b = a + 1; b < tissue.points.size(); ++b) {
          int farthest = 0;
          int axes = 0;
          for (std::size_t axis = 0; axis < 3; ++axis) {
            const int step = std::abs(tissue.points.voxels[a][axis] - tissue.points.voxels[b][axis]);
            farthest = std::max(farthest, step);
            if (step != 0) ++axes;
          }
          if (farthest == stride && axes <= most_axes) expected.push_back({a, b});
        }
      EXPECT_EQ(tissue.links.pairs, expected) << most_axes << " axes, stride " << stride;
      EXPECT_FALSE(expected.empty());
    }
}

TEST(LatticeLinks, OfAFullBox) {
  // Pairs a step d apart in a box of n^3: the product of n - |d| over the axes.
  const std::size_t n = 11;
  const std::size_t six = 3 * n * n * (n - 1);
  const std::size_t edges = 6 * n * (n - 1) * (n - 1);
  const std::size_t corners = 4 * (n - 1) * (n - 1) * (n - 1);
  TissueParameters parameters;
  parameters.links = LinkRule::lattice18;
  EXPECT_EQ(generate(full_box(static_cast<int>(n)), parameters).links.size(), six + edges);
  parameters.links = LinkRule::lattice26;
  EXPECT_EQ(generate(full_box(static_cast<int>(n)), parameters).links.size(), six + edges + corners);
}

TEST(LatticeLinks, SayWhereTheirLatticeLies) {
  TissueParameters parameters;
  parameters.links = LinkRule::lattice18;
  parameters.stride = 3;
  parameters.crop = CropBox{{1, 2, 3}, {12, 9, 99}};
  const Tissue tissue = generate(full_box(13), parameters);
  EXPECT_TRUE(tissue.on_lattice);
  EXPECT_EQ(tissue.stride, 3);
  EXPECT_EQ(tissue.first_voxel, (std::array<std::int32_t, 3>{1, 2, 3}));
  EXPECT_EQ(tissue.last_voxel, (std::array<std::int32_t, 3>{10, 8, 12}));
  EXPECT_EQ(tissue.points.voxels.front(), tissue.first_voxel);
  EXPECT_EQ(tissue.points.voxels.back(), tissue.last_voxel);
}
