#pragma once

#include <map>
#include <string>
#include <vector>

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

namespace palpate::imaging {

/// A filter by its name on the command line and its parameters by theirs.
struct FilterStep {
  std::string name;                         ///< "median", "gaussian"
  std::map<std::string, double> parameters; ///< defaults are used for the absent
  bool operator==(const FilterStep& other) const { return name == other.name && parameters == other.parameters; }
};

struct FilterParameter {
  std::string name;   ///< "radius_voxels", "sigma_mm"
  std::string text;   ///< for people, with the unit
  double standard, min, max;
  bool whole_number;
};
struct FilterDescription {
  std::string name;
  std::string title;  ///< for the panel
  std::string text;
  std::vector<FilterParameter> parameters;
};
/// All filters there are: median (radius_voxels) and gaussian (sigma_mm).
const std::vector<FilterDescription>& filters();
/// "median:radius_voxels=2"; short names "radius", "sigma" are accepted.
/// Throws Error(usage) naming what is accepted.
FilterStep parse_filter(const std::string& text);
std::string to_string(const FilterStep& step);

/// Applies the steps in order; the geometry is kept. At the border the
/// outermost voxels are taken to go on. The Gaussian is the discrete one,
/// which takes any number of voxels and never overshoots. Long; reports progress
/// and stops through ITK's abort when cancelled. Throws Error(usage),
/// Error(cancelled).
core::Volume apply_filters(const core::Volume& volume, const std::vector<FilterStep>& chain,
                           const core::Progress& progress = {});

}  // namespace palpate::imaging
