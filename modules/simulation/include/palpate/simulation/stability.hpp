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
/// mu = max_i (2/m_i) lambda_max(sum c n n^T) + D/m; the step is the smallest limit of any mode
/// that those, the links' c/k and the points' drag allow. While the tissue beats, the
/// shortest rest lengths count. Anchors and held points are left out: they only slow modes down.
/// Explicit Euler: 0 where nothing damps; stretching is not seen (see automatic_step_s).
StableStep stable_step(const model::Tissue& tissue, const Parameters& parameters,
                       const StabilityCase& at = {});

/// By the largest eigenvalue, iterated until it is known to the stated margin: omega is
/// above the true one by at most 1.3 %, so that the step is 0.90 to 1.00 of the true limit.
/// Takes some tens of passes over the links. The same with any number of cores. `mode`:
/// the vector of an earlier call, which shortens the next; empty at first, replaced.
/// Throws Error(cancelled).
StableStep estimated_stable_step(const model::Tissue& tissue, const Parameters& parameters,
                                 const StabilityCase& at = {}, const core::Progress& progress = {},
                                 std::vector<float>* mode = nullptr);

/// The step that --step auto takes: the limit times 0.9, at most 0.02 s; 0.006 s
/// (the thesis' own) for a scheme without a limit. Throws Error(usage) where no
/// step is stable (explicit Euler without damping).
double automatic_step_s(const StableStep& limit);

}  // namespace palpate::simulation
