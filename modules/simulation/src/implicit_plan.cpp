#include "implicit_plan.hpp"

#include "palpate/simulation/stability.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::simulation {

namespace {

/// The largest |P| behind the first zero. Stability ends at a third; the
/// larger it is, the more of slow motion few iterations catch.
constexpr double largest_ripple = 0.25;
constexpr double pi = 3.14159265358979323846;

/// Chebyshev's polynomials of degree 0 .. count at s >= 1, each divided by the
/// next, without the overflow that the polynomials themselves run into:
/// q_n = T_n/T_n+1 = 1/(2 s - q_n-1).
std::vector<double> chebyshev_ratios(double s, int count) {
  std::vector<double> ratios{1.0 / s};
  while (static_cast<int>(ratios.size()) < count) ratios.push_back(1.0 / (2.0 * s - ratios.back()));
  return ratios;
}

}  // namespace

double ImplicitPlan::error_at(double eigenvalue) const {
  double error = 1.0;
  double before = 1.0;
  for (const auto& [momentum, rate] : iterations) {
    const double next = error + momentum * (error - before) - rate * eigenvalue * error;
    before = error;
    error = next;
  }
  return error;
}

ImplicitPlan implicit_plan(double spread, int most) {
  // P(l) = T_n(s0 - (s0 + c) l)/T_n(s0): c = cos(pi/2n) puts a zero of T_n on
  // l = 1, so that a point without links is stepped exactly.
  const double growth = std::acosh(1.0 / largest_ripple);
  const double needed = std::ceil(0.5 * growth * std::sqrt(spread));
  const int count = static_cast<int>(std::clamp<double>(needed, implicit_fewest_iterations, most));
  const double last_zero = std::cos(pi / (2.0 * count));
  // Where the iterations suffice, s(1/spread) = 1 and the ripple is smaller still.
  constexpr double as_good_as_infinite = 1e6;
  const double by_spread = (spread + last_zero) / std::max(spread - 1.0, 1.0 / as_good_as_infinite);
  const double s0 = std::max(std::cosh(growth / count), std::min(by_spread, as_good_as_infinite));

  ImplicitPlan plan;
  const std::vector<double> ratios = chebyshev_ratios(s0, count);
  const double slope = s0 + last_zero;
  plan.iterations.push_back({0.0, slope / s0});
  plan.ripple = ratios[0];
  for (int n = 1; n < count; ++n) {
    plan.iterations.push_back({ratios[n - 1] * ratios[n], 2.0 * slope * ratios[n]});
    plan.ripple *= ratios[n];
  }
  return plan;
}

ImplicitSpread implicit_spread(const model::Tissue& tissue, const Material& material) {
  Parameters unit;
  unit.integrator = Integrator::implicit_euler;
  unit.stiffness_per_s2 = 1.0;
  unit.damping_per_s = 1.0;
  unit.drag_per_s = 0.0;
  StabilityCase whole;
  whole.material = &material;
  const StableStep bound = stable_step(tissue, unit, whole);
  ImplicitSpread spread;
  spread.stiffness = bound.omega_per_s * bound.omega_per_s;
  spread.damping = bound.decay_per_s;
  spread.drag = 1.0;
  if (material.scales_drag != material.scales_mass)
    for (const float factor : material.factors) {
      const auto w = static_cast<double>(factor);
      spread.drag = std::max(spread.drag, material.scales_drag ? w : 1.0 / w);
    }
  return spread;
}

ImplicitPlan implicit_plan(const ImplicitSpread& spread, const Parameters& parameters, double step_s) {
  const double omega_squared = parameters.stiffness_per_s2 * spread.stiffness;
  const double mu = parameters.damping_per_s * spread.damping + parameters.drag_per_s * spread.drag;
  return implicit_plan(1.0 + step_s * (mu + step_s * omega_squared) / parameters.mass);
}

}  // namespace palpate::simulation
