#pragma once

#include "nearest_list.hpp"

#include "palpate/core/progress.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace palpate::model {

/// Points sorted into cubic cells, searched in growing rings: for points
/// anywhere, however lonely. The number of cells is kept below a few per
/// point, so that one search over all of them stays bounded.
class CellGrid {
 public:
  CellGrid(std::vector<Eigen::Vector3d> places, double edge, const core::CancelToken& cancel);

  /// The exact n nearest of a point; `squared(point, other)` is the distance,
  /// which must be that of the places but for rounding.
  template <typename Squared>
  void nearest(std::uint32_t point, const Squared& squared, NearestList& list) const {
    list.clear();
    const Eigen::Vector3d& place = places_[point];
    const std::array<int, 3> home = cell_of(place);
    for (int ring = 0;; ++ring) {
      visit_ring(home, ring, [&](std::size_t cell) {
        for (std::uint32_t slot = starts_[cell]; slot < starts_[cell + 1]; ++slot)
          if (order_[slot] != point) list.offer(squared(point, order_[slot]), order_[slot]);
      });
      const double unseen = distance_to_unseen(place, home, ring);
      // The margin is far above the rounding of a cell's wall.
      if (unseen * unseen * (1.0 - 1e-9) > list.bound() || unseen == std::numeric_limits<double>::infinity())
        return;
    }
  }

 private:
  std::array<int, 3> cell_of(const Eigen::Vector3d& place) const noexcept;
  std::size_t index(int a, int b, int c) const noexcept {
    return (static_cast<std::size_t>(c) * static_cast<std::size_t>(size_[1]) + static_cast<std::size_t>(b)) *
               static_cast<std::size_t>(size_[0]) +
           static_cast<std::size_t>(a);
  }
  double distance_to_unseen(const Eigen::Vector3d& place, const std::array<int, 3>& home,
                            int ring) const noexcept;

  template <typename Visit>
  void visit_ring(const std::array<int, 3>& home, int ring, const Visit& visit) const {
    std::array<int, 3> low{};
    std::array<int, 3> high{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::max(0, home[axis] - ring);
      high[axis] = std::min(size_[axis] - 1, home[axis] + ring);
    }
    for (int c = low[2]; c <= high[2]; ++c)
      for (int b = low[1]; b <= high[1]; ++b) {
        const bool whole_row = std::abs(c - home[2]) == ring || std::abs(b - home[1]) == ring;
        if (whole_row) {
          for (int a = low[0]; a <= high[0]; ++a) visit(index(a, b, c));
          continue;
        }
        if (home[0] - ring >= 0) visit(index(home[0] - ring, b, c));
        if (home[0] + ring < size_[0]) visit(index(home[0] + ring, b, c));
      }
  }

  std::vector<Eigen::Vector3d> places_;
  Eigen::Vector3d low_ = Eigen::Vector3d::Zero();
  double edge_ = 1.0;
  std::array<int, 3> size_{1, 1, 1};
  std::vector<std::uint32_t> starts_;
  std::vector<std::uint32_t> order_;
};

}  // namespace palpate::model
