#pragma once

#include "palpate/model/tissue.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace palpate::session {

/// One touch of the anchor brush, by where the tissue lies at rest: it means
/// the same points in every run, and the same region in tissue built anew.
struct AnchorDab {
  Eigen::Vector3d place_mm = Eigen::Vector3d::Zero();  ///< LPS
  double radius_mm = 5.0;
  bool frees = false;  ///< takes anchors away
};
bool operator==(const AnchorDab& a, const AnchorDab& b);

/// `anchors` with the dabs laid over them in their order; sorted, no point twice.
std::vector<std::uint32_t> paint_anchors(const std::vector<std::uint32_t>& anchors,
                                         const model::PointCloud& points, const std::vector<AnchorDab>& dabs);

}  // namespace palpate::session
