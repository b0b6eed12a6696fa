#include "slice_geometry.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace palpate::visualization {
namespace {

/// The anatomical view: which LPS axis is stepped, where the eye looks, and
/// which way is up on the screen.
struct Convention {
  int normal_axis;
  Eigen::Vector3d look;
  int up_axis;
  Eigen::Vector3d up;
};

Convention convention_of(SlicePlane plane) {
  switch (plane) {
    case SlicePlane::axial:  // from the feet, front up
      return {2, Eigen::Vector3d::UnitZ(), 1, -Eigen::Vector3d::UnitY()};
    case SlicePlane::coronal:  // from the front, head up
      return {1, Eigen::Vector3d::UnitY(), 2, Eigen::Vector3d::UnitZ()};
    case SlicePlane::sagittal:  // from the left, head up
      break;
  }
  return {0, -Eigen::Vector3d::UnitX(), 2, Eigen::Vector3d::UnitZ()};
}

Eigen::Vector3d column(const core::ImageGeometry& geometry, int axis) {
  return geometry.ijk_to_lps_mm().block<3, 1>(0, axis);
}

Eigen::Vector3d along(const Eigen::Vector3d& vector, const Eigen::Vector3d& wanted) {
  return vector.dot(wanted) < 0.0 ? Eigen::Vector3d(-vector) : vector;
}

}  // namespace

SliceFrame slice_frame(const core::ImageGeometry& geometry, SlicePlane plane) {
  const Convention convention = convention_of(plane);
  SliceFrame frame;
  frame.axis = geometry.axis_closest_to(convention.normal_axis);
  frame.vertical_axis = geometry.axis_closest_to(convention.up_axis);
  frame.horizontal_axis = 3 - frame.axis - frame.vertical_axis;
  // The normal is that of the voxels' plane, not the stepped axis: they differ
  // in a sheared image.
  const Eigen::Vector3d normal =
      column(geometry, frame.horizontal_axis).cross(column(geometry, frame.vertical_axis)).normalized();
  const Eigen::Vector3d look = along(normal, convention.look);
  frame.toward = -look;
  frame.up = along(column(geometry, frame.vertical_axis).normalized(), convention.up);
  frame.right = look.cross(frame.up).normalized();
  return frame;
}

SlicePlane plane_of_axis(const core::ImageGeometry& geometry, int axis) {
  if (geometry.axis_closest_to(2) == axis) return SlicePlane::axial;
  return geometry.axis_closest_to(1) == axis ? SlicePlane::coronal : SlicePlane::sagittal;
}

int slice_through(const core::ImageGeometry& geometry, int axis, const Eigen::Vector3d& lps_mm) {
  const int last = geometry.dims()[static_cast<std::size_t>(axis)] - 1;
  const double place = geometry.to_ijk(lps_mm)[axis];
  if (!(place > 0.0)) return 0;  // also for a place that is not finite
  return static_cast<int>(std::lround(std::min(place, static_cast<double>(last))));
}

Eigen::Vector3d slice_center_mm(const core::ImageGeometry& geometry, int axis, int slice) {
  const auto& dims = geometry.dims();
  Eigen::Vector3d ijk = Eigen::Vector3d(dims[0] - 1, dims[1] - 1, dims[2] - 1) * 0.5;
  ijk[axis] = slice;
  return geometry.to_lps_mm(ijk);
}

Eigen::Vector2d slice_half_extent_mm(const core::ImageGeometry& geometry, const SliceFrame& frame) {
  Eigen::Vector2d half = Eigen::Vector2d::Zero();
  for (const int axis : {frame.horizontal_axis, frame.vertical_axis}) {
    const Eigen::Vector3d side = column(geometry, axis) * geometry.dims()[static_cast<std::size_t>(axis)];
    half += 0.5 * Eigen::Vector2d(std::abs(side.dot(frame.right)), std::abs(side.dot(frame.up)));
  }
  return half;
}

std::string side_letters(const Eigen::Vector3d& direction) {
  constexpr const char* negative = "RAI";
  constexpr const char* positive = "LPS";
  const Eigen::Vector3d unit = direction.normalized();
  std::array<int, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return std::abs(unit[a]) > std::abs(unit[b]) + 1e-9; });
  std::string letters;
  for (const int axis : order) {
    const bool needed = letters.empty() || (letters.size() < 2 && std::abs(unit[axis]) > std::sin(0.3927));
    if (needed) letters += unit[axis] < 0.0 ? negative[axis] : positive[axis];
  }
  return letters;
}

std::vector<Eigen::Vector3f> cut_by_plane(const float* vertices, std::size_t vertex_count,
                                          const std::vector<std::array<std::uint32_t, 3>>& triangles,
                                          const Eigen::Vector3d& origin_mm, const Eigen::Vector3d& normal) {
  const Eigen::Vector3f n = normal.cast<float>();
  const auto offset = static_cast<float>(normal.dot(origin_mm));
  std::vector<float> heights(vertex_count);
  for (std::size_t v = 0; v < vertex_count; ++v)
    heights[v] = vertices[3 * v] * n[0] + vertices[3 * v + 1] * n[1] + vertices[3 * v + 2] * n[2] - offset;
  std::vector<Eigen::Vector3f> ends;
  for (const auto& triangle : triangles) {
    if (triangle[0] >= vertex_count || triangle[1] >= vertex_count || triangle[2] >= vertex_count) continue;
    // A vertex on the plane counts as above it, so each crossed face gives one piece.
    const bool above[3] = {heights[triangle[0]] >= 0.0F, heights[triangle[1]] >= 0.0F,
                           heights[triangle[2]] >= 0.0F};
    if (above[0] == above[1] && above[1] == above[2]) continue;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::size_t next = (corner + 1) % 3;
      if (above[corner] == above[next]) continue;
      const std::size_t a = triangle[corner];
      const std::size_t b = triangle[next];
      const float t = heights[a] / (heights[a] - heights[b]);
      const Eigen::Map<const Eigen::Vector3f> from(vertices + 3 * a);
      const Eigen::Map<const Eigen::Vector3f> to(vertices + 3 * b);
      ends.emplace_back(from + t * (to - from));
    }
  }
  return ends;
}

double nice_length(double largest) {
  const double power = std::pow(10.0, std::floor(std::log10(largest) + 1e-9));
  for (const double step : {5.0, 2.0})
    if (step * power <= largest * (1.0 + 1e-9)) return step * power;
  return power;
}

std::string length_text(double length, bool voxels) {
  const std::string number = short_number(length);
  if (!voxels) return number + " mm";
  return number + (length == 1.0 ? " voxel" : " voxels");
}

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, std::abs(value) >= 1000.0 ? "%.0f" : "%.3g", value);
  return std::string(text) == "-0" ? "0" : text;
}

}  // namespace palpate::visualization
