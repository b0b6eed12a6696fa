#pragma once

#include "palpate/core/volume.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <random>
#include <vector>

namespace palpate::testing {

/// A volume of 0 with 100 wherever `inside(i, j, k)`.
template <typename Inside>
core::Volume shape(std::array<int, 3> dims, const Eigen::Vector3d& spacing_mm, const Inside& inside,
                   const Eigen::Matrix3d& direction = Eigen::Matrix3d::Identity()) {
  const core::ImageGeometry geometry(dims, spacing_mm, {-3.0, 5.0, 7.0}, direction);
  std::vector<float> voxels;
  voxels.reserve(geometry.voxel_count());
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j)
      for (int i = 0; i < dims[0]; ++i) voxels.push_back(inside(i, j, k) ? 100.0F : 0.0F);
  return core::Volume(geometry, std::move(voxels));
}

inline core::Volume full_box(int edge, const Eigen::Vector3d& spacing_mm = Eigen::Vector3d::Ones()) {
  return shape({edge, edge, edge}, spacing_mm, [](int, int, int) { return true; });
}

/// Each voxel is tissue with the given probability.
inline core::Volume sponge(std::array<int, 3> dims, const Eigen::Vector3d& spacing_mm, double density,
                           unsigned seed) {
  std::mt19937 engine(seed);
  return shape(dims, spacing_mm, [&](int, int, int) { return (engine() >> 8U) < density * 16777216.0; });
}

/// The wall of an ellipsoid that fills the volume, like a ventricle's.
inline core::Volume shell(std::array<int, 3> dims, const Eigen::Vector3d& spacing_mm, double inner = 0.7) {
  return shape(dims, spacing_mm, [&](int i, int j, int k) {
    const Eigen::Vector3d at((i + 0.5) / dims[0] - 0.5, (j + 0.5) / dims[1] - 0.5, (k + 0.5) / dims[2] - 0.5);
    const double radius = 2.0 * at.norm();
    return radius < 0.98 && radius > inner;
  });
}

}  // namespace palpate::testing
