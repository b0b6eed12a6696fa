#include "cell_grid.hpp"

#include <cmath>

namespace palpate::model {

CellGrid::CellGrid(std::vector<Eigen::Vector3d> places, double edge, const core::CancelToken& cancel)
    : places_(std::move(places)), edge_(edge) {
  if (places_.empty()) return;
  low_ = places_.front();
  Eigen::Vector3d high = low_;
  for (const Eigen::Vector3d& place : places_) {
    low_ = low_.cwiseMin(place);
    high = high.cwiseMax(place);
  }
  const Eigen::Vector3d extent = high - low_;
  const double most_cells = 2.0 * static_cast<double>(places_.size()) + 64.0;
  const auto cells = [&](double e) { return (extent / e).array().floor() + 1.0; };
  while (cells(edge_).prod() > most_cells) edge_ *= 1.25;
  for (std::size_t axis = 0; axis < 3; ++axis)
    size_[axis] = static_cast<int>(cells(edge_)[static_cast<Eigen::Index>(axis)]);
  cancel.check();

  std::vector<std::uint32_t> cell(places_.size());
  starts_.assign(index(size_[0] - 1, size_[1] - 1, size_[2] - 1) + 2, 0);
  for (std::size_t point = 0; point < places_.size(); ++point) {
    const std::array<int, 3> at = cell_of(places_[point]);
    cell[point] = static_cast<std::uint32_t>(index(at[0], at[1], at[2]));
    ++starts_[cell[point] + 1];
  }
  cancel.check();
  for (std::size_t n = 1; n < starts_.size(); ++n) starts_[n] += starts_[n - 1];
  std::vector<std::uint32_t> next(starts_.begin(), starts_.end() - 1);
  order_.resize(places_.size());
  for (std::uint32_t point = 0; point < places_.size(); ++point) order_[next[cell[point]]++] = point;
  cancel.check();
}

std::array<int, 3> CellGrid::cell_of(const Eigen::Vector3d& place) const noexcept {
  std::array<int, 3> cell{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto row = static_cast<Eigen::Index>(axis);
    cell[axis] = std::clamp(static_cast<int>((place[row] - low_[row]) / edge_), 0, size_[axis] - 1);
  }
  return cell;
}

double CellGrid::distance_to_unseen(const Eigen::Vector3d& place, const std::array<int, 3>& home,
                                    int ring) const noexcept {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto row = static_cast<Eigen::Index>(axis);
    const double from_low = place[row] - low_[row];
    if (home[axis] - ring > 0) nearest = std::min(nearest, from_low - (home[axis] - ring) * edge_);
    if (home[axis] + ring < size_[axis] - 1)
      nearest = std::min(nearest, (home[axis] + ring + 1) * edge_ - from_low);
  }
  return std::max(0.0, nearest);
}

}  // namespace palpate::model
