#pragma once

#include "palpate/core/volume.hpp"
#include "palpate/imaging/filters.hpp"

#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace filter_test {

/// Numbers in [0, 1) without pattern, the same everywhere.
class Scatter {
 public:
  double next() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 11U) / 9007199254740992.0;
  }
  /// Standard normal (Box and Muller).
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - next()));
    return radius * std::cos(2.0 * 3.14159265358979 * next());
  }

 private:
  std::uint64_t state_ = 20240117;
};

inline palpate::core::ImageGeometry oblique(std::array<int, 3> dims, const Eigen::Vector3d& spacing) {
  Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  turn.col(1) *= -1.0;  // left-handed too
  return {dims, spacing, Eigen::Vector3d(-31.7, 12.25, 5.1), turn};
}

/// Values in [0, 250), each on its own, voxels of unequal sides.
inline palpate::core::Volume noise(std::array<int, 3> dims,
                                   const Eigen::Vector3d& spacing = {0.4, 0.7, 0.5}) {
  const auto geometry = oblique(dims, spacing);
  Scatter scatter;
  std::vector<float> voxels(geometry.voxel_count());
  for (float& value : voxels) value = static_cast<float>(250.0 * scatter.next());
  return {geometry, std::move(voxels)};
}

/// value(i, j, k) at every voxel.
template <typename Value>
palpate::core::Volume made_of(std::array<int, 3> dims, const Eigen::Vector3d& spacing, Value value) {
  const auto geometry = oblique(dims, spacing);
  std::vector<float> voxels(geometry.voxel_count());
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const auto [i, j, k] = geometry.ijk_of(n);
    voxels[n] = static_cast<float>(value(i, j, k));
  }
  return {geometry, std::move(voxels)};
}

inline palpate::core::Volume filtered(const palpate::core::Volume& volume,
                                      const std::vector<palpate::imaging::FilterStep>& chain) {
  return palpate::imaging::apply_filters(volume, chain).volume;
}

/// All filters with the parameters that do the most.
inline std::vector<palpate::imaging::FilterStep> strongest() {
  std::vector<palpate::imaging::FilterStep> steps;
  for (const auto& filter : palpate::imaging::filters()) {
    palpate::imaging::FilterStep step{filter.name, {}};
    for (const auto& parameter : filter.parameters)
      step.parameters[parameter.name] = parameter.name == "sigma_mm" ? 5.0 : parameter.max;
    steps.push_back(step);
  }
  return steps;
}

}  // namespace filter_test
