#include "implicit_plan.hpp"

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

/// P(l) = T_n(s0 - (s0 + c) l)/T_n(s0): c = cos(pi/2n), the last zero of T_n,
/// makes P(1) = 0. With this s0 the first zero lies on l = 1/spread.
double first_zero_on(double spread, int count) {
  constexpr double as_good_as_infinite = 1e6;
  const double c = std::cos(pi / (2.0 * count));
  return std::min(c * (spread + 1.0) / std::max(spread - 1.0, 1.0 / as_good_as_infinite),
                  as_good_as_infinite);
}

/// The s0 for which the ripple 1/T_n(s0) is the largest.
double largest_ripple_at(int count) { return std::cosh(std::acosh(1.0 / largest_ripple) / count); }

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
  int count = implicit_fewest_iterations;
  while (count < most && first_zero_on(spread, count) < largest_ripple_at(count)) ++count;
  const double s0 = std::max(first_zero_on(spread, count), largest_ripple_at(count));
  const double slope = s0 + std::cos(pi / (2.0 * count));

  ImplicitPlan plan;
  const std::vector<double> ratios = chebyshev_ratios(s0, count);
  plan.iterations.push_back({0.0, slope / s0});
  plan.ripple = ratios[0];
  for (int n = 1; n < count; ++n) {
    plan.iterations.push_back({ratios[n - 1] * ratios[n], 2.0 * slope * ratios[n]});
    plan.ripple *= ratios[n];
  }
  return plan;
}

ImplicitSpread implicit_spread(const model::Tissue& tissue, const Material& material) {
  const std::size_t count = tissue.points.size();
  std::vector<Eigen::Matrix3d> stiffness(count, Eigen::Matrix3d::Zero());
  std::vector<Eigen::Matrix3d> damping(count, Eigen::Matrix3d::Zero());
  const auto factor = [&](bool scaled, std::size_t point) {
    return scaled && !material.factors.empty() ? static_cast<double>(material.factors[point]) : 1.0;
  };
  for (std::size_t n = 0; n < tissue.links.size(); ++n) {
    const auto [i, j] = tissue.links.pairs[n];
    const Eigen::Vector3d apart =
        (tissue.points.positions_mm[j] - tissue.points.positions_mm[i]).cast<double>();
    if (tissue.links.rest_lengths_mm[n] == 0.0F || apart.isZero(0.0)) continue;
    const Eigen::Matrix3d along = apart * apart.transpose() / apart.squaredNorm();
    const auto mean = [&](bool scaled) { return (factor(scaled, i) + factor(scaled, j)) / 2.0; };
    for (const auto end : {i, j}) {
      stiffness[end] += mean(material.scales_stiffness) * along;
      damping[end] += mean(material.scales_damping) * along;
    }
  }
  ImplicitSpread spread;
  for (std::size_t n = 0; n < count; ++n) {
    const double mass = factor(material.scales_mass, n);
    spread.stiffness = std::max(spread.stiffness, 2.0 * eigenvalue_bound(stiffness[n]) / mass);
    spread.damping = std::max(spread.damping, 2.0 * eigenvalue_bound(damping[n]) / mass);
    spread.drag = std::max(spread.drag, factor(material.scales_drag, n) / mass);
  }
  return spread;
}

double eigenvalue_bound(const Eigen::Matrix3d& matrix) {
  const double mean = matrix.trace() / 3.0;
  return mean + 2.0 * std::sqrt((matrix - mean * Eigen::Matrix3d::Identity()).squaredNorm() / 6.0);
}

ImplicitPlan implicit_plan(const ImplicitSpread& spread, const Parameters& parameters, double step_s) {
  const double omega_squared = parameters.stiffness_per_s2 * spread.stiffness;
  const double mu = parameters.damping_per_s * spread.damping + parameters.drag_per_s * spread.drag;
  return implicit_plan(1.0 + step_s * (mu + step_s * omega_squared) / parameters.mass);
}

}  // namespace palpate::simulation
