#pragma once

#include "palpate/core/mesh.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/session/recipe.hpp"
#include "palpate/simulation/stability.hpp"
#include "palpate/surface/binding.hpp"

#include <memory>
#include <optional>
#include <string>

namespace palpate::session {

/// What the tissue hop makes: everything the simulation and the views need.
struct BuiltTissue {
  std::shared_ptr<const model::Tissue> tissue;
  model::TissueStatistics statistics;
  simulation::StableStep stable_step;
  simulation::Material material;  ///< factors and anchors by the recipe's settings
  /// That was used; for a mask without a threshold, the tissue's least intensity.
  double threshold_low = 0.0;
  std::shared_ptr<const core::Volume> mask;  ///< as it was used; null without one
  /// For people: "no-anchors", "all-anchored", "labels-placed".
  std::vector<core::Warning> warnings;
  double build_s = 0.0;  ///< points and links
};
struct BoundSurface {
  std::shared_ptr<const core::TriangleMesh> mesh;  ///< null where unmapped
  std::shared_ptr<const surface::SurfaceBinding> binding;
  std::string space_reason;  ///< axes of a loaded mesh and why: "LPS, assumed"
};
struct Estimate {
  model::TissueEstimate tissue;
  simulation::StableStep stable_step;  ///< of the sample
  double threshold_low = 0.0;
  std::vector<core::Warning> warnings;
};

/// The hops of docs/house.md in their order; each a function of values. The
/// command line and the window call the same.
core::VolumeSequence read_input(const InputSettings& input, const core::Progress& progress = {});
imaging::FilteredVolume filter_volume(const core::Volume& volume,
                                      const std::vector<imaging::FilterStep>& chain,
                                      const imaging::FilterOptions& options = {},
                                      const core::Progress& progress = {});
Estimate estimate_tissue(const core::Volume& filtered, const Recipe& recipe,
                         const core::Progress& progress = {});
BuiltTissue build_tissue(const core::Volume& filtered, const Recipe& recipe,
                         const core::Progress& progress = {});
/// The material of a tissue by the settings; reads the anchors' file.
/// Factors are 0.5 + (I - Imin)/(Imax - Imin) over the tissue's intensities.
/// The border is the first and the last plane of points along each axis, or
/// without a lattice a layer as thick; an axis with fewer than three planes has
/// none. Throws Error(input) where the file cannot be read, "anchors-outside"
/// where none of its labels meets tissue.
simulation::Material material_of(const model::Tissue& tissue, const SimulationSettings& settings,
                                 const core::Progress& progress = {});
BoundSurface build_surface(const core::Volume& filtered, const BuiltTissue& tissue, const Recipe& recipe,
                           const core::Progress& progress = {});

}  // namespace palpate::session
