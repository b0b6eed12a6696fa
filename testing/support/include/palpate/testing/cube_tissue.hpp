#pragma once

#include "palpate/model/tissue.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <random>
#include <set>
#include <utility>
#include <vector>

// Small tissues made by brute force, so that tests of the solvers do not lean
// on the code that makes real ones.
namespace palpate::testing {

/// The same numbers on every machine (the standard's distributions differ).
class Numbers {
 public:
  explicit Numbers(std::uint32_t seed) : engine_(seed) {}
  /// Uniform in [low, high).
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0;
  }
  Eigen::Vector3f vector(double amplitude) {
    const double x = between(-amplitude, amplitude);
    const double y = between(-amplitude, amplitude);
    const double z = between(-amplitude, amplitude);
    return Eigen::Vector3d(x, y, z).cast<float>();
  }

 private:
  std::mt19937 engine_;
};

/// side^3 points 1 mm apart around the centre, each moved by up to `noise` mm along each axis.
inline model::Tissue cube_points(int side, double noise = 0.0, std::uint32_t seed = 1) {
  model::Tissue tissue;
  Numbers numbers(seed);
  const float half = static_cast<float>(side - 1) / 2.0F;
  for (int k = 0; k < side; ++k)
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) {
        const Eigen::Vector3f place(static_cast<float>(i) - half, static_cast<float>(j) - half,
                                    static_cast<float>(k) - half);
        tissue.points.positions_mm.push_back(place + numbers.vector(noise));
        tissue.points.voxels.push_back({i, j, k});
        tissue.points.intensities.push_back(1.0F);
      }
  tissue.geometry = core::ImageGeometry({side, side, side}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  return tissue;
}

/// Links at rest between the given pairs.
inline void set_links(model::Tissue& tissue, const std::set<std::array<std::uint32_t, 2>>& pairs) {
  const auto& x = tissue.points.positions_mm;
  tissue.links.pairs.assign(pairs.begin(), pairs.end());
  tissue.links.rest_lengths_mm.clear();
  for (const auto& [a, b] : pairs) tissue.links.rest_lengths_mm.push_back((x[b] - x[a]).norm());
}

/// The thesis' rule: linked when each is among the other's n nearest; ties by index.
inline void link_mutual_nearest(model::Tissue& tissue, std::size_t n) {
  const auto& x = tissue.points.positions_mm;
  std::vector<std::set<std::uint32_t>> nearest(x.size());
  for (std::uint32_t a = 0; a < x.size(); ++a) {
    std::vector<std::pair<float, std::uint32_t>> others;
    for (std::uint32_t b = 0; b < x.size(); ++b)
      if (b != a) others.emplace_back((x[b] - x[a]).squaredNorm(), b);
    const std::size_t count = std::min(n, others.size());
    std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(count), others.end());
    for (std::size_t slot = 0; slot < count; ++slot) nearest[a].insert(others[slot].second);
  }
  std::set<std::array<std::uint32_t, 2>> pairs;
  for (std::uint32_t a = 0; a < x.size(); ++a)
    for (const std::uint32_t b : nearest[a])
      if (a < b && nearest[b].count(a) != 0) pairs.insert({a, b});
  set_links(tissue, pairs);
}

/// Lattice neighbours whose voxels differ by at most one along each axis and
/// along at most `axes` axes: 1, 2, 3 axes give 6, 18, 26 neighbours.
inline void link_lattice(model::Tissue& tissue, int axes) {
  const auto& voxels = tissue.points.voxels;
  std::set<std::array<std::uint32_t, 2>> pairs;
  for (std::uint32_t a = 0; a < voxels.size(); ++a)
    for (std::uint32_t b = a + 1; b < voxels.size(); ++b) {
      int differing = 0;
      int furthest = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const int apart = std::abs(voxels[a][axis] - voxels[b][axis]);
        furthest = std::max(furthest, apart);
        differing += apart != 0 ? 1 : 0;
      }
      if (furthest == 1 && differing <= axes) pairs.insert({a, b});
    }
  set_links(tissue, pairs);
}

/// A jittered cube linked as the thesis does.
inline std::shared_ptr<model::Tissue> cube_tissue(int side, std::size_t links = 12, double noise = 0.1,
                                                  std::uint32_t seed = 1) {
  auto tissue = std::make_shared<model::Tissue>(cube_points(side, noise, seed));
  link_mutual_nearest(*tissue, links);
  return tissue;
}

/// Points at the given places, without links.
inline std::shared_ptr<model::Tissue> loose_points(const std::vector<Eigen::Vector3f>& places) {
  auto tissue = std::make_shared<model::Tissue>();
  for (const auto& place : places) {
    tissue->points.voxels.push_back({static_cast<std::int32_t>(tissue->points.size()), 0, 0});
    tissue->points.positions_mm.push_back(place);
    tissue->points.intensities.push_back(1.0F);
  }
  return tissue;
}

/// The thesis' oscillator x'' + 3x' + 45x = 0: point 1 at coordinate x on the
/// x axis, point 0 (to be held) eight millimetres to the left, the link at
/// rest at x = 0. It starts at x = 5 with k = 45, c = 3, D = 0.
inline std::shared_ptr<model::Tissue> oscillator_tissue() {
  auto tissue = loose_points({{-8.0F, 0.0F, 0.0F}, {5.0F, 0.0F, 0.0F}});
  tissue->links.pairs = {{0, 1}};
  tissue->links.rest_lengths_mm = {8.0F};
  return tissue;
}
/// Its exact solution with x(0) = 5, x'(0) = 0.
inline double oscillator_place(double t) {
  const double omega = std::sqrt(45.0 - 2.25);
  return std::exp(-1.5 * t) * (5.0 * std::cos(omega * t) + 7.5 / omega * std::sin(omega * t));
}

}  // namespace palpate::testing
