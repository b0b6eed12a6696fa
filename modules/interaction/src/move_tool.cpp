#include "palpate/interaction/move_tool.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace palpate::interaction {
namespace {

constexpr double radians_per_degree = 3.14159265358979323846 / 180.0;

struct Word {
  SelectionKind kind;
  const char* text;
};
constexpr std::array<Word, 3> words{{{SelectionKind::sphere, "sphere"},
                                     {SelectionKind::fuzzy, "fuzzy"},
                                     {SelectionKind::connected, "connected"}}};

/// Points reached over links from the one nearest the origin, none of them
/// farther from it than the radius.
std::vector<std::uint32_t> connected_points(const std::vector<double>& distance_mm, double radius_mm,
                                            const model::Adjacency& adjacency) {
  std::vector<std::uint32_t> reached;
  // The first of equals, and never a point that is not a number.
  std::size_t start = distance_mm.size();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t point = 0; point < distance_mm.size(); ++point)
    if (distance_mm[point] < least) {
      least = distance_mm[point];
      start = point;
    }
  if (!(least <= radius_mm)) return reached;

  std::vector<bool> seen(distance_mm.size(), false);
  seen[start] = true;
  reached.push_back(static_cast<std::uint32_t>(start));
  for (std::size_t next = 0; next < reached.size(); ++next) {
    const std::uint32_t point = reached[next];
    for (std::uint32_t slot = adjacency.offsets[point]; slot < adjacency.offsets[point + 1]; ++slot) {
      const std::uint32_t other = adjacency.neighbours[slot];
      if (seen[other] || !(distance_mm[other] <= radius_mm)) continue;
      seen[other] = true;
      reached.push_back(other);
    }
  }
  std::sort(reached.begin(), reached.end());
  return reached;
}

}  // namespace

std::string to_string(SelectionKind kind) {
  for (const Word& word : words)
    if (word.kind == kind) return word.text;
  throw core::Error(core::ErrorKind::internal, "selection-kind", "A selection has no kind.");
}

SelectionKind selection_kind_from(const std::string& word) {
  for (const Word& known : words)
    if (word == known.text) return known.kind;
  if (word == "geodesic")
    core::throw_usage("The selection \"geodesic\" comes with a later version; use connected.");
  core::throw_usage("The selection \"" + word + "\" is unknown; use sphere, fuzzy or connected.");
}

std::optional<Hit> pick(const Ray& ray, const PickReach& reach, const PointsNow& points) {
  const Eigen::Vector3d start = ray.origin_mm - points.center_mm;
  const bool cylinder = reach.cylinder_radius_mm > 0.0;
  const double slope = cylinder ? 0.0 : std::tan(reach.cone_half_angle_deg * radians_per_degree);
  std::optional<Hit> hit;
  for (std::size_t point = 0; point < points.positions_mm.size(); ++point) {
    const Eigen::Vector3d there = points.positions_mm[point].cast<double>() - start;
    const double along = there.dot(ray.direction);
    if (!(along > 0.0) || (hit && along >= hit->distance_mm)) continue;
    const double width = cylinder ? reach.cylinder_radius_mm : along * slope;
    if (!(there.cross(ray.direction).squaredNorm() <= width * width)) continue;
    hit = Hit{ray.origin_mm + along * ray.direction, along, static_cast<std::uint32_t>(point)};
  }
  return hit;
}

Selection select(const Hit& hit, double radius_mm, SelectionKind kind, const PointsNow& points,
                 const model::Adjacency& adjacency) {
  if (!(radius_mm > 0.0) || !std::isfinite(radius_mm))
    core::throw_usage("The radius of a selection must be a positive number of millimetres.");
  Selection selection;
  selection.origin_mm = hit.origin_mm;
  selection.distance_mm = hit.distance_mm;

  const Eigen::Vector3d origin = hit.origin_mm - points.center_mm;
  std::vector<double> distance_mm(points.positions_mm.size());
  for (std::size_t point = 0; point < distance_mm.size(); ++point)
    distance_mm[point] = (points.positions_mm[point].cast<double>() - origin).norm();

  if (kind == SelectionKind::connected) {
    if (adjacency.offsets.size() != distance_mm.size() + 1)
      throw core::Error(core::ErrorKind::internal, "adjacency-size", "The links belong to other points.");
    selection.points = connected_points(distance_mm, radius_mm, adjacency);
    selection.alphas.assign(selection.points.size(), 1.0F);
    return selection;
  }
  for (std::size_t point = 0; point < distance_mm.size(); ++point) {
    if (!(distance_mm[point] <= radius_mm)) continue;
    const float alpha =
        kind == SelectionKind::fuzzy ? static_cast<float>(1.0 - distance_mm[point] / radius_mm) : 1.0F;
    if (alpha <= 0.0F) continue;
    selection.points.push_back(static_cast<std::uint32_t>(point));
    selection.alphas.push_back(alpha);
  }
  return selection;
}

Eigen::Vector3d MoveTool::drag_to(const Ray& ray) {
  // One formula for both projections: perspective rays share their start, and
  // parallel ones start in one plane, from which the distance is the depth.
  const Eigen::Vector3d target = ray.origin_mm + selection_.distance_mm * ray.direction;
  if (target.allFinite()) target_mm_ = target;
  return target_mm_;
}

}  // namespace palpate::interaction
