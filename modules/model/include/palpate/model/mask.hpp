#pragma once

#include "palpate/core/volume.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>

namespace palpate::model {

/// A label image looked up by the voxels of another image: each takes the
/// label of the nearest voxel, by their places in LPS. What lies outside the
/// label image, by more than half of one of its voxels, has no label.
class MaskLookup {
 public:
  /// With a label, what rounds to it is held; without, whatever is not 0.
  /// What is not finite is never held. Throws Error(usage) without voxels.
  MaskLookup(const core::Volume& mask, std::optional<int> label, const core::ImageGeometry& target);

  bool holds(const std::array<int, 3>& voxel) const noexcept;
  const core::Volume& mask() const noexcept { return mask_; }
  std::optional<int> label() const noexcept { return label_; }
  /// Whether the voxel lies in the label image at all.
  bool reaches(const std::array<int, 3>& voxel) const noexcept { return value_at(voxel) != nullptr; }

 private:
  const float* value_at(const std::array<int, 3>& voxel) const noexcept;

  core::Volume mask_;
  std::optional<int> label_;
  Eigen::Matrix4d to_mask_;  ///< voxels of the target to voxels of the mask
};

}  // namespace palpate::model
