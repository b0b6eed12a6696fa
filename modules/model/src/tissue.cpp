#include "palpate/model/tissue.hpp"

#include "components.hpp"
#include "device_bytes.hpp"
#include "union_find.hpp"

#include <algorithm>
#include <numeric>

namespace palpate::model {

Adjacency adjacency_of(const LinkGraph& links, std::size_t point_count) {
  Adjacency adjacency;
  adjacency.offsets.assign(point_count + 1, 0);
  for (const auto& pair : links.pairs)
    for (const std::uint32_t end : pair) ++adjacency.offsets[end + 1];
  std::partial_sum(adjacency.offsets.begin(), adjacency.offsets.end(), adjacency.offsets.begin());
  adjacency.neighbours.resize(adjacency.offsets.back());
  adjacency.links.resize(adjacency.offsets.back());
  std::vector<std::uint32_t> next(adjacency.offsets.begin(), adjacency.offsets.end() - 1);
  for (std::size_t link = 0; link < links.size(); ++link) {
    const auto& pair = links.pairs[link];
    for (std::size_t side = 0; side < 2; ++side) {
      const std::uint32_t slot = next[pair[side]]++;
      adjacency.neighbours[slot] = pair[1 - side];
      adjacency.links[slot] = static_cast<std::uint32_t>(link);
    }
  }
  return adjacency;
}

Components components_of(const LinkGraph& links, std::size_t point_count) {
  return components_with(links, point_count, core::CancelToken());
}

Components components_with(const LinkGraph& links, std::size_t point_count, const core::CancelToken& cancel) {
  constexpr std::size_t between_checks = 1U << 18U;  // a few milliseconds
  UnionFind sets(point_count);
  for (std::size_t link = 0; link < links.size(); ++link) {
    if (link % between_checks == 0) cancel.check();
    sets.join(links.pairs[link][0], links.pairs[link][1]);
  }

  Components result;
  result.component.resize(point_count);
  std::vector<std::size_t> sizes;
  for (std::uint32_t point = 0; point < point_count; ++point) {
    if (point % between_checks == 0) cancel.check();
    const std::uint32_t root = sets.root(point);
    // A root comes before the others of its set and so has its number already.
    if (root == point) {
      result.component[point] = static_cast<std::uint32_t>(sizes.size());
      sizes.push_back(1);
    } else {
      result.component[point] = result.component[root];
      ++sizes[result.component[root]];
    }
  }
  std::vector<std::uint32_t> order(sizes.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return sizes[a] > sizes[b]; });
  std::vector<std::uint32_t> rank(sizes.size());
  result.sizes.resize(sizes.size());
  for (std::uint32_t place = 0; place < order.size(); ++place) {
    rank[order[place]] = place;
    result.sizes[place] = sizes[order[place]];
  }
  for (std::uint32_t& component : result.component) component = rank[component];
  return result;
}

TissueStatistics statistics_of(const Tissue& tissue) {
  TissueStatistics statistics;
  const std::size_t count = tissue.points.size();
  statistics.points = count;
  statistics.links = tissue.links.size();
  if (count == 0) return statistics;

  std::vector<std::uint32_t> degree(count, 0);
  for (const auto& pair : tissue.links.pairs)
    for (const std::uint32_t end : pair) ++degree[end];
  const auto [fewest, most] = std::minmax_element(degree.begin(), degree.end());
  statistics.min_links_per_point = static_cast<int>(*fewest);
  statistics.max_links_per_point = static_cast<int>(*most);
  statistics.mean_links_per_point = 2.0 * static_cast<double>(statistics.links) / static_cast<double>(count);
  statistics.isolated = static_cast<std::size_t>(std::count(degree.begin(), degree.end(), 0U));

  const Components components = components_of(tissue.links, count);
  statistics.components = components.sizes.size();
  statistics.largest_component = components.sizes.front();

  Eigen::Vector3f low = tissue.points.positions_mm.front();
  Eigen::Vector3f high = low;
  for (const Eigen::Vector3f& position : tissue.points.positions_mm) {
    low = low.cwiseMin(position);
    high = high.cwiseMax(position);
  }
  statistics.bounds_min_mm = tissue.points.center_mm + low.cast<double>();
  statistics.bounds_max_mm = tissue.points.center_mm + high.cast<double>();
  statistics.bytes = bytes_of(statistics.points, statistics.links, statistics.max_links_per_point);
  return statistics;
}

}  // namespace palpate::model
