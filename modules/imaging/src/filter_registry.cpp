#include "filter_registry.hpp"

#include <algorithm>
#include <cstddef>

namespace palpate::imaging {

const std::vector<FilterEntry>& filter_entries() {
  static const std::vector<FilterEntry> all{
      median_entry(),
      mean_entry(),
      gaussian_entry(),
      bilateral_entry(),
      gradient_diffusion_entry(),
      curvature_diffusion_entry(),
      curvature_flow_entry(),
      patch_denoise_entry(),
      adaptive_entry(),
  };
  return all;
}

const std::vector<FilterDescription>& filters() {
  static const std::vector<FilterDescription> all = [] {
    std::vector<FilterDescription> descriptions;
    for (const auto& entry : filter_entries()) descriptions.push_back(entry.description);
    return descriptions;
  }();
  return all;
}

double smallest_spacing_mm(const core::ImageGeometry& geometry) {
  double smallest = geometry.spacing_mm().maxCoeff();
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (geometry.dims()[axis] > 1)
      smallest = std::min(smallest, geometry.spacing_mm()[static_cast<Eigen::Index>(axis)]);
  return smallest;
}

}  // namespace palpate::imaging
