#include "explicit_links.hpp"

#include <algorithm>
#include <utility>

namespace palpate::simulation {

std::size_t column_place(std::size_t links_per_point, std::size_t slot, std::size_t point) noexcept {
  return (point / column_block * links_per_point + slot) * column_block + point % column_block;
}

std::vector<std::array<std::uint32_t, 2>> places_of(const model::LinkGraph& links, std::size_t stride,
                                                    std::size_t links_per_point) {
  std::vector<std::uint32_t> used(stride, 0);
  std::vector<std::array<std::uint32_t, 2>> places(links.size());
  for (std::size_t link = 0; link < links.size(); ++link)
    for (std::size_t end = 0; end < 2; ++end) {
      const std::uint32_t point = links.pairs[link][end];
      places[link][end] = static_cast<std::uint32_t>(column_place(links_per_point, used[point]++, point));
    }
  return places;
}

Columns columns_of(const model::LinkGraph& links, std::size_t stride) {
  std::vector<std::uint32_t> used(stride, 0);
  for (const auto& pair : links.pairs)
    for (const std::uint32_t end : pair) ++used[end];
  Columns columns;
  if (stride > 0) columns.links_per_point = std::max(1U, *std::max_element(used.begin(), used.end()));
  columns.partners.resize(columns.links_per_point * stride);
  columns.rest_lengths_mm.assign(columns.partners.size(), 0.0F);
  const std::size_t slots = columns.links_per_point;
  for (std::size_t point = 0; point < stride; ++point)
    for (std::size_t slot = 0; slot < slots; ++slot)
      columns.partners[column_place(slots, slot, point)] = static_cast<std::uint32_t>(point);
  std::fill(used.begin(), used.end(), 0);
  for (std::size_t link = 0; link < links.size(); ++link) {
    const auto [a, b] = links.pairs[link];
    for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
      const std::size_t place = column_place(slots, used[from]++, from);
      columns.partners[place] = to;
      columns.rest_lengths_mm[place] = links.rest_lengths_mm[link];
    }
  }
  return columns;
}

}  // namespace palpate::simulation
