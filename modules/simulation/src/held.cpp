#include "held.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <string>

namespace palpate::simulation {

std::vector<HeldPoint> checked(std::vector<HeldPoint> held, std::size_t point_count) {
  for (const auto& [point, selectance] : held) {
    if (point >= point_count)
      throw core::Error(core::ErrorKind::internal, "held-point",
                        "Point " + std::to_string(point) + " is held, and there are only " +
                            std::to_string(point_count) + ".");
    if (!(selectance >= 0.0F && selectance <= 1.0F))
      core::throw_usage("A selectance is " + std::to_string(selectance) + ", and must lie between 0 and 1.");
  }
  std::stable_sort(held.begin(), held.end(), [](const auto& a, const auto& b) { return a.point < b.point; });
  // The last of equal points stays: unique keeps the first, so go backwards.
  std::reverse(held.begin(), held.end());
  held.erase(
      std::unique(held.begin(), held.end(), [](const auto& a, const auto& b) { return a.point == b.point; }),
      held.end());
  std::reverse(held.begin(), held.end());
  return held;
}

void check_size(const State& state, std::size_t point_count) {
  if (state.positions_mm.size() == point_count && state.velocities_mm_per_s.size() == point_count) return;
  throw core::Error(core::ErrorKind::internal, "state-size",
                    "A state of " + std::to_string(state.positions_mm.size()) + " positions and " +
                        std::to_string(state.velocities_mm_per_s.size()) +
                        " velocities does not fit a tissue of " + std::to_string(point_count) + " points.");
}

}  // namespace palpate::simulation
