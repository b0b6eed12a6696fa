#include "model_shapes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <set>

using namespace palpate::model;
using palpate::core::Volume;
using palpate::testing::full_box;
using palpate::testing::shape;
using palpate::testing::sponge;

namespace {

LinkGraph graph(std::vector<std::array<std::uint32_t, 2>> pairs) {
  LinkGraph links;
  links.rest_lengths_mm.assign(pairs.size(), 1.0F);
  links.pairs = std::move(pairs);
  return links;
}

/// Sizes by flooding along the adjacency: another way than the one under test.
std::multiset<std::size_t> flooded_sizes(const LinkGraph& links, std::size_t count) {
  const Adjacency adjacency = adjacency_of(links, count);
  std::vector<bool> seen(count, false);
  std::multiset<std::size_t> sizes;
  for (std::uint32_t start = 0; start < count; ++start) {
    if (seen[start]) continue;
    std::deque<std::uint32_t> queue{start};
    seen[start] = true;
    std::size_t size = 0;
    for (; !queue.empty(); queue.pop_front(), ++size)
      for (std::uint32_t n = adjacency.offsets[queue.front()]; n < adjacency.offsets[queue.front() + 1]; ++n)
        if (!seen[adjacency.neighbours[n]]) {
          seen[adjacency.neighbours[n]] = true;
          queue.push_back(adjacency.neighbours[n]);
        }
    sizes.insert(size);
  }
  return sizes;
}

/// Two boxes and a speck, none of them touching.
Volume pieces() {
  return shape({40, 12, 12}, {1, 1, 1}, [](int i, int j, int k) {
    return i < 10 || (i >= 20 && i < 24 && j < 5 && k < 5) || (i == 39 && j == 11 && k == 11);
  });
}

}  // namespace

TEST(Adjacency, ListsBothEndsOfEveryLink) {
  const LinkGraph links = graph({{0, 1}, {0, 3}, {1, 3}, {2, 3}});
  const Adjacency adjacency = adjacency_of(links, 5);
  EXPECT_EQ(adjacency.offsets, (std::vector<std::uint32_t>{0, 2, 4, 5, 8, 8}));
  EXPECT_EQ(adjacency.neighbours, (std::vector<std::uint32_t>{1, 3, 0, 3, 3, 0, 1, 2}));
  EXPECT_EQ(adjacency.links, (std::vector<std::uint32_t>{0, 1, 0, 2, 3, 1, 2, 3}));
  EXPECT_EQ(adjacency_of({}, 0).offsets, (std::vector<std::uint32_t>{0}));
}

TEST(Components, AreNumberedLargestFirst) {
  const Components components = components_of(graph({{1, 4}, {2, 3}, {3, 5}}), 7);
  EXPECT_EQ(components.sizes, (std::vector<std::size_t>{3, 2, 1, 1}));
  EXPECT_EQ(components.component, (std::vector<std::uint32_t>{2, 1, 0, 0, 1, 0, 3}));
}

TEST(Components, AgreeWithFlooding) {
  for (const double density : {0.1, 0.3, 0.45}) {
    TissueParameters parameters;
    parameters.links = LinkRule::six;
    const Tissue tissue = generate(sponge({25, 24, 23}, {1, 1, 1}, density, 2), parameters);
    const Components components = components_of(tissue.links, tissue.points.size());
    const std::multiset<std::size_t> sizes(components.sizes.begin(), components.sizes.end());
    EXPECT_EQ(sizes, flooded_sizes(tissue.links, tissue.points.size()));
    EXPECT_TRUE(std::is_sorted(components.sizes.rbegin(), components.sizes.rend()));
    for (const auto& pair : tissue.links.pairs)
      ASSERT_EQ(components.component[pair[0]], components.component[pair[1]]);
  }
}

TEST(Components, SmallOnesAreDroppedWithTheirLinks) {
  TissueParameters parameters;
  parameters.links = LinkRule::six;
  const std::size_t large = 10 * 12 * 12;
  const std::size_t small = 4 * 5 * 5;
  const Tissue all = generate(pieces(), parameters);
  EXPECT_EQ(all.points.size(), large + small + 1);
  for (const auto& [least, expected] :
       std::vector<std::pair<std::size_t, std::size_t>>{{1, large + small + 1},
                                                        {2, large + small},
                                                        {small, large + small},
                                                        {small + 1, large},
                                                        {large, large}}) {
    parameters.min_component = least;
    const Tissue tissue = generate(pieces(), parameters);
    EXPECT_EQ(tissue.points.size(), expected) << least;
    EXPECT_EQ(tissue.points.voxels.size(), expected);
    EXPECT_EQ(tissue.points.intensities.size(), expected);
    EXPECT_TRUE(std::is_sorted(tissue.links.pairs.begin(), tissue.links.pairs.end()));
    // What stays is the same tissue: same voxels, same lengths between them.
    std::set<std::pair<std::array<std::int32_t, 3>, std::array<std::int32_t, 3>>> before;
    for (const auto& pair : all.links.pairs)
      before.insert({all.points.voxels[pair[0]], all.points.voxels[pair[1]]});
    for (std::size_t link = 0; link < tissue.links.size(); ++link) {
      const auto& pair = tissue.links.pairs[link];
      ASSERT_EQ(before.count({tissue.points.voxels[pair[0]], tissue.points.voxels[pair[1]]}), 1U);
      ASSERT_NEAR(static_cast<double>(tissue.links.rest_lengths_mm[link]),
                  (tissue.points.lps_mm(pair[0]) - tissue.points.lps_mm(pair[1])).norm(),
                  2e-6);  // float32 of 20 mm
    }
  }
}

TEST(Components, DroppingEverythingIsSaid) {
  TissueParameters parameters;
  parameters.links = LinkRule::six;
  parameters.min_component = 1441;
  try {
    generate(pieces(), parameters);
    FAIL() << "nothing was thrown";
  } catch (const palpate::core::Error& error) {
    EXPECT_EQ(error.code(), "no-tissue");
    EXPECT_NE(std::string(error.what()).find("1440"), std::string::npos) << error.what();
  }
}

TEST(Components, AnEstimateThatDropsEverythingSaysSoToo) {
  // More than is built for an estimate.
  const palpate::core::Volume full(
      palpate::core::ImageGeometry({40, 40, 40}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()),
      std::vector<float>(64000, 1.0F));
  TissueParameters parameters;
  parameters.threshold_low = 0.5;
  parameters.links = LinkRule::six;
  parameters.min_component = 64001;
  try {
    palpate::model::estimate(full, parameters);
    FAIL() << "nothing was thrown";
  } catch (const palpate::core::Error& error) {
    EXPECT_EQ(error.code(), "no-tissue");
    EXPECT_NE(std::string(error.what()).find("64000"), std::string::npos) << error.what();
  }
}

TEST(Statistics, CountAndMeasure) {
  TissueParameters parameters;
  parameters.links = LinkRule::six;
  parameters.noise = 0.0;
  const Tissue tissue = generate(pieces(), parameters);
  const TissueStatistics statistics = statistics_of(tissue);
  EXPECT_EQ(statistics.points, 1541U);
  EXPECT_EQ(statistics.links, tissue.links.size());
  EXPECT_EQ(statistics.components, 3U);
  EXPECT_EQ(statistics.largest_component, 1440U);
  EXPECT_EQ(statistics.isolated, 1U);
  EXPECT_EQ(statistics.min_links_per_point, 0);
  EXPECT_EQ(statistics.max_links_per_point, 6);
  EXPECT_DOUBLE_EQ(statistics.mean_links_per_point, 2.0 * static_cast<double>(tissue.links.size()) / 1541.0);
  // The shape's origin is (-3, 5, 7) and its spacing 1; float32 of 20 mm.
  EXPECT_LT((statistics.bounds_min_mm - Eigen::Vector3d(-3, 5, 7)).norm(), 1e-5);
  EXPECT_LT((statistics.bounds_max_mm - Eigen::Vector3d(36, 16, 18)).norm(), 1e-5);
  EXPECT_GT(statistics.bytes, tissue.points.size() * 28 + tissue.links.size() * 12);
  EXPECT_EQ(statistics_of(Tissue()).points, 0U);
}
