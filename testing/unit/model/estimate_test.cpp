#include "model_shapes.hpp"

#include "palpate/model/generate.hpp"

#include <gtest/gtest.h>

#include <cmath>

using namespace palpate::model;
using palpate::core::Volume;
using palpate::testing::full_box;
using palpate::testing::shape;
using palpate::testing::shell;

namespace {

double ratio(std::size_t a, std::size_t b) { return static_cast<double>(a) / static_cast<double>(b); }

}  // namespace

TEST(Estimate, IsCloseForAShellAndABox) {
  const std::vector<std::pair<const char*, Volume>> volumes{
      {"shell", shell({70, 80, 64}, {1, 1, 1})},
      {"thin shell", shell({80, 80, 80}, {0.5, 0.5, 0.5}, 0.9)},
      {"flat shell", shell({70, 80, 64}, {0.5, 0.5, 1.5})},
      {"box", full_box(48)},
  };
  for (const auto& [name, volume] : volumes)
    for (const LinkRule rule : {LinkRule::nearest, LinkRule::six, LinkRule::lattice18, LinkRule::lattice26})
      for (const double noise : {0.1, 0.5}) {
        // Neighbours on the lattice do not depend on it.
        if (noise > 0.1 && rule != LinkRule::nearest) continue;
        TissueParameters parameters;
        parameters.threshold_low = 50.0;
        parameters.links = rule;
        parameters.noise = noise;
        const TissueEstimate guess = estimate(volume, parameters);
        const TissueStatistics real = statistics_of(generate(volume, parameters));
        EXPECT_TRUE(guess.sampled) << name;
        EXPECT_EQ(guess.statistics.points, real.points) << name;
        // 1500 of the points with a spread of about 2 links in 11 give 0.5 %; 3 % leaves room.
        EXPECT_NEAR(ratio(guess.statistics.links, real.links), 1.0, 0.03) << name << " noise " << noise;
        EXPECT_NEAR(ratio(guess.statistics.bytes, real.bytes), 1.0, 0.03) << name;
        EXPECT_EQ(guess.statistics.max_links_per_point, real.max_links_per_point) << name;
        // Where slices are far apart a few rare links decide what hangs together,
        // which touching voxels cannot tell.
        if (volume.geometry().spacing_mm().maxCoeff() < 1.01 || rule != LinkRule::nearest) {
          EXPECT_EQ(guess.statistics.components, real.components) << name << " noise " << noise;
          EXPECT_EQ(guess.statistics.largest_component, real.largest_component) << name;
        }
        // The estimate leaves the noise out of the bounds.
        const Eigen::Vector3d play = 1.001 * noise * volume.geometry().spacing_mm();
        EXPECT_TRUE(
            ((guess.statistics.bounds_min_mm - real.bounds_min_mm).cwiseAbs().array() <= play.array()).all());
        EXPECT_TRUE(
            ((guess.statistics.bounds_max_mm - real.bounds_max_mm).cwiseAbs().array() <= play.array()).all());
      }
}

TEST(Estimate, ItsSampleIsAPieceOfTheTissue) {
  const Volume volume = shell({70, 80, 64}, {1, 1, 1});
  const TissueEstimate guess = estimate(volume, {});
  const Tissue real = generate(volume, {});
  EXPECT_GT(guess.sample.points.size(), 2000U);
  EXPECT_LE(guess.sample.points.size(), 20000U);
  EXPECT_GT(guess.sample.links.size(), guess.sample.points.size());
  std::size_t n = 0;
  for (std::size_t p = 0; p < guess.sample.points.size(); ++p) {
    while (n < real.points.size() && real.points.voxels[n] != guess.sample.points.voxels[p]) ++n;
    ASSERT_LT(n, real.points.size());
    ASSERT_EQ(real.points.positions_mm[n], guess.sample.points.positions_mm[p]);
  }
}

TEST(Estimate, BuildsASmallTissueWhole) {
  TissueParameters parameters;
  parameters.min_component = 3;
  const Volume volume = palpate::testing::sponge({20, 20, 20}, {1, 1, 1}, 0.1, 8);
  const TissueEstimate guess = estimate(volume, parameters);
  const Tissue real = generate(volume, parameters);
  EXPECT_FALSE(guess.sampled);
  EXPECT_EQ(guess.sample.links.pairs, real.links.pairs);
  EXPECT_EQ(guess.statistics.points, real.points.size());
}

TEST(Estimate, CountsWhatStaysOfSpecks) {
  // A box and specks of eight voxels, well apart.
  const Volume volume = shape({60, 60, 60}, {1, 1, 1}, [](int i, int j, int k) {
    if (i < 40 && j < 40 && k < 40) return true;
    return i > 44 && j > 44 && k > 44 && i % 8 < 2 && j % 8 < 2 && k % 8 < 2;
  });
  TissueParameters parameters;
  parameters.min_component = 9;
  parameters.links = LinkRule::six;
  TissueEstimate guess = estimate(volume, parameters);
  EXPECT_EQ(guess.statistics.points, generate(volume, parameters).points.size());
  EXPECT_EQ(guess.statistics.components, 1U);

  parameters.links = LinkRule::nearest;
  guess = estimate(volume, parameters);
  const Tissue real = generate(volume, parameters);
  EXPECT_TRUE(guess.sampled);
  EXPECT_EQ(guess.statistics.points, real.points.size());
  EXPECT_EQ(guess.statistics.components, statistics_of(real).components);
  parameters.min_component = volume.size();
  EXPECT_THROW(estimate(volume, parameters), palpate::core::Error);
}

TEST(Estimate, CountsPiecesByTheRulesOwnNeighbours) {
  // Boxes that touch at edges only, and others that touch at corners only.
  const Volume volume = shape({48, 48, 48}, {1, 1, 1}, [](int i, int j, int k) {
    return k < 24 ? (i / 12 + j / 12) % 2 == 0 : (i / 12 + j / 12) % 2 == 0 && k / 12 % 2 == (i / 12) % 2;
  });
  for (const LinkRule rule : {LinkRule::six, LinkRule::lattice18, LinkRule::lattice26}) {
    TissueParameters parameters;
    parameters.threshold_low = 50.0;
    parameters.links = rule;
    const TissueEstimate guess = estimate(volume, parameters);
    const TissueStatistics real = statistics_of(generate(volume, parameters));
    EXPECT_TRUE(guess.sampled);
    EXPECT_EQ(guess.statistics.components, real.components);
    EXPECT_EQ(guess.statistics.largest_component, real.largest_component);
    EXPECT_EQ(guess.statistics.links, real.links) << "neighbours are counted at every point";
  }
}
