#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/model/tissue.hpp"
#include "palpate/simulation/parameters.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate::simulation {

/// Where and with which links the step is asked for; the tissue at rest, whole
/// and alike everywhere, where left out.
struct StabilityCase {
  const std::vector<Eigen::Vector3f>* positions_mm = nullptr;  ///< relative to centre, one a point
  const std::vector<std::uint8_t>* link_alive = nullptr;       ///< one a link
  const Material* material = nullptr;
};

/// The largest stable step of the parameters' integrator (docs/physics.md).
struct StableStep {
  double step_s = 0.0;          ///< infinite when there is nothing stiff, or the scheme has no limit
  double omega_per_s = 0.0;     ///< fastest vibration, or its bound
  std::size_t worst_point = 0;  ///< the point that limits it
  double decay_per_s = 0.0;     ///< mu: fastest decay by dampers and drag, or its bound
  bool is_estimate = false;     ///< by the converged eigenvalue; else by the per-point bound
};

/// By the per-point bound, at once and safe:
/// omega^2 <= max_i (2/m_i) lambda_max(S_i), S_i = sum k (n n^T + max(0, 1 - L0/l)(I - n n^T)),
/// mu = max_i (2/m_i) lambda_max(sum c n n^T) + D; RK4: min(2.616/omega, 2.785/mu).
StableStep stable_step(const model::Tissue& tissue, const Parameters& parameters,
                       const StabilityCase& at = {});

/// By the largest eigenvalue, iterated until it is known to the stated margin:
/// 0.90 to 1.00 of the true limit. Takes some tens of passes over the links.
/// Throws Error(cancelled).
StableStep estimated_stable_step(const model::Tissue& tissue, const Parameters& parameters,
                                 const StabilityCase& at = {}, const core::Progress& progress = {});

/// The step that --step auto takes: the limit times 0.9, at most 0.02 s; 0.006 s
/// (the thesis' own) for a scheme without a limit.
double automatic_step_s(const StableStep& limit);

}  // namespace palpate::simulation
