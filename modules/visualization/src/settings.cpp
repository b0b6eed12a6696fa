#include "palette.hpp"

#include "palpate/visualization/scene.hpp"

#include <algorithm>

namespace palpate::visualization {

ViewSettings standard_settings(const core::Volume& volume) {
  ViewSettings settings;
  if (volume.empty()) return settings;
  settings.crosshair_mm = volume.geometry().center_mm();
  double low = quantile(volume.data(), volume.size(), 0.005);
  double high = quantile(volume.data(), volume.size(), 0.995);
  if (!(high > low)) {  // nearly all voxels alike: what little there is must show
    low = volume.range().min;
    high = volume.range().max;
  }
  settings.window = high > low ? high - low : 1.0;
  settings.level = 0.5 * (low + high);
  return settings;
}

std::optional<Eigen::Vector3d> place_of(const SceneContent& content, std::uint32_t point) {
  if (!content.tissue || point >= content.tissue->points.size()) return std::nullopt;
  const model::PointCloud& points = content.tissue->points;
  if (!content.positions_mm || content.positions_mm->size() != points.size()) return points.lps_mm(point);
  return Eigen::Vector3d(points.center_mm + (*content.positions_mm)[point].cast<double>());
}

}  // namespace palpate::visualization
