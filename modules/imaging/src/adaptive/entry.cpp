#include "../filter_registry.hpp"

#include "palpate/imaging/adaptive.hpp"

namespace palpate::imaging {
namespace {

AdaptiveParameters parameters_of(const FilterParameters& values) {
  AdaptiveParameters parameters;
  parameters.contrast_percent = values.at("contrast_percent");
  parameters.scale_voxels = values.at("scale_voxels");
  parameters.neighbourhood_scales = values.at("neighbourhood_scales");
  parameters.passes = static_cast<int>(values.at("passes"));
  return parameters;
}

FilterParameter parameter(const char* name, const char* text, double standard, AdaptiveLimits limits,
                          bool whole, const char* unit) {
  return {name, text, standard, limits.low, limits.high, whole, unit};
}

}  // namespace

FilterEntry adaptive_entry() {
  const AdaptiveParameters standard;
  FilterEntry entry;
  entry.description = {
      "adaptive",
      "Adaptive (speckle)",
      "Smooths speckle along walls and layers, not across them. The filter of Granlund and Knutsson.",
      {
          parameter(
              "contrast_percent",
              "Edges that are kept (their step, in % of the brightness around; weaker ones are smoothed)",
              standard.contrast_percent, adaptive_contrast_percent, false, "%"),
          parameter("scale_voxels", "Size of the speckle (in the finest voxel spacing)",
                    standard.scale_voxels, adaptive_scale_voxels, false, "voxels"),
          parameter("neighbourhood_scales",
                    "Neighbourhood (how far around a voxel its structure is judged, in sizes of the speckle)",
                    standard.neighbourhood_scales, adaptive_neighbourhood_scales, false, ""),
          parameter("passes", "Passes (how often the filter runs over its own result)", standard.passes,
                    adaptive_passes, true, ""),
      }};
  entry.apply = [](const FilterCall& call) {
    if (adaptive_lacks_device(call.options.device))
      call.warnings.push_back(
          {"no-device",
           "There is no OpenCL device: the adaptive filter ran on its slower reference, "
           "with the same result. On Debian pocl-opencl-icd makes a device of the processor."});
    core::IntensityRange scan;
    scan.min = static_cast<float>(call.measured[0]);
    scan.max = static_cast<float>(call.measured[1]);
    return adaptive_filter(call.volume, parameters_of(call.parameters), scan, call.options.device,
                           call.progress);
  };
  entry.reach = [](const core::ImageGeometry& geometry, const FilterParameters& values) {
    return adaptive_reach(geometry, parameters_of(values));
  };
  entry.measure = [](const core::Volume& volume, const FilterParameters&, const core::Progress&) {
    return std::vector<double>{volume.range().min, volume.range().max};
  };
  entry.bytes_per_voxel = 12.0;
  return entry;
}

}  // namespace palpate::imaging
