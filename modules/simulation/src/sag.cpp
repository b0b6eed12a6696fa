#include "palpate/simulation/sag.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::simulation {

Sag sag_under_gravity(const model::Tissue& tissue, const model::TissueStatistics& statistics,
                      const std::vector<std::uint32_t>& anchors, const Parameters& parameters) {
  Sag result;
  const double gravity = parameters.gravity_mm_per_s2.norm();
  const double links = statistics.square_length_per_point_mm2;
  if (!(gravity > 0.0) || !(links > 0.0) || anchors.empty()) return result;
  const Eigen::Vector3f down = (parameters.gravity_mm_per_s2 / gravity).cast<float>();
  const auto& places = tissue.points.positions_mm;
  const auto depth = [&](std::size_t point) { return static_cast<double>(places[point].dot(down)); };
  auto [highest, lowest] = std::pair{depth(anchors.front()), depth(anchors.front())};
  for (const std::uint32_t point : anchors) {
    highest = std::min(highest, depth(point));
    lowest = std::max(lowest, depth(point));
  }
  for (std::size_t point = 0; point < places.size(); ++point)
    result.height_mm = std::max({result.height_mm, depth(point) - lowest, highest - depth(point)});

  // A strain e along gravity stretches a link of length L at an angle t by L e cos^2 t. With links in
  // all directions alike, the mean of cos^4 t is 1/5: a point's links hold k/m sum L^2 e^2/10.
  const double modulus = parameters.stiffness_per_s2 / parameters.mass * links / 5.0;  // mm^2/s^2
  const double weight = gravity * result.height_mm * result.height_mm / 2.0;
  if (weight > 0.0)
    result.sag_mm = modulus > 0.0 ? weight / modulus : std::numeric_limits<double>::infinity();
  if (!(result.height_mm > 0.0)) return result;
  const double enough = weight / (0.1 * result.height_mm) * parameters.mass * 5.0 / links;
  const double digit = std::pow(10.0, std::floor(std::log10(enough)));
  result.stiffness_per_s2 = std::max(1.0, std::ceil(enough / digit) * digit);
  return result;
}

}  // namespace palpate::simulation
