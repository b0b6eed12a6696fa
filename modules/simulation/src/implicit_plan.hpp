#pragma once

#include "palpate/model/tissue.hpp"
#include "palpate/simulation/parameters.hpp"

#include <Eigen/Core>

#include <vector>

namespace palpate::simulation {

/// How the linear system of an implicit step is solved (docs/adr/0012): a
/// fixed number of Chebyshev iterations, each
///   u+ = u + momentum (u - u-) + rate B^-1 (b - A u),  u = u- = 0 at first,
/// after which u = (1 - P(B^-1 A)) A^-1 b. All eigenvalues of B^-1 A lie in
/// (0, 1], where P lies in [-ripple, 1]; P(0) = 1 and P(1) = 0.
struct ImplicitPlan {
  struct Iteration {
    double momentum = 0.0;
    double rate = 1.0;
  };
  std::vector<Iteration> iterations;
  double ripple = 0.0;  ///< below 1/3: the step is stable whatever the number of iterations

  /// P, by the same recurrence.
  double error_at(double eigenvalue) const;
};

/// More iterations would bring slow motion nearer to the truth; the state at
/// rest and the stability do not depend on them.
constexpr int implicit_fewest_iterations = 2;
constexpr int implicit_most_iterations = 12;

/// As many iterations as it takes for P(1/spread) = 0, the place of a motion of
/// all points together, and all between to be within the ripple; no more than
/// `most`, with which P(1/spread) may be anything up to 1.
ImplicitPlan implicit_plan(double spread, int most = implicit_most_iterations);

/// At least the largest eigenvalue: with q the mean of the three and
/// 6 p^2 = |T - q I|^2 none is over q + 2 p.
double eigenvalue_bound(const Eigen::Matrix3d& matrix);

/// What the scale R of a step is made of in a tissue at rest, without its
/// parameters (docs/adr/0012-*.md).
struct ImplicitSpread {
  double stiffness = 0.0;  ///< omega^2 where k = m = 1
  double damping = 0.0;    ///< mu by the dampers where c = m = 1
  double drag = 0.0;       ///< mu by drag where D = m = 1
};
ImplicitSpread implicit_spread(const model::Tissue& tissue, const Material& material);
/// For these parameters and step: spread = 1 + h mu + h^2 omega^2.
ImplicitPlan implicit_plan(const ImplicitSpread& spread, const Parameters& parameters, double step_s);

}  // namespace palpate::simulation
