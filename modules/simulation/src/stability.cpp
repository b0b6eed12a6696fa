#include "palpate/simulation/stability.hpp"

#include "stability_eigen.hpp"
#include "stability_limits.hpp"
#include "stability_links.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace palpate::simulation {

namespace {

/// Explicit Euler is stable only where damping acts, and across a stretched
/// link none does: with it no step would be stable. Its limit is therefore
/// that of the links' own direction; what grows across is slow, and the guard's.
bool sees_stretch(const Parameters& parameters) { return parameters.integrator != Integrator::euler; }

StableStep limit_by(const Parameters& parameters, const PointBounds& bounds) {
  ModeRegion region{bounds.stiffness,  bounds.across,   bounds.damping,  bounds.slope_low,
                    bounds.slope_high, bounds.drag_low, bounds.drag_high};
  // Without springs the dampers alone say how fast.
  if (!(bounds.stiffness > 0.0)) region.drag_high = bounds.damping;
  const RegionLimit limit = limit_of_region(parameters.integrator, region);
  StableStep stable;
  stable.step_s = limit.step_s;
  stable.omega_per_s = std::sqrt(bounds.stiffness);
  stable.worst_point = limit.by_decay ? bounds.damping_point : bounds.stiffness_point;
  stable.decay_per_s = bounds.damping;
  return stable;
}

/// The start of the iteration leans to the points whose own bound is high:
/// a single odd point among a million is then not missed.
std::vector<float> start_weights(const PointBounds& bounds) {
  std::vector<float> weights(bounds.by_point.size(), 1.0F);
  if (!(bounds.stiffness > 0.0)) return weights;
  for (std::size_t n = 0; n < weights.size(); ++n) {
    const float share = bounds.by_point[n] / static_cast<float>(bounds.stiffness);
    weights[n] = 0.01F + share * share * share * share;
  }
  return weights;
}

}  // namespace

StableStep stable_step(const model::Tissue& tissue, const Parameters& parameters, const StabilityCase& at) {
  const StabilityField field(tissue, parameters, at, sees_stretch(parameters));
  return limit_by(parameters, point_bounds(field, Slices(tissue.links, tissue.points.size())));
}

StableStep estimated_stable_step(const model::Tissue& tissue, const Parameters& parameters,
                                 const StabilityCase& at, const core::Progress& progress,
                                 std::vector<float>* mode) {
  progress.report(0.0, "Largest stable step");
  const StabilityField field(tissue, parameters, at, sees_stretch(parameters));
  const Slices slices(tissue.links, tissue.points.size());
  PointBounds bounds = point_bounds(field, slices);
  if (parameters.integrator == Integrator::implicit_euler) return limit_by(parameters, bounds);
  const auto weights = start_weights(bounds);
  if (bounds.stiffness > 0.0) {
    const LinkOperator matrix(field, slices, LinkOperator::Kind::stiffness);
    const auto top = largest_eigenvalue(matrix, slices, weights, mode, progress.part(0.05, 0.6));
    bounds.stiffness = std::min(bounds.stiffness, top.value);
    bounds.stiffness_point = top.point;
  }
  // With the same c/k at every link the damping of each mode follows from its omega.
  const bool follows =
      bounds.stiffness > 0.0 && bounds.slope_high - bounds.slope_low <= 1e-6 * bounds.slope_high;
  if (follows) {
    bounds.damping = std::min(bounds.damping, bounds.slope_high * bounds.stiffness + bounds.drag_high);
    bounds.damping_point = bounds.stiffness_point;
  } else if (parameters.damping_per_s > 0.0 && bounds.damping > 0.0) {
    const LinkOperator matrix(field, slices, LinkOperator::Kind::damping);
    const auto top = largest_eigenvalue(matrix, slices, weights, nullptr, progress.part(0.6, 1.0));
    bounds.damping = std::min(bounds.damping, top.value);
    bounds.damping_point = top.point;
  }
  StableStep stable = limit_by(parameters, bounds);
  stable.is_estimate = true;
  return stable;
}

double automatic_step_s(const StableStep& limit) {
  constexpr double longest_s = 0.02;
  constexpr double thesis_s = 0.006;
  constexpr double shortest_s = 1e-9;
  if (std::isinf(limit.step_s)) return limit.omega_per_s > 0.0 ? thesis_s : longest_s;
  if (limit.step_s >= shortest_s) return std::min(0.9 * limit.step_s, longest_s);
  core::throw_usage(
      "This scheme has no stable step for this tissue: explicit Euler has none without damping. Give the "
      "tissue damping, name a step, or choose another integrator, such as rk4.");
}

}  // namespace palpate::simulation
