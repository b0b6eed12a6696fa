#pragma once

#include "palpate/model/tissue.hpp"
#include "palpate/simulation/parameters.hpp"

namespace palpate::simulation {

/// How far gravity stretches what hangs below its anchors or stands above them:
/// an estimate for warnings, to about a factor of two (docs/physics.md, "Sag").
/// Tissue beside anchors is taken to be held by them.
struct Sag {
  double height_mm = 0.0;  ///< of what hangs or stands, along gravity; the higher of both
  double sag_mm = 0.0;     ///< of its far end; infinite where k = 0
  double stiffness_per_s2 =
      0.0;  ///< that keeps the sag within a tenth of the height, rounded up to one digit
  /// More than a third of the height: no longer the small strains that the estimate is for, and no tissue.
  bool is_too_soft() const noexcept { return sag_mm > height_mm / 3.0; }
};
/// All zero without gravity, links or anchors.
Sag sag_under_gravity(const model::Tissue& tissue, const model::TissueStatistics& statistics,
                      const std::vector<std::uint32_t>& anchors, const Parameters& parameters);

}  // namespace palpate::simulation
