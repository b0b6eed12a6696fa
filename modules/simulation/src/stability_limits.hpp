#pragma once

#include "palpate/simulation/parameters.hpp"

namespace palpate::simulation {

/// The largest stable step of one mode x'' + b x' + a x = 0 (a = omega^2,
/// b = 2 zeta omega), from the amplification matrix of the scheme:
///   Euler             b/a for zeta <= 1, else 2/s with s the faster root of s^2 - b s + a;
///                     none (0) where b is 0
///   symplectic Euler, Verlet with lagged velocity
///                     h^2 a + 2 h b <= 4, so (2/omega)(sqrt(1 + zeta^2) - zeta)
///   velocity Verlet   with p = h^2 a, q = h b: trace 2 - p - q + pq/4 + q^2/2, determinant
///                     1 - q + q^2/2 - pq/4, so p <= 4 - 2q + q^2 and q <= 2, that is
///                     (2/omega)/(zeta + sqrt(1 - 3 zeta^2)) for zeta <= 1/2, else 2/b; at worst
///                     sqrt(3)/omega
///   RK4               r/omega where the ray to the root leaves |R(z)| <= 1: r = 2.828 at zeta = 0,
///                     2.616 at zeta = 0.54; 2.785/s for zeta > 1
/// Infinite for a scheme without a limit, and where nothing acts.
double limit_of_mode(Integrator integrator, double a, double b);

/// Where a and b of every mode lie: 0 <= a <= a_max and
///   max(drag_low, slope_low (a - a_across) + drag_low) <= b <= min(b_max, slope_high a + drag_high).
/// For a mode u of s^2 + s B + A: a = u*Au and b = u*Bu, and c/k between the
/// slopes at every link puts B between those lines of A (a_across: what
/// stretching adds to A and dampers do not see).
struct ModeRegion {
  double a_max = 0.0;
  double a_across = 0.0;
  double b_max = 0.0;
  double slope_low = 0.0, slope_high = 0.0;
  double drag_low = 0.0, drag_high = 0.0;
};
struct RegionLimit {
  double step_s = 0.0;
  bool by_decay = false;  ///< the mode that limits is overdamped
};
RegionLimit limit_of_region(Integrator integrator, const ModeRegion& region);

}  // namespace palpate::simulation
