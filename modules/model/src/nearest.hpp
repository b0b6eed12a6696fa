#pragma once

#include "cell_grid.hpp"
#include "lattice.hpp"
#include "nearest_list.hpp"

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

namespace palpate::model {

/// Squared distance in the lattice, in units of its smallest spacing. Taken
/// from the lattice and the jitter rather than from positions in mm, so that
/// equal steps of the lattice are equal to the last bit and ties are ties.
class Metric {
 public:
  Metric(const core::ImageGeometry& geometry, int stride);

  double squared(double da, double db, double dc) const noexcept {
    const double x = da * unit_[0];
    const double y = db * unit_[1];
    const double z = dc * unit_[2];
    const double straight = x * x + y * y + z * z;
    return sheared_ ? straight + 2.0 * (shear_[0] * (x * y) + shear_[1] * (x * z) + shear_[2] * (y * z))
                    : straight;
  }
  /// Length of a step along each axis.
  const std::array<double, 3>& unit() const noexcept { return unit_; }
  /// No vector is shorter than this share of its length without shear.
  double least_stretch() const noexcept { return least_stretch_; }
  Eigen::Vector3d place(double a, double b, double c) const {
    return axes_ * Eigen::Vector3d(a * unit_[0], b * unit_[1], c * unit_[2]);
  }

 private:
  std::array<double, 3> unit_{1.0, 1.0, 1.0};
  std::array<double, 3> shear_{0.0, 0.0, 0.0};  ///< cosines between the axes: ij, ik, jk
  bool sheared_ = false;
  double least_stretch_ = 1.0;
  Eigen::Matrix3d axes_ = Eigen::Matrix3d::Identity();
};

/// The sites around a site, nearest first, for as far as `reach`: no site that
/// is left out can hold a point nearer than `reach`, whatever the jitter.
class OffsetTable {
 public:
  struct Entry {
    Cell offset;
    std::ptrdiff_t bit_step = 0;
    double remaining = 0.0;  ///< squared; no point of this or a later entry is nearer
  };
  OffsetTable(const Metric& metric, double amplitude, int max_links);
  const std::vector<Entry>& entries() const noexcept { return entries_; }
  double reach_squared() const noexcept { return reach_squared_; }
  Cell pad() const noexcept { return pad_; }
  void bind(const Occupancy& occupancy);

 private:
  std::vector<Entry> entries_;
  double reach_squared_ = 0.0;
  Cell pad_{0, 0, 0};
};

/// The n nearest of a point by the table. `offset_of(point, site)` gives a
/// point's jitter. Returns false where the table ended before it was certain;
/// the list then holds what was found.
template <typename OffsetOf>
bool nearest_by_table(const Occupancy& occupancy, const OffsetTable& table, const Metric& metric,
                      const Cell& site, const std::array<float, 3>& offset, const OffsetOf& offset_of,
                      NearestList& list) {
  list.clear();
  const std::size_t bit = occupancy.bit_of(site);
  const double own_a = static_cast<double>(offset[0]);
  const double own_b = static_cast<double>(offset[1]);
  const double own_c = static_cast<double>(offset[2]);
  for (const OffsetTable::Entry& entry : table.entries()) {
    if (entry.remaining > list.bound()) return true;
    const std::uint32_t other =
        occupancy.point_at(static_cast<std::size_t>(static_cast<std::ptrdiff_t>(bit) + entry.bit_step));
    if (other == Occupancy::none) continue;
    const Cell there{site[0] + entry.offset[0], site[1] + entry.offset[1], site[2] + entry.offset[2]};
    const std::array<float, 3> theirs = offset_of(other, there);
    list.offer(metric.squared(entry.offset[0] + (static_cast<double>(theirs[0]) - own_a),
                              entry.offset[1] + (static_cast<double>(theirs[1]) - own_b),
                              entry.offset[2] + (static_cast<double>(theirs[2]) - own_c)),
               other);
  }
  return table.reach_squared() > list.bound();
}

}  // namespace palpate::model
