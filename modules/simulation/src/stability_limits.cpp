#include "stability_limits.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

namespace palpate::simulation {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

/// The faster of the two decays of an overdamped mode.
double faster_decay(double a, double b) { return 0.5 * (b + std::sqrt(std::max(0.0, b * b - 4.0 * a))); }

/// Where the ray r (-zeta + i sqrt(1 - zeta^2)) leaves RK4's region of
/// stability. It lies between 2.5 and 3 for every zeta in [0, 1].
double rk4_radius(double zeta) {
  const std::complex<double> ray(-zeta, std::sqrt(std::max(0.0, 1.0 - zeta * zeta)));
  double inside = 2.5;
  double outside = 3.0;
  for (int halving = 0; halving < 30; ++halving) {
    const double r = 0.5 * (inside + outside);
    const std::complex<double> z = r * ray;
    const std::complex<double> growth = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)));
    (std::norm(growth) > 1.0 ? outside : inside) = r;
  }
  return inside;
}

double limit_of_euler(double a, double b) {
  if (!(b > 0.0)) return 0.0;
  return b * b < 4.0 * a ? b / a : 2.0 / faster_decay(a, b);
}

double limit_of_velocity_verlet(double a, double b) {
  return b * b < a ? 2.0 / (0.5 * b + std::sqrt(a - 0.75 * b * b)) : 2.0 / b;
}

double limit_of_rk4(double a, double b) {
  constexpr double real_axis = 2.7852935634;  // R(-2.785...) = 1
  if (b * b >= 4.0 * a) return real_axis / faster_decay(a, b);
  const double omega = std::sqrt(a);
  return rk4_radius(0.5 * b / omega) / omega;
}

}  // namespace

double limit_of_mode(Integrator integrator, double a, double b) {
  if (integrator == Integrator::implicit_euler || !(a > 0.0 || b > 0.0)) return infinite;
  if (integrator == Integrator::euler) return limit_of_euler(a, b);
  if (integrator == Integrator::velocity_verlet) return limit_of_velocity_verlet(a, b);
  if (integrator == Integrator::rk4) return limit_of_rk4(a, b);
  return 4.0 / (b + std::sqrt(b * b + 4.0 * a));
}

/// A mode scaled along (t^2 a, t b) has its limit divided by t, so that the
/// smallest limit lies on the border of the region.
RegionLimit limit_of_region(Integrator integrator, const ModeRegion& region) {
  constexpr int samples = 200;
  RegionLimit limit{infinite, false};
  const auto offer = [&](double a, double b) {
    const double step_s = limit_of_mode(integrator, a, b);
    if (step_s < limit.step_s) limit = {step_s, b * b > 4.0 * a};
  };
  const auto low = [&](double a) {
    return region.drag_low + region.slope_low * std::max(0.0, a - region.a_across);
  };
  const auto high = [&](double a) {
    return std::max(low(a), std::min(region.b_max, region.slope_high * a + region.drag_high));
  };
  for (int n = 0; n <= samples; ++n) {
    // Squares: as many samples among the slow modes as among the fast ones, in omega.
    const double part = static_cast<double>(n) / samples;
    const double a = region.a_max * part * part;
    offer(a, low(a));
    offer(a, high(a));
    offer(region.a_max, low(region.a_max) + part * (high(region.a_max) - low(region.a_max)));
  }
  const double kink = region.slope_high > 0.0 ? (region.b_max - region.drag_high) / region.slope_high : -1.0;
  if (kink > 0.0 && kink < region.a_max) offer(kink, high(kink));
  return limit;
}

}  // namespace palpate::simulation
