#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

#include <map>
#include <string>
#include <vector>

namespace palpate::imaging {

/// A filter by its name on the command line and its parameters by theirs.
struct FilterStep {
  std::string name;                          ///< "median", "gaussian"
  std::map<std::string, double> parameters;  ///< defaults are used for the absent
  bool operator==(const FilterStep& other) const {
    return name == other.name && parameters == other.parameters;
  }
};

struct FilterParameter {
  std::string name;  ///< "radius_voxels", "sigma_mm"
  std::string text;  ///< for people, without the unit
  double standard, min, max;
  bool whole_number;
  std::string unit;  ///< "voxels", "mm", "%"; empty where there is none
};
struct FilterDescription {
  std::string name;
  std::string title;  ///< for the panel
  std::string text;
  std::vector<FilterParameter> parameters;
};
/// All filters there are, in the order in which a panel offers them.
const std::vector<FilterDescription>& filters();
/// "median:radius_voxels=2"; short names without the unit ("radius", "sigma")
/// are accepted. Throws Error(usage) naming what is accepted.
FilterStep parse_filter(const std::string& text);
std::string to_string(const FilterStep& step);

struct FilterOptions {
  /// Where a filter that has kernels runs them: as compute::open_device takes
  /// it; "reference" is the CPU twin, empty the default.
  std::string device;
};

struct FilteredVolume {
  core::Volume volume;
  std::vector<core::Warning> warnings;  ///< such as "time-step-clamped"; each said once
};

/// Applies the steps in order; the geometry is kept. At the border the
/// outermost voxels are taken to go on, and an axis of one voxel is left out,
/// so a picture is filtered as one. Long; reports progress and stops within a
/// second when cancelled. Throws Error(usage) before any work where a step does
/// not fit, Error(internal, "out-of-memory"), Error(device), Error(cancelled).
FilteredVolume apply_filters(const core::Volume& volume, const std::vector<FilterStep>& chain,
                             const FilterOptions& options = {}, const core::Progress& progress = {});

/// Slice `index` across `axis` (0..2) of what apply_filters would give, one
/// voxel thick at its place, from the slab of the volume that it depends on.
/// Exact for a chain of one; beyond that, a filter that measures its whole
/// input (the conductance of the diffusions, the noise of patch-denoise, the
/// range of bilateral) measures the slab instead, from the second step on.
/// Diffusions of more than 8 steps leave off what farther voxels add, which
/// stays below 0.1 % of the range. Throws as apply_filters.
core::Volume filter_slice(const core::Volume& volume, const std::vector<FilterStep>& chain, int axis,
                          int index, const FilterOptions& options = {}, const core::Progress& progress = {});

}  // namespace palpate::imaging
