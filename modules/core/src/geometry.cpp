#include "palpate/core/geometry.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/LU>

#include <cmath>
#include <sstream>

namespace palpate::core {

ImageGeometry::ImageGeometry(std::array<int, 3> dims, const Eigen::Vector3d& spacing_mm,
                             const Eigen::Vector3d& origin_mm, const Eigen::Matrix3d& direction)
    : dims_(dims), spacing_mm_(spacing_mm), origin_mm_(origin_mm), direction_(direction) {
  for (int axis = 0; axis < 3; ++axis) {
    if (dims_[axis] < 1)
      throw Error(ErrorKind::input, "bad-dims",
                  "The image has no voxels along axis " + std::to_string(axis) + ".");
    if (!(spacing_mm_[axis] > 0.0) || !std::isfinite(spacing_mm_[axis])) {
      std::ostringstream text;
      text << "The voxel spacing along axis " << axis << " is " << spacing_mm_[axis]
           << "; a positive number of millimetres is needed.";
      throw Error(ErrorKind::input, "bad-spacing", text.str());
    }
  }
  const double determinant = direction_.determinant();
  if (!direction_.allFinite() || !origin_mm_.allFinite() || !(std::abs(determinant) > 1e-6)) {
    std::ostringstream text;
    text << "The direction matrix (determinant " << determinant
         << ") or the origin of the image cannot be used.";
    throw Error(ErrorKind::input, "bad-direction", text.str());
  }
  ijk_to_lps_.setIdentity();
  ijk_to_lps_.topLeftCorner<3, 3>() = direction_ * spacing_mm_.asDiagonal();
  ijk_to_lps_.topRightCorner<3, 1>() = origin_mm_;
  lps_to_ijk_ = ijk_to_lps_.inverse();
}

std::size_t ImageGeometry::voxel_count() const noexcept {
  return static_cast<std::size_t>(dims_[0]) * static_cast<std::size_t>(dims_[1]) *
         static_cast<std::size_t>(dims_[2]);
}

std::size_t ImageGeometry::index(int i, int j, int k) const noexcept {
  return (static_cast<std::size_t>(k) * static_cast<std::size_t>(dims_[1]) + static_cast<std::size_t>(j)) *
             static_cast<std::size_t>(dims_[0]) +
         static_cast<std::size_t>(i);
}

std::array<int, 3> ImageGeometry::ijk_of(std::size_t index) const noexcept {
  const auto ni = static_cast<std::size_t>(dims_[0]);
  const auto nj = static_cast<std::size_t>(dims_[1]);
  return {static_cast<int>(index % ni), static_cast<int>(index / ni % nj),
          static_cast<int>(index / (ni * nj))};
}

bool ImageGeometry::contains(int i, int j, int k) const noexcept {
  return i >= 0 && j >= 0 && k >= 0 && i < dims_[0] && j < dims_[1] && k < dims_[2];
}

Eigen::Vector3d ImageGeometry::to_lps_mm(const Eigen::Vector3d& ijk) const {
  return ijk_to_lps_.topLeftCorner<3, 3>() * ijk + ijk_to_lps_.topRightCorner<3, 1>();
}

Eigen::Vector3d ImageGeometry::to_ijk(const Eigen::Vector3d& lps_mm) const {
  return lps_to_ijk_.topLeftCorner<3, 3>() * lps_mm + lps_to_ijk_.topRightCorner<3, 1>();
}

Eigen::Vector3d ImageGeometry::center_mm() const {
  return to_lps_mm(Eigen::Vector3d(dims_[0] - 1, dims_[1] - 1, dims_[2] - 1) * 0.5);
}

int ImageGeometry::axis_closest_to(int lps_axis) const {
  // Greedy on the largest remaining |cosine|, so that each axis is used once.
  Eigen::Matrix3d cosines = direction_.cwiseAbs();
  std::array<int, 3> image_axis_of{-1, -1, -1};
  for (int round = 0; round < 3; ++round) {
    Eigen::Index row = 0;
    Eigen::Index column = 0;
    cosines.maxCoeff(&row, &column);
    image_axis_of[static_cast<std::size_t>(row)] = static_cast<int>(column);
    cosines.row(row).setConstant(-1.0);
    cosines.col(column).setConstant(-1.0);
  }
  return image_axis_of[static_cast<std::size_t>(lps_axis)];
}

bool ImageGeometry::operator==(const ImageGeometry& other) const {
  return dims_ == other.dims_ && ijk_to_lps_ == other.ijk_to_lps_;
}

}  // namespace palpate::core
