#pragma once

#include "palpate/model/tissue.hpp"
#include "palpate/simulation/parameters.hpp"

namespace palpate::simulation {

/// How far gravity stretches tissue that hangs from its anchors or stands on
/// them: an estimate for warnings (docs/physics.md, "Sag"). For a column it is
/// right to a factor of two; what is held at a corner bends and folds besides.
struct Sag {
  double strain = 0.0;            ///< of the links at the anchors, along gravity; infinite where none carries
  double sag_mm = 0.0;            ///< of the far end
  double stiffness_per_s2 = 0.0;  ///< at least needed for a strain of a fifth, rounded up to one digit
  /// No longer the small strains that the estimate is for, and no shape that anyone wants.
  bool is_too_soft() const noexcept { return strain > 2.0 / 3.0; }
};
/// All zero without gravity, without anchors and where all is anchored.
Sag sag_under_gravity(const model::Tissue& tissue, const std::vector<std::uint32_t>& anchors,
                      const Parameters& parameters);

}  // namespace palpate::simulation
