#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>

namespace palpate::core {

/// Where the voxels of an image are. One matrix serves slices, points and
/// surface alike: column c of `ijk_to_lps_mm` is direction c times spacing c,
/// the last column the centre of voxel (0,0,0). LPS, millimetres.
/// Voxel centres are at whole ijk; the voxel's cell reaches from -0.5 to +0.5.
class ImageGeometry {
 public:
  ImageGeometry() = default;
  /// dims: voxels along i, j, k, each >= 1. spacing_mm > 0. direction: columns
  /// are the unit vectors of i, j, k in LPS; must be invertible.
  /// Throws Error(input) when one of these does not hold.
  ImageGeometry(std::array<int, 3> dims, const Eigen::Vector3d& spacing_mm, const Eigen::Vector3d& origin_mm,
                const Eigen::Matrix3d& direction = Eigen::Matrix3d::Identity());

  const std::array<int, 3>& dims() const noexcept { return dims_; }
  const Eigen::Vector3d& spacing_mm() const noexcept { return spacing_mm_; }
  const Eigen::Vector3d& origin_mm() const noexcept { return origin_mm_; }
  const Eigen::Matrix3d& direction() const noexcept { return direction_; }
  const Eigen::Matrix4d& ijk_to_lps_mm() const noexcept { return ijk_to_lps_; }
  const Eigen::Matrix4d& lps_mm_to_ijk() const noexcept { return lps_to_ijk_; }

  std::size_t voxel_count() const noexcept;
  /// i fastest.
  std::size_t index(int i, int j, int k) const noexcept;
  std::array<int, 3> ijk_of(std::size_t index) const noexcept;
  bool contains(int i, int j, int k) const noexcept;

  Eigen::Vector3d to_lps_mm(const Eigen::Vector3d& ijk) const;
  Eigen::Vector3d to_ijk(const Eigen::Vector3d& lps_mm) const;
  /// Centre of the box of voxel centres.
  Eigen::Vector3d center_mm() const;
  /// Image axis (0..2) whose direction lies closest to LPS axis `lps_axis`;
  /// each image axis is given to exactly one LPS axis.
  int axis_closest_to(int lps_axis) const;

  bool operator==(const ImageGeometry& other) const;

 private:
  std::array<int, 3> dims_{1, 1, 1};
  Eigen::Vector3d spacing_mm_ = Eigen::Vector3d::Ones();
  Eigen::Vector3d origin_mm_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d direction_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix4d ijk_to_lps_ = Eigen::Matrix4d::Identity();
  Eigen::Matrix4d lps_to_ijk_ = Eigen::Matrix4d::Identity();
};

}  // namespace palpate::core
