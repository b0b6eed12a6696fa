#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

namespace palpate::surface {

/// Points sorted into cubes, for exact searches around a place. Keeps a
/// reference to the points. Searches may run from several threads.
class PointGrid {
 public:
  struct Found {
    double squared_mm;
    std::uint32_t point;
    bool operator<(const Found& other) const {
      return squared_mm != other.squared_mm ? squared_mm < other.squared_mm : point < other.point;
    }
  };

  explicit PointGrid(const std::vector<Eigen::Vector3f>& points_mm);

  /// The `count` points nearest to `place_mm` for which `counts[point]` holds
  /// (all where it is empty), nearest first, ties by index.
  void nearest(const Eigen::Vector3d& place_mm, std::size_t count, const std::vector<bool>& counts,
               std::vector<Found>& out) const;
  bool any_within(const Eigen::Vector3d& place_mm, double reach_mm) const;

 private:
  std::size_t cell_index(const std::array<int, 3>& cell) const;
  std::array<int, 3> cell_of(const Eigen::Vector3d& place_mm) const;
  /// Below this distance no point lies outside the cells within `shell` of `cell`.
  double covered_mm(const Eigen::Vector3d& place_mm, const std::array<int, 3>& cell, int shell) const;
  /// Calls visit(point, squared distance) for the cells at Chebyshev distance `shell`.
  template <typename Visit>
  void visit_shell(const Eigen::Vector3d& place_mm, const std::array<int, 3>& cell, int shell,
                   Visit visit) const;

  const std::vector<Eigen::Vector3f>& points_;
  Eigen::Vector3d low_mm_ = Eigen::Vector3d::Zero();
  double cell_mm_ = 1.0;
  std::array<int, 3> dims_{1, 1, 1};
  std::vector<std::uint32_t> first_;  ///< of each cell in order_
  std::vector<std::uint32_t> order_;
};

}  // namespace palpate::surface
