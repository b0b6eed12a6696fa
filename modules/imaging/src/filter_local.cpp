#include "filter_registry.hpp"
#include "parallel_parts.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

// Mean and bilateral: one pass over a block around each voxel. Not ITK's: its
// bilateral looks the weights up in a table of 100 and answers a request to
// stop late; its mean sums in the order of its neighbourhood, in float.

namespace palpate::imaging {
namespace {

std::array<int, 3> block_reach(const core::ImageGeometry& geometry, const FilterParameters& parameters) {
  std::array<int, 3> reach{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    reach[axis] = geometry.dims()[axis] == 1 ? 0 : static_cast<int>(parameters.at("radius_voxels"));
  return reach;
}

/// Row (j, k) with places outside taken from the border.
const float* row_at(const core::Volume& volume, int j, int k) {
  const auto& dims = volume.dims();
  return volume.data() +
         volume.geometry().index(0, std::clamp(j, 0, dims[1] - 1), std::clamp(k, 0, dims[2] - 1));
}

core::Volume mean(const FilterCall& call) {
  const core::Volume& volume = call.volume;
  const auto reach = block_reach(volume.geometry(), call.parameters);
  const int width = volume.dims()[0];
  const double count = (2.0 * reach[0] + 1.0) * (2.0 * reach[1] + 1.0) * (2.0 * reach[2] + 1.0);
  std::vector<float> voxels(volume.size());
  for_each_row(volume.geometry(), call.progress, "Mean filter", [&](int j, int k) {
    std::vector<double> columns(static_cast<std::size_t>(width), 0.0);
    for (int dk = -reach[2]; dk <= reach[2]; ++dk)
      for (int dj = -reach[1]; dj <= reach[1]; ++dj) {
        const float* const row = row_at(volume, j + dj, k + dk);
        for (int i = 0; i < width; ++i) columns[static_cast<std::size_t>(i)] += row[i];
      }
    float* const out = voxels.data() + volume.geometry().index(0, j, k);
    for (int i = 0; i < width; ++i) {
      double sum = 0.0;
      for (int di = -reach[0]; di <= reach[0]; ++di)
        sum += columns[static_cast<std::size_t>(std::clamp(i + di, 0, width - 1))];
      out[i] = static_cast<float>(sum / count);
    }
  });
  return {volume.geometry(), std::move(voxels)};
}

struct Neighbour {
  int di, dj, dk;
  float weight;
};
/// The block, and how much each place in it counts by its distance in mm.
std::vector<Neighbour> neighbours(const core::ImageGeometry& geometry, const std::array<int, 3>& reach,
                                  double sigma_mm) {
  std::vector<Neighbour> all;
  const Eigen::Vector3d spacing = geometry.spacing_mm();
  for (int dk = -reach[2]; dk <= reach[2]; ++dk)
    for (int dj = -reach[1]; dj <= reach[1]; ++dj)
      for (int di = -reach[0]; di <= reach[0]; ++di) {
        const double distance_mm = Eigen::Vector3d(di, dj, dk).cwiseProduct(spacing).norm();
        const double weight = std::exp(-0.5 * distance_mm * distance_mm / (sigma_mm * sigma_mm));
        // Less than a float can tell from nothing beside the voxel's own weight of one.
        if (weight > 1e-8) all.push_back({di, dj, dk, static_cast<float>(weight)});
      }
  return all;
}

core::Volume bilateral(const FilterCall& call) {
  const core::Volume& volume = call.volume;
  const double range = call.measured.front() * call.parameter("range_percent") / 100.0;
  if (!(range > 0.0)) return volume;  // one value everywhere
  const double sigma_mm = 0.5 * call.parameter("radius_voxels") * smallest_spacing_mm(volume.geometry());
  const auto block = neighbours(volume.geometry(), block_reach(volume.geometry(), call.parameters), sigma_mm);
  const int width = volume.dims()[0];
  const auto factor = static_cast<float>(-0.5 / (range * range));
  std::vector<float> voxels(volume.size());
  for_each_row(volume.geometry(), call.progress, "Bilateral filter", [&](int j, int k) {
    const float* const centre = row_at(volume, j, k);
    std::vector<double> sum(static_cast<std::size_t>(width), 0.0);
    std::vector<double> weights(static_cast<std::size_t>(width), 0.0);
    for (const Neighbour& place : block) {
      if (call.progress.cancel().cancelled()) return;
      const float* const row = row_at(volume, j + place.dj, k + place.dk);
      for (int i = 0; i < width; ++i) {
        const float value = row[std::clamp(i + place.di, 0, width - 1)];
        const float difference = value - centre[i];
        const float weight = place.weight * std::exp(factor * difference * difference);
        sum[static_cast<std::size_t>(i)] += static_cast<double>(weight) * value;
        weights[static_cast<std::size_t>(i)] += weight;
      }
    }
    float* const out = voxels.data() + volume.geometry().index(0, j, k);
    for (std::size_t i = 0; i < sum.size(); ++i) out[i] = static_cast<float>(sum[i] / weights[i]);
  });
  return {volume.geometry(), std::move(voxels)};
}

std::vector<double> measure_range(const core::Volume& volume, const FilterParameters&,
                                  const core::Progress&) {
  return {static_cast<double>(volume.range().max) - volume.range().min};
}

}  // namespace

FilterEntry mean_entry() {
  return {{"mean",
           "Mean",
           "Takes the average of a block of voxels: smooths quickly, blurs edges.",
           {{"radius_voxels", "Radius of the block", 1.0, 1.0, 8.0, true, "voxels"}}},
          mean,
          block_reach,
          {},
          4.0};
}

FilterEntry bilateral_entry() {
  return {{"bilateral",
           "Bilateral",
           "Averages near voxels that are about as bright: smooths, and keeps strong edges.",
           {{"radius_voxels", "Radius of the block", 2.0, 1.0, 8.0, true, "voxels"},
            {"range_percent", "Brightness that counts as alike", 10.0, 0.1, 100.0, false, "%"}}},
          bilateral,
          block_reach,
          measure_range,
          4.0};
}

}  // namespace palpate::imaging
