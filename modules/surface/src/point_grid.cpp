#include "point_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::surface {

using Eigen::Vector3d;

PointGrid::PointGrid(const std::vector<Eigen::Vector3f>& points_mm) : points_(points_mm) {
  Vector3d high = Vector3d::Zero();
  if (!points_.empty()) low_mm_ = high = points_.front().cast<double>();
  for (const auto& point : points_) {
    low_mm_ = low_mm_.cwiseMin(point.cast<double>());
    high = high.cwiseMax(point.cast<double>());
  }
  const Vector3d size = high - low_mm_;
  // About two points a cell where they fill their box; flat or thin clouds are
  // measured along the axes that they have.
  double filled = 1.0;
  int axes = 0;
  for (int axis = 0; axis < 3; ++axis)
    if (size[axis] > 1e-6 * size.maxCoeff()) {
      filled *= size[axis];
      ++axes;
    }
  const double per_cell = 2.0 * filled / std::max<double>(1.0, static_cast<double>(points_.size()));
  cell_mm_ = axes > 0 ? std::pow(per_cell, 1.0 / axes) : 1.0;
  constexpr double most_cells_an_axis = 1024.0;
  cell_mm_ = std::max(cell_mm_, size.maxCoeff() / most_cells_an_axis);
  if (!(cell_mm_ > 0.0)) cell_mm_ = 1.0;
  for (int axis = 0; axis < 3; ++axis)
    dims_[static_cast<std::size_t>(axis)] = static_cast<int>(size[axis] / cell_mm_) + 1;

  const std::size_t cells = static_cast<std::size_t>(dims_[0]) * static_cast<std::size_t>(dims_[1]) *
                            static_cast<std::size_t>(dims_[2]);
  first_.assign(cells + 1, 0);
  std::vector<std::size_t> cell_of_point(points_.size());
  for (std::size_t point = 0; point < points_.size(); ++point) {
    cell_of_point[point] = cell_index(cell_of(points_[point].cast<double>()));
    ++first_[cell_of_point[point] + 1];
  }
  for (std::size_t cell = 0; cell < cells; ++cell) first_[cell + 1] += first_[cell];
  order_.resize(points_.size());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (std::size_t point = 0; point < points_.size(); ++point)
    order_[next[cell_of_point[point]]++] = static_cast<std::uint32_t>(point);
}

std::size_t PointGrid::cell_index(const std::array<int, 3>& cell) const {
  return (static_cast<std::size_t>(cell[2]) * static_cast<std::size_t>(dims_[1]) +
          static_cast<std::size_t>(cell[1])) *
             static_cast<std::size_t>(dims_[0]) +
         static_cast<std::size_t>(cell[0]);
}

std::array<int, 3> PointGrid::cell_of(const Vector3d& place_mm) const {
  std::array<int, 3> cell{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<int>(axis);
    const double cells = std::floor((place_mm[a] - low_mm_[a]) / cell_mm_);
    cell[axis] = static_cast<int>(std::clamp(cells, 0.0, static_cast<double>(dims_[axis] - 1)));
  }
  return cell;
}

double PointGrid::covered_mm(const Vector3d& place_mm, const std::array<int, 3>& cell, int shell) const {
  double covered = std::numeric_limits<double>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<int>(axis);
    const double place = place_mm[a] - low_mm_[a];
    if (cell[axis] - shell - 1 >= 0)
      covered = std::min(covered, std::max(0.0, place - cell_mm_ * (cell[axis] - shell)));
    if (cell[axis] + shell + 1 < dims_[axis])
      covered = std::min(covered, std::max(0.0, cell_mm_ * (cell[axis] + shell + 1) - place));
  }
  return covered;
}

template <typename Visit>
void PointGrid::visit_shell(const Vector3d& place_mm, const std::array<int, 3>& cell, int shell,
                            Visit visit) const {
  const auto from = [&](std::size_t axis) { return std::max(0, cell[axis] - shell); };
  const auto to = [&](std::size_t axis) { return std::min(dims_[axis] - 1, cell[axis] + shell); };
  const auto visit_cell = [&](int i, int j, int k) {
    const std::size_t index = cell_index({i, j, k});
    for (std::uint32_t n = first_[index]; n < first_[index + 1]; ++n) {
      const std::uint32_t point = order_[n];
      visit(point, (points_[point].cast<double>() - place_mm).squaredNorm());
    }
  };
  for (int k = from(2); k <= to(2); ++k)
    for (int j = from(1); j <= to(1); ++j) {
      if (std::abs(k - cell[2]) == shell || std::abs(j - cell[1]) == shell) {
        for (int i = from(0); i <= to(0); ++i) visit_cell(i, j, k);
      } else {
        if (cell[0] - shell >= 0) visit_cell(cell[0] - shell, j, k);
        if (cell[0] + shell < dims_[0] && shell > 0) visit_cell(cell[0] + shell, j, k);
      }
    }
}

void PointGrid::nearest(const Vector3d& place_mm, std::size_t count, const std::vector<bool>& counts,
                        std::vector<Found>& out) const {
  out.clear();
  if (count == 0) return;
  const std::array<int, 3> cell = cell_of(place_mm);
  for (int shell = 0;; ++shell) {
    visit_shell(place_mm, cell, shell, [&](std::uint32_t point, double squared_mm) {
      if (!counts.empty() && !counts[point]) return;
      const Found found{squared_mm, point};
      if (out.size() == count && !(found < out.back())) return;
      if (out.size() == count) out.pop_back();
      out.insert(std::upper_bound(out.begin(), out.end(), found), found);
    });
    const double covered = covered_mm(place_mm, cell, shell);
    if (covered == std::numeric_limits<double>::infinity()) return;  // every cell was seen
    if (out.size() == count && out.back().squared_mm < covered * covered) return;
  }
}

bool PointGrid::any_within(const Vector3d& place_mm, double reach_mm) const {
  if (points_.empty() || !(reach_mm >= 0.0)) return false;
  const std::array<int, 3> cell = cell_of(place_mm);
  for (int shell = 0;; ++shell) {
    bool found = false;
    visit_shell(place_mm, cell, shell,
                [&](std::uint32_t, double squared_mm) { found |= squared_mm <= reach_mm * reach_mm; });
    if (found) return true;
    if (covered_mm(place_mm, cell, shell) > reach_mm) return false;
  }
}

}  // namespace palpate::surface
