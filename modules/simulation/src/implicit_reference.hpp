#pragma once

#include "implicit_plan.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::simulation {

/// What the implicit step needs of a tissue, in double: living links only.
struct ImplicitSystem {
  struct Link {
    std::array<std::uint32_t, 2> ends{};
    double rest_length_mm = 0.0;  ///< at the end of the step, where it beats
    double stiffness = 0.0;       ///< k_ij: force per mm
    double damping = 0.0;         ///< c_ij
  };
  std::vector<Link> links;
  std::vector<double> mass;     ///< one a point, as all that follow
  std::vector<double> drag;     ///< force per mm/s
  std::vector<double> freedom;  ///< 1 - selectance, 0 for an anchor
  Eigen::Vector3d gravity_mm_per_s2 = Eigen::Vector3d::Zero();
};

/// One step of linearised backward Euler (docs/adr/0012-*.md): with the links'
/// stiffness K and damping C at x, made positive, and w the freedom,
///   (M/w + h (C + D) + h^2 K) u = h (F(x, v) - h K v),  v += u,  x += h w v,
/// solved as `plan` says with B = r M/w, where r is the largest of the points'
/// 1 + w (h D + 2 |T|)/m, |T| a bound on the eigenvalues of a point's block of
/// h C + h^2 K. The plain twin of kernels/implicit_explicit.cl.
void implicit_step(const ImplicitSystem& system, const ImplicitPlan& plan, double step_s,
                   std::vector<Eigen::Vector3d>& positions_mm,
                   std::vector<Eigen::Vector3d>& velocities_mm_per_s);

}  // namespace palpate::simulation
