#pragma once

#include "palpate/core/geometry.hpp"
#include "palpate/core/progress.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::imaging::reading {

/// Where the voxels of a fan that sweeps about an axis are. A ray of fan angle
/// a at radius r reaches f = r cos(a) forward of the apex; swept by b about the
/// line y = 0, z = axis_mm it comes to
///   x = r sin(a),  y = -(f - axis_mm) sin(b),  z = axis_mm + (f - axis_mm) cos(b):
/// lateral, elevation, depth in mm. Voxels: radius fastest, then fan, then sweep.
struct SweptFan {
  double first_mm = 0.0, step_mm = 1.0;  ///< radius of the first voxel, and on
  double axis_mm = 0.0;
  int radial = 0;
  std::vector<double> fan, sweep;  ///< angles in rad from straight ahead, each rising or falling

  Eigen::Vector3d place(double radius_mm, double fan_angle, double sweep_angle) const;
  /// Voxel coordinates (radius, fan, sweep) of a point; outside the swept
  /// volume one of them is negative.
  Eigen::Vector3d voxel_at(const Eigen::Vector3d& place_mm) const;
  /// Corners of the box around all voxels.
  std::array<Eigen::Vector3d, 2> bounds() const;
};

/// A grid of cubes over the whole fan.
core::ImageGeometry cartesian_grid(const SweptFan& fan, double spacing_mm);

/// Fills the grid by trilinear interpolation; 0 outside the fan.
void scan_convert(const SweptFan& fan, const std::uint8_t* voxels, const core::ImageGeometry& grid,
                  float* out, const core::Progress& progress);

}  // namespace palpate::imaging::reading
