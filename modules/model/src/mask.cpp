#include "palpate/model/mask.hpp"

#include "palpate/core/error.hpp"

#include <cmath>

namespace palpate::model {

MaskLookup::MaskLookup(const core::Volume& mask, std::optional<int> label, const core::ImageGeometry& target)
    : mask_(mask), label_(label), to_mask_(Eigen::Matrix4d::Identity()) {
  if (mask_.empty()) core::throw_usage("The label image holds no voxels.");
  if (!(mask_.geometry() == target)) to_mask_ = mask_.geometry().lps_mm_to_ijk() * target.ijk_to_lps_mm();
}

const float* MaskLookup::value_at(const std::array<int, 3>& voxel) const noexcept {
  const Eigen::Vector4d ijk = to_mask_ * Eigen::Vector4d(voxel[0], voxel[1], voxel[2], 1.0);
  std::array<int, 3> nearest{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = std::floor(ijk[static_cast<Eigen::Index>(axis)] + 0.5);
    if (!(at >= 0.0 && at < mask_.dims()[axis])) return nullptr;
    nearest[axis] = static_cast<int>(at);
  }
  return mask_.data() + mask_.geometry().index(nearest[0], nearest[1], nearest[2]);
}

bool MaskLookup::holds(const std::array<int, 3>& voxel) const noexcept {
  const float* value = value_at(voxel);
  if (value == nullptr || !std::isfinite(*value)) return false;
  return label_ ? std::floor(static_cast<double>(*value) + 0.5) == static_cast<double>(*label_)
                : *value != 0.0F;
}

}  // namespace palpate::model
