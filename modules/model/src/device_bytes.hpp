#pragma once

#include <cstddef>

namespace palpate::model {

/// Memory of a tissue of this size: the arrays of PointCloud, LinkGraph and
/// Adjacency, and what the explicit layout keeps on the device (docs/physics.md):
/// a column of partner and rest length per link slot, and per point six states
/// of two float4 (four that rotate, the snapshot, the rest place) and a selectance.
inline std::size_t bytes_of(std::size_t points, std::size_t links, int max_links_per_point) {
  const std::size_t host_point = 3 * 4 + 3 * 4 + 4 + 4;
  const std::size_t host_link = 2 * 4 + 4 + 2 * (4 + 4);
  const std::size_t device_point = 6 * 2 * 16 + 4 + static_cast<std::size_t>(max_links_per_point) * (4 + 4);
  return points * (host_point + device_point) + links * host_link;
}

}  // namespace palpate::model
