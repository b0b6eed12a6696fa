#include "palpate/simulation/sag.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::simulation {
namespace {

double rounded_up(double value) {
  const double digit = std::pow(10.0, std::floor(std::log10(value)));
  return std::ceil(value / digit) * digit;
}

}  // namespace

Sag sag_under_gravity(const model::Tissue& tissue, const std::vector<std::uint32_t>& anchors,
                      const Parameters& parameters) {
  Sag result;
  const double gravity = parameters.gravity_mm_per_s2.norm();
  const auto& places = tissue.points.positions_mm;
  if (!(gravity > 0.0) || anchors.empty() || anchors.size() >= places.size()) return result;
  const Eigen::Vector3f down = (parameters.gravity_mm_per_s2 / gravity).cast<float>();

  std::vector<bool> is_anchor(places.size(), false);
  for (const std::uint32_t point : anchors) is_anchor[point] = true;
  // Stretched by e, the links between anchors and the rest carry k e sum cos^2, and are longer by a part
  // e/l along gravity, l being their mean length along it, weighted by cos^2: k sum cos^2 l per strain.
  double lengths_mm = 0.0;
  for (const auto& [first, second] : tissue.links.pairs) {
    if (is_anchor[first] == is_anchor[second]) continue;
    const Eigen::Vector3f apart = places[second] - places[first];
    const double length = apart.norm();
    if (!(length > 0.0)) continue;
    const double along = std::abs(static_cast<double>(apart.dot(down)));
    lengths_mm += along * along / (length * length) * along;
  }
  double highest = std::numeric_limits<double>::infinity();
  double lowest = -highest;
  for (const auto& place : places) {
    const auto depth = static_cast<double>(place.dot(down));
    highest = std::min(highest, depth);
    lowest = std::max(lowest, depth);
  }
  const double weight = static_cast<double>(places.size() - anchors.size()) * parameters.mass * gravity;
  const double per_strain = parameters.stiffness_per_s2 * lengths_mm;
  result.strain = per_strain > 0.0 ? weight / per_strain : std::numeric_limits<double>::infinity();
  result.sag_mm = 0.5 * result.strain * (lowest - highest);  // the strain falls to nothing at the free end
  if (lengths_mm > 0.0) result.stiffness_per_s2 = std::max(1.0, rounded_up(5.0 * weight / lengths_mm));
  return result;
}

}  // namespace palpate::simulation
