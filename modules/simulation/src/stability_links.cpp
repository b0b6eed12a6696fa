#include "stability_links.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <thread>

namespace palpate::simulation {

namespace {

/// Upper triangle of a symmetric 3x3 matrix. In float: a sum of 64 links is
/// good to 4e-6, and half the memory is half the time.
struct Symmetric3 {
  float xx = 0.0F, yy = 0.0F, zz = 0.0F, xy = 0.0F, xz = 0.0F, yz = 0.0F;

  /// along n n^T + across (I - n n^T)
  void add(const Eigen::Vector3d& n, double along, double across) {
    const Eigen::Vector3d m = (along - across) * n;
    xx += static_cast<float>(m.x() * n.x() + across);
    yy += static_cast<float>(m.y() * n.y() + across);
    zz += static_cast<float>(m.z() * n.z() + across);
    xy += static_cast<float>(m.x() * n.y());
    xz += static_cast<float>(m.x() * n.z());
    yz += static_cast<float>(m.y() * n.z());
  }
};
constexpr double rounding = 1.0 + 4e-6;

/// With q = tr/3 and B = (A - q I)/p of unit size, lambda is at most q + 2 p:
/// nearly it for most, and without the angle.
struct Shape {
  explicit Shape(const Symmetric3& a)
      : q((static_cast<double>(a.xx) + static_cast<double>(a.yy) + static_cast<double>(a.zz)) / 3.0),
        x(static_cast<double>(a.xx) - q),
        y(static_cast<double>(a.yy) - q),
        z(static_cast<double>(a.zz) - q),
        xy(static_cast<double>(a.xy)),
        xz(static_cast<double>(a.xz)),
        yz(static_cast<double>(a.yz)),
        p(std::sqrt((x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)) {}
  double q, x, y, z, xy, xz, yz, p;
  double at_most() const { return q + 2.0 * p; }
};

/// The largest root of the characteristic polynomial, by its trigonometric
/// solution: lambda = q + 2 p cos(acos(det(B)/2)/3).
double largest_eigenvalue(const Shape& s) {
  if (s.p == 0.0) return s.q;
  const double det =
      s.x * (s.y * s.z - s.yz * s.yz) - s.xy * (s.xy * s.z - s.yz * s.xz) + s.xz * (s.xy * s.yz - s.y * s.xz);
  const double half_det = std::clamp(det / (2.0 * s.p * s.p * s.p), -1.0, 1.0);
  return s.q + 2.0 * s.p * std::cos(std::acos(half_det) / 3.0);
}

/// The first of the largest; NaN never comes in.
void offer(double& largest, std::size_t& where, double value, std::size_t point) {
  if (!(value > largest)) return;
  largest = value;
  where = point;
}

/// What the links of a point sum up to.
struct PointSums {
  Symmetric3 stiffness;  ///< along and across
  Symmetric3 damping;
  float across = 0.0F;
};

struct LinkRange {
  double slope_low = std::numeric_limits<double>::infinity();
  double slope_high = 0.0;
  void add(const StabilityField::Link& link) {
    if (!(link.stiffness > 0.0)) return;
    slope_low = std::min(slope_low, link.damping / link.stiffness);
    slope_high = std::max(slope_high, link.damping / link.stiffness);
  }
};

void add(const StabilityField::Link& link, PointSums& sums) {
  sums.stiffness.add(link.direction, link.stiffness, link.across);
  sums.damping.add(link.direction, link.damping, 0.0);
  sums.across += static_cast<float>(link.across);
}

/// Offers lambda times a factor, found exactly only where it may be the largest.
void offer(double& largest, std::size_t& where, const Shape& shape, double factor, double more,
           std::size_t point) {
  if (rounding * factor * shape.at_most() + more > largest)
    offer(largest, where, rounding * factor * largest_eigenvalue(shape) + more, point);
}

/// The part of the bounds that the points of a slice decide.
PointBounds bounds_of(const StabilityField& field, const Slices& slices, std::size_t slice,
                      const std::vector<PointSums>& sums, std::vector<float>& by_point) {
  PointBounds bounds;
  bounds.drag_low = std::numeric_limits<double>::infinity();
  for (std::size_t n = slices.begin(slice); n < slices.end(slice); ++n) {
    const double twice_per_mass = 2.0 / field.mass(n);
    const PointSums& s = sums[n];
    const Shape stiffness(s.stiffness);
    by_point[n] = static_cast<float>(twice_per_mass * stiffness.at_most());
    offer(bounds.stiffness, bounds.stiffness_point, stiffness, twice_per_mass, 0.0, n);
    bounds.across = std::max(bounds.across, twice_per_mass * static_cast<double>(s.across));
    const double drag = field.drag(n);
    offer(bounds.damping, bounds.damping_point, Shape(s.damping), twice_per_mass, drag, n);
    bounds.drag_low = std::min(bounds.drag_low, drag);
    bounds.drag_high = std::max(bounds.drag_high, drag);
  }
  return bounds;
}

}  // namespace

StabilityField::StabilityField(const model::Tissue& tissue, const Parameters& parameters,
                               const StabilityCase& at, bool sees_stretch)
    : tissue_(tissue),
      parameters_(parameters),
      positions_mm_(at.positions_mm != nullptr ? *at.positions_mm : tissue.points.positions_mm),
      alive_(at.link_alive),
      sees_stretch_(sees_stretch),
      // Shortest in the middle of a beat: then the same tissue is stretched the most.
      rest_scale_(rest_scale_at(parameters, 0.5 * parameters.beat_period_s)) {
  const auto refuse = [&](std::size_t given, const char* what) {
    throw core::Error(core::ErrorKind::internal, "state-size",
                      std::to_string(given) + " " + what + " do not fit a tissue of " +
                          std::to_string(tissue.points.size()) + " points and " +
                          std::to_string(tissue.links.size()) + " links.");
  };
  if (positions_mm_.size() != tissue.points.size()) refuse(positions_mm_.size(), "positions");
  if (alive_ != nullptr && alive_->size() != tissue.links.size()) refuse(alive_->size(), "living links");
  if (at.material == nullptr) return;
  check(*at.material, tissue.points.size());
  if (!at.material->is_scaled()) return;
  factors_ = &at.material->factors;
  scales_stiffness_ = at.material->scales_stiffness;
  scales_damping_ = at.material->scales_damping;
  scales_drag_ = at.material->scales_drag;
  scales_mass_ = at.material->scales_mass;
}

double StabilityField::factor(std::size_t point, bool scaled) const {
  return scaled ? static_cast<double>((*factors_)[point]) : 1.0;
}
double StabilityField::mass(std::size_t point) const {
  return parameters_.mass * factor(point, scales_mass_);
}
double StabilityField::drag(std::size_t point) const {
  return parameters_.drag_per_s * factor(point, scales_drag_) / mass(point);
}

StabilityField::Link StabilityField::link(std::size_t index) const {
  Link link;
  const double rest = static_cast<double>(tissue_.links.rest_lengths_mm[index]);
  if (!(rest > 0.0) || (alive_ != nullptr && (*alive_)[index] == 0)) return link;
  const auto [a, b] = tissue_.links.pairs[index];
  const Eigen::Vector3d apart = (positions_mm_[b] - positions_mm_[a]).cast<double>();
  const double length = apart.norm();
  if (!(length > 0.0)) return link;  // no direction, no force
  link.direction = apart / length;
  link.stiffness =
      parameters_.stiffness_per_s2 * 0.5 * (factor(a, scales_stiffness_) + factor(b, scales_stiffness_));
  link.damping = parameters_.damping_per_s * 0.5 * (factor(a, scales_damping_) + factor(b, scales_damping_));
  if (sees_stretch_) link.across = link.stiffness * std::max(0.0, 1.0 - rest_scale_ * rest / length);
  return link;
}

Slices::Slices(const model::LinkGraph& links, std::size_t points) {
  for (std::size_t n = 0; n <= count; ++n) {
    points_[n] = points * n / count;
    const auto first = std::lower_bound(
        links.pairs.begin(), links.pairs.end(), points_[n],
        [](const std::array<std::uint32_t, 2>& pair, std::size_t point) { return pair[0] < point; });
    links_[n] = n == count ? links.pairs.size() : static_cast<std::size_t>(first - links.pairs.begin());
  }
}

void Slices::run(const std::function<void(std::size_t)>& work) const {
  constexpr std::size_t worth_threads = 20000;
  const std::size_t threads = points_[count] < worth_threads
                                  ? 1
                                  : std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, count);
  const auto share = [&](std::size_t thread) {
    for (std::size_t slice = thread; slice < count; slice += threads) work(slice);
  };
  std::vector<std::thread> workers;
  for (std::size_t n = 1; n < threads; ++n) workers.emplace_back(share, n);
  share(0);
  for (auto& worker : workers) worker.join();
}

PointBounds point_bounds(const StabilityField& field, const Slices& slices) {
  const std::size_t points = field.points();
  std::vector<PointSums> sums(points);
  std::array<LinkRange, Slices::count> ranges;
  std::array<std::vector<std::size_t>, Slices::count> crossing;  // to points of other slices
  const auto& pairs = field.links().pairs;
  slices.run([&](std::size_t slice) {
    for (std::size_t n = slices.links_begin(slice); n < slices.links_end(slice); ++n) {
      const auto link = field.link(n);
      if (link.stiffness == 0.0 && link.damping == 0.0) continue;
      ranges[slice].add(link);
      add(link, sums[pairs[n][0]]);
      if (pairs[n][1] < slices.end(slice))
        add(link, sums[pairs[n][1]]);
      else
        crossing[slice].push_back(n);
    }
  });
  for (const auto& list : crossing)
    for (const std::size_t n : list) add(field.link(n), sums[pairs[n][1]]);

  PointBounds all;
  all.by_point.resize(points);
  std::array<PointBounds, Slices::count> parts;
  slices.run([&](std::size_t slice) { parts[slice] = bounds_of(field, slices, slice, sums, all.by_point); });
  LinkRange range;
  all.drag_low = std::numeric_limits<double>::infinity();
  for (std::size_t slice = 0; slice < Slices::count; ++slice) {
    const PointBounds& part = parts[slice];
    offer(all.stiffness, all.stiffness_point, part.stiffness, part.stiffness_point);
    offer(all.damping, all.damping_point, part.damping, part.damping_point);
    all.across = std::max(all.across, part.across);
    all.drag_low = std::min(all.drag_low, part.drag_low);
    all.drag_high = std::max(all.drag_high, part.drag_high);
    range.slope_low = std::min(range.slope_low, ranges[slice].slope_low);
    range.slope_high = std::max(range.slope_high, ranges[slice].slope_high);
  }
  if (std::isfinite(range.slope_low)) {
    all.slope_low = range.slope_low;
    all.slope_high = range.slope_high;
  }
  if (!std::isfinite(all.drag_low)) all.drag_low = 0.0;
  return all;
}

}  // namespace palpate::simulation
