#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "palpate/interaction/ray.hpp"
#include "palpate/model/tissue.hpp"

namespace palpate::interaction {

enum class SelectionKind {
  sphere,    ///< all points within the radius (thesis 3.4.1)
  fuzzy,     ///< alpha falls from 1 at the origin to 0 at the radius
  connected  ///< reached over links from the nearest point, while inside the radius
};
std::string to_string(SelectionKind kind);
SelectionKind selection_kind_from(const std::string& word);  ///< Error(usage)

/// Points and how much each is held.
struct Selection {
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();  ///< LPS, on the ray
  double distance_mm = 0.0;  ///< of the origin from the ray's start
  std::vector<std::uint32_t> points;
  std::vector<float> alphas;  ///< (0, 1], parallel to points
};

/// Positions as they are now, relative to center_mm.
struct PointsNow {
  const std::vector<Eigen::Vector3f>& positions_mm;
  const Eigen::Vector3d& center_mm;
};

/// Thesis 3.4.1: of the points inside the cone (cylinder) along the ray, in
/// front of the camera, the one whose projection on the ray is nearest; that
/// projection is the selection's origin. None where no point is inside.
struct Hit {
  Eigen::Vector3d origin_mm;
  double distance_mm;
  std::uint32_t point;
};
std::optional<Hit> pick(const Ray& ray, const PickReach& reach, const PointsNow& points);
Selection select(const Hit& hit, double radius_mm, SelectionKind kind, const PointsNow& points,
                 const model::Adjacency& adjacency);

/// A drag: where the selection's origin is for a new ray, at the same distance
/// from the camera (thesis: u + |s - u| v2). Under a parallel projection the
/// rays have the same direction and the depth is kept.
class MoveTool {
 public:
  MoveTool(Selection selection) : selection_(std::move(selection)), target_mm_(selection_.origin_mm) {}
  const Selection& selection() const noexcept { return selection_; }
  /// The new place of the origin.
  Eigen::Vector3d drag_to(const Ray& ray);
  const Eigen::Vector3d& target_mm() const noexcept { return target_mm_; }

 private:
  Selection selection_;
  Eigen::Vector3d target_mm_;
};

}  // namespace palpate::interaction
