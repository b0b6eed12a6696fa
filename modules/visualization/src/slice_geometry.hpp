#pragma once

#include "palpate/core/geometry.hpp"
#include "palpate/core/mesh.hpp"
#include "palpate/visualization/scene.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::visualization {

/// How a slice lies on the screen. All vectors are unit vectors in LPS;
/// right x up points to the viewer, whatever the image's handedness.
struct SliceFrame {
  int axis = 2;             ///< image axis that is stepped through
  int horizontal_axis = 0;  ///< image axis that runs along the screen
  int vertical_axis = 1;    ///< image axis that runs up or down the screen
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  Eigen::Vector3d toward = -Eigen::Vector3d::UnitZ();  ///< to the viewer, normal of the slice
};
SliceFrame slice_frame(const core::ImageGeometry& geometry, SlicePlane plane);

/// The plane whose slices step along image axis `axis`.
SlicePlane plane_of_axis(const core::ImageGeometry& geometry, int axis);

/// Index along `axis` of the slice that holds a place, inside the volume.
int slice_through(const core::ImageGeometry& geometry, int axis, const Eigen::Vector3d& lps_mm);
/// Middle of a slice.
Eigen::Vector3d slice_center_mm(const core::ImageGeometry& geometry, int axis, int slice);
/// Half the width and height of a slice on the screen, whole voxels counted.
Eigen::Vector2d slice_half_extent_mm(const core::ImageGeometry& geometry, const SliceFrame& frame);

/// Letters of the patient's side that a direction points to, the main one
/// first: "L", "LP"; a second one where it is more than 22.5 degrees off.
std::string side_letters(const Eigen::Vector3d& direction);

/// Where a surface passes through a plane: ends of line pieces, in pairs.
/// vertices: x y z of each vertex. Faces whose vertices do not exist are left out.
std::vector<Eigen::Vector3f> cut_by_plane(const float* vertices, std::size_t vertex_count,
                                          const std::vector<std::array<std::uint32_t, 3>>& triangles,
                                          const Eigen::Vector3d& origin_mm, const Eigen::Vector3d& normal);

/// The largest of 1, 2, 5 times a power of ten that is not above `largest` (> 0).
double nice_length(double largest);
/// "20 mm", "0.5 mm", "1 voxel", "20 voxels".
std::string length_text(double length, bool voxels);
/// Three digits, no trailing zeros: "255", "82.5", "0.031", "1024".
std::string short_number(double value);

}  // namespace palpate::visualization
