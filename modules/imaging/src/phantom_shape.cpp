#include "phantom_shape.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace palpate::imaging {
namespace {

double square(double value) { return value * value; }

/// Two ridges, anterolateral and posteromedial, between apex and mid cavity.
double papillary_share(double rest_y, double x, double z) {
  const double radius_squared = x * x + z * z;
  if (radius_squared <= 0.0) return 0.0;
  const double along = smooth_step(20.0, 36.0, rest_y) * (1.0 - smooth_step(48.0, 62.0, rest_y));
  if (along <= 0.0) return 0.0;
  const double inverse = 1.0 / std::sqrt(radius_squared);
  const double anterolateral = (0.80 * x + 0.60 * z) * inverse;
  const double posteromedial = (0.28 * x - 0.96 * z) * inverse;
  // cos(30 deg) is 0.87: at half its height a ridge is some 15 mm wide.
  return HeartShape::papillary_depth * along * smooth_step(0.87, 1.0, std::max(anterolateral, posteromedial));
}

}  // namespace

double smooth_step(double from, double to, double value) {
  const double t = std::clamp((value - from) / (to - from), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

double contraction_at(double phase) {
  if (phase < 0.40) return smooth_step(0.0, 0.36, phase);                // ejection
  if (phase < 0.72) return 1.0 - 0.78 * smooth_step(0.48, 0.70, phase);  // relaxation, early filling
  return 0.22 * (1.0 - smooth_step(0.84, 1.0, phase));                   // the atrium's kick
}

double valve_opening_at(double phase) {
  return smooth_step(0.50, 0.58, phase) * (1.0 - smooth_step(0.92, 0.99, phase));
}

HeartShape::HeartShape(double contraction)
    : shortening_(1.0 - 0.14 * contraction), inner_scale_squared_((1.0 - 0.58 * contraction) / shortening_) {}

double HeartShape::smooth_inner_squared(double y) const noexcept {
  const double from_centre = y / shortening_ - outer_half_mm;
  return square(inner_radius_mm) * (1.0 - square(from_centre / inner_half_mm));
}

double HeartShape::outer_radius_squared(double y) const noexcept {
  const double from_centre = y / shortening_ - outer_half_mm;
  const double outer = square(outer_radius_mm) * (1.0 - square(from_centre / outer_half_mm));
  const double inner = std::max(smooth_inner_squared(y), 0.0);
  return inner_scale_squared_ * inner + (outer - inner) / shortening_;
}

double HeartShape::inner_radius_squared(double y, double x, double z) const noexcept {
  const double smooth = inner_scale_squared_ * smooth_inner_squared(y);
  return smooth * square(1.0 - papillary_share(y / shortening_, x, z));
}

HeartShape::Distances HeartShape::distances(const Eigen::Vector3d& point) const noexcept {
  constexpr double step_mm = 0.01;
  const double x = point.x();
  const double y = point.y();
  const double z = point.z();
  const double radius_squared = x * x + z * z;
  // F = r^2 - R(y)^2 over its gradient's length; 1 mm keeps it finite on the axis.
  const auto distance = [&](double here, double further) {
    const double slope = (further - here) / step_mm;
    const double steepness = std::sqrt(4.0 * radius_squared + slope * slope);
    return (radius_squared - here) / std::max(steepness, 1.0);
  };
  Distances d{};
  d.outer = distance(outer_radius_squared(y), outer_radius_squared(y + step_mm));
  d.inner = distance(inner_radius_squared(y, x, z), inner_radius_squared(y + step_mm, x, z));
  d.base = y - base_mm();
  d.wall = std::max(std::max(d.outer, -d.inner), d.base);
  return d;
}

double HeartShape::valve_depth_mm(double radius_squared, double opening) const noexcept {
  const double annulus = inner_radius_squared(base_mm(), 1.0, 0.0);
  // The leaflets' dome bulges into the ventricle and deepens as they open.
  return base_mm() - (5.0 + 13.0 * opening) * std::max(0.0, 1.0 - radius_squared / annulus);
}

Eigen::Vector3d HeartShape::rest_place(const Eigen::Vector3d& point) const noexcept {
  const HeartShape rest(0.0);
  const double y = point.y() > 0.0 ? point.y() / shortening_ : point.y();
  const double radius_squared = point.x() * point.x() + point.z() * point.z();
  const double inner = std::max(inner_radius_squared(point.y(), point.x(), point.z()), 0.0);
  const double outer = outer_radius_squared(point.y());
  const double rest_inner = std::max(rest.inner_radius_squared(y, point.x(), point.z()), 0.0);
  const double rest_outer = rest.outer_radius_squared(y);
  double rest_squared = radius_squared;
  if (outer > 0.0 && radius_squared < inner)
    rest_squared = radius_squared * rest_inner / inner;
  else if (outer > inner && radius_squared < outer)
    rest_squared = rest_inner + (radius_squared - inner) * (rest_outer - rest_inner) / (outer - inner);
  else if (outer > 0.0)
    rest_squared = radius_squared + (rest_outer - outer);
  const double scale = radius_squared > 1e-12 ? std::sqrt(std::max(rest_squared, 0.0) / radius_squared) : 1.0;
  return {point.x() * scale, y, point.z() * scale};
}

core::TriangleMesh HeartShape::wall_surface(int rings, int sectors) const {
  core::TriangleMesh mesh;
  const auto add = [&](double x, double y, double z) {
    mesh.vertices_mm.push_back(Eigen::Vector3d(x, y, z).cast<float>());
    return static_cast<std::uint32_t>(mesh.vertices_mm.size() - 1);
  };
  const auto triangle = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    mesh.triangles.push_back({a, b, c});
  };
  constexpr double full_turn = 6.283185307179586;
  // One bowl from its tip to the base; y grows with the square so that rings lie evenly on the round tip.
  const auto bowl = [&](double tip, bool outside) {
    std::vector<std::uint32_t> previous{add(0.0, tip, 0.0)};
    for (int ring = 1; ring <= rings; ++ring) {
      const double share = static_cast<double>(ring) / rings;
      const double y =
          ring == rings ? base_mm() : tip + (base_mm() - tip) * share * share * (1.6 - 0.6 * share);
      std::vector<std::uint32_t> current;
      for (int sector = 0; sector < sectors; ++sector) {
        const double angle = full_turn * sector / sectors;
        const double x = std::cos(angle);
        const double z = std::sin(angle);
        const double radius = std::sqrt(outside ? outer_radius_squared(y) : inner_radius_squared(y, x, z));
        current.push_back(add(radius * x, y, radius * z));
      }
      for (std::size_t n = 0; n < current.size(); ++n) {
        const std::size_t next = (n + 1) % current.size();
        const std::uint32_t a = previous.size() == 1 ? previous[0] : previous[n];
        const std::uint32_t b = previous.size() == 1 ? previous[0] : previous[next];
        if (outside) {
          triangle(a, current[n], current[next]);
          if (previous.size() > 1) triangle(a, current[next], b);
        } else {
          triangle(a, current[next], current[n]);
          if (previous.size() > 1) triangle(a, b, current[next]);
        }
      }
      previous = current;
    }
    return previous;
  };
  const auto outer_rim = bowl(0.0, true);
  const auto inner_rim = bowl((outer_half_mm - inner_half_mm) * shortening_, false);
  for (std::size_t n = 0; n < outer_rim.size(); ++n) {
    const std::size_t next = (n + 1) % outer_rim.size();
    triangle(outer_rim[n], inner_rim[n], inner_rim[next]);
    triangle(outer_rim[n], inner_rim[next], outer_rim[next]);
  }
  mesh.normals = core::vertex_normals(mesh);
  return mesh;
}

}  // namespace palpate::imaging
