#pragma once

#include "palpate/model/tissue.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate::simulation {

/// Points whose columns lie together (kernels/explicit_lanes.cl): a multiple
/// of what a work-item of any device takes.
constexpr std::size_t column_block = 64;
std::size_t column_place(std::size_t links_per_point, std::size_t slot, std::size_t point) noexcept;

/// The links of a point in columns, a slot each, for `stride` >= the points, a
/// multiple of column_block. Unused ends of columns name the point itself with
/// a rest length of zero.
struct Columns {
  std::size_t links_per_point = 1;  ///< slots: the most links of a point, at least 1
  std::vector<std::uint32_t> partners;
  std::vector<float> rest_lengths_mm;
};
Columns columns_of(const model::LinkGraph& links, std::size_t stride);

/// Where in the columns each link is, at its first and at its second end.
std::vector<std::array<std::uint32_t, 2>> places_of(const model::LinkGraph& links, std::size_t stride,
                                                    std::size_t links_per_point);

}  // namespace palpate::simulation
