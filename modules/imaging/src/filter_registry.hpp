#pragma once

#include "palpate/imaging/filters.hpp"

#include <array>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace palpate::imaging {

/// Full names, defaults filled in, values within their ranges.
using FilterParameters = std::map<std::string, double>;

/// One run of one filter.
struct FilterCall {
  const core::Volume& volume;
  const FilterParameters& parameters;
  const FilterOptions& options;
  const std::vector<double>& measured;  ///< what `measure` gave, of the whole input
  std::vector<core::Warning>& warnings;
  const core::Progress& progress;

  double parameter(const std::string& name) const { return parameters.at(name); }
  int whole(const std::string& name) const { return static_cast<int>(parameters.at(name)); }
};

/// A filter: to add one, write these and name it in filter_entries().
struct FilterEntry {
  FilterDescription description;
  /// Keeps the geometry. Must work on 1-voxel axes and on volumes smaller than its reach.
  std::function<core::Volume(const FilterCall&)> apply;
  /// How many voxels away along i, j and k the farthest lies that a voxel depends on.
  std::function<std::array<int, 3>(const core::ImageGeometry&, const FilterParameters&)> reach;
  /// Optional: numbers that depend on the whole volume, so that a slab of it
  /// is filtered as the whole is.
  std::function<std::vector<double>(const core::Volume&, const FilterParameters&, const core::Progress&)>
      measure;
  /// Host memory that a run takes for each voxel, its result included.
  double bytes_per_voxel = 8.0;
};

/// All of them, in the order of filters().
const std::vector<FilterEntry>& filter_entries();

FilterEntry median_entry();
FilterEntry mean_entry();
FilterEntry gaussian_entry();
FilterEntry bilateral_entry();
FilterEntry gradient_diffusion_entry();
FilterEntry curvature_diffusion_entry();
FilterEntry curvature_flow_entry();
FilterEntry patch_denoise_entry();
FilterEntry adaptive_entry();

/// Over the axes that have more than one voxel.
double smallest_spacing_mm(const core::ImageGeometry& geometry);

}  // namespace palpate::imaging
