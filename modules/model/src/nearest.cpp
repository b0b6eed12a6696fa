#include "nearest.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace palpate::model {
namespace {

/// Direction cosines in files have about six digits; what is square to that
/// precision was meant to be square.
constexpr double square_within = 1e-4;
/// Above the rounding of every bound here, below any difference that matters.
constexpr double rounding_margin = 1.0 - 1e-9;
/// Axes nearly in one plane make the table's bound useless; then the cell grid does it all.
constexpr double strongest_shear = 0.2;

}  // namespace

Metric::Metric(const core::ImageGeometry& geometry, int stride) {
  const Eigen::Vector3d spacing = geometry.spacing_mm() * stride;
  const double smallest = spacing.minCoeff();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    // As float: a spacing of 0.9 over 0.3 becomes 3 and not 3.0000000000000004,
    // and ties along different axes stay ties.
    unit_[static_cast<std::size_t>(axis)] = static_cast<double>(static_cast<float>(spacing[axis] / smallest));
  }
  const Eigen::Matrix3d gram = geometry.direction().transpose() * geometry.direction();
  sheared_ = !gram.isIdentity(square_within);
  if (!sheared_) return;
  // The columns may also differ in length; that belongs to the units.
  axes_ = geometry.direction();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double length = axes_.col(axis).norm();
    unit_[static_cast<std::size_t>(axis)] *= length;
    axes_.col(axis) /= length;
  }
  const Eigen::Matrix3d cosines = axes_.transpose() * axes_;
  shear_ = {cosines(0, 1), cosines(0, 2), cosines(1, 2)};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(cosines, Eigen::EigenvaluesOnly);
  least_stretch_ = std::sqrt(std::max(1e-12, solver.eigenvalues().minCoeff())) * rounding_margin;
}

OffsetTable::OffsetTable(const Metric& metric, double amplitude, int max_links) {
  if (metric.least_stretch() < strongest_shear) return;
  // A flat border sees half of the sites and an edge a quarter; what needs
  // more than this is rare and goes to the cell grid.
  const auto wanted = static_cast<std::size_t>(std::max(256, 12 * max_links));
  const double play = 2.0 * amplitude;
  const auto& unit = metric.unit();

  const auto bound_squared = [&](const Cell& offset) {
    double sum = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double least = std::max(0.0, std::abs(offset[axis]) - play) * unit[axis];
      sum += least * least;
    }
    return sum * metric.least_stretch() * metric.least_stretch() * rounding_margin;
  };
  struct Candidate {
    Cell offset;
    double nominal;
    double least;
  };
  std::vector<Candidate> found;
  double reach = *std::min_element(unit.begin(), unit.end());
  for (; found.size() < wanted; reach *= 1.2) {
    found.clear();
    reach_squared_ = reach * reach;
    for (std::size_t axis = 0; axis < 3; ++axis)
      pad_[axis] = static_cast<int>(reach / (unit[axis] * metric.least_stretch()) * (1.0 + 1e-9) + play);
    for (int c = -pad_[2]; c <= pad_[2]; ++c)
      for (int b = -pad_[1]; b <= pad_[1]; ++b)
        for (int a = -pad_[0]; a <= pad_[0]; ++a) {
          const Cell offset{a, b, c};
          const double least = bound_squared(offset);
          if ((a != 0 || b != 0 || c != 0) && least <= reach_squared_)
            found.push_back({offset, metric.squared(a, b, c), least});
        }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Candidate& a, const Candidate& b) { return a.nominal < b.nominal; });
  entries_.resize(found.size());
  double remaining = reach_squared_;
  for (std::size_t n = found.size(); n-- > 0;) {
    remaining = std::min(remaining, found[n].least);
    entries_[n].offset = found[n].offset;
    entries_[n].remaining = remaining;
  }
}

void OffsetTable::bind(const Occupancy& occupancy) {
  for (Entry& entry : entries_) entry.bit_step = occupancy.bit_step(entry.offset);
}

}  // namespace palpate::model
