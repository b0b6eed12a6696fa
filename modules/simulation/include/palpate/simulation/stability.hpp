#pragma once

#include "palpate/model/tissue.hpp"
#include "palpate/simulation/parameters.hpp"

#include <cstddef>
#include <vector>

namespace palpate::simulation {

/// The largest stable step by the per-point bound (docs/physics.md):
/// omega^2 <= max_i 2 lambda_max(S_i), S_i = sum k (n n^T + max(0, 1 - L0/l)(I - n n^T)),
/// mu = max_i 2 lambda_max(sum c n n^T) + D; RK4: min(2.616/omega, 2.785/mu).
struct StableStep {
  double step_s = 0.0;  ///< infinite when there is nothing stiff
  double omega_per_s = 0.0;
  std::size_t worst_point = 0;  ///< the point that limits it
};
/// At the tissue's rest place.
StableStep stable_step(const model::Tissue& tissue, const Parameters& parameters);
/// At a deformed place; positions as in model::PointCloud (relative to centre).
StableStep stable_step(const model::Tissue& tissue, const std::vector<Eigen::Vector3f>& positions_mm,
                       const Parameters& parameters);

/// The step that --step auto takes: the bound times 0.9, at most 0.02 s.
double automatic_step_s(const StableStep& bound);

}  // namespace palpate::simulation
