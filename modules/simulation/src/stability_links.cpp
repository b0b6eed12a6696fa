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

/// Upper triangle of a symmetric 3x3 matrix.
struct Symmetric3 {
  double xx = 0.0, yy = 0.0, zz = 0.0, xy = 0.0, xz = 0.0, yz = 0.0;

  void add_outer(const Eigen::Vector3d& n, double factor) {
    xx += factor * n.x() * n.x();
    yy += factor * n.y() * n.y();
    zz += factor * n.z() * n.z();
    xy += factor * n.x() * n.y();
    xz += factor * n.x() * n.z();
    yz += factor * n.y() * n.z();
  }
  void add_identity(double factor) {
    xx += factor;
    yy += factor;
    zz += factor;
  }
  Symmetric3 operator+(const Symmetric3& o) const {
    return {xx + o.xx, yy + o.yy, zz + o.zz, xy + o.xy, xz + o.xz, yz + o.yz};
  }
};

/// The largest root of the characteristic polynomial, by its trigonometric
/// solution: with q = tr/3 and B = (A - q I)/p of unit size,
/// lambda = q + 2 p cos(acos(det(B)/2)/3).
double largest_eigenvalue(const Symmetric3& a) {
  const double q = (a.xx + a.yy + a.zz) / 3.0;
  const double x = a.xx - q;
  const double y = a.yy - q;
  const double z = a.zz - q;
  const double p = std::sqrt((x * x + y * y + z * z + 2.0 * (a.xy * a.xy + a.xz * a.xz + a.yz * a.yz)) / 6.0);
  if (p == 0.0) return q;
  const double det =
      x * (y * z - a.yz * a.yz) - a.xy * (a.xy * z - a.yz * a.xz) + a.xz * (a.xy * a.yz - y * a.xz);
  const double half_det = std::clamp(det / (2.0 * p * p * p), -1.0, 1.0);
  return q + 2.0 * p * std::cos(std::acos(half_det) / 3.0);
}

/// The first of the largest; NaN never comes in.
void offer(double& largest, std::size_t& where, double value, std::size_t point) {
  if (!(value > largest)) return;
  largest = value;
  where = point;
}

/// What the links of one slice add to points of any slice.
struct PointSums {
  Symmetric3 along, across, damping;
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
  sums.along.add_outer(link.direction, link.stiffness);
  sums.damping.add_outer(link.direction, link.damping);
  if (link.across == 0.0) return;
  sums.across.add_identity(link.across);
  sums.across.add_outer(link.direction, -link.across);
}

/// The part of the bounds that the points of a slice decide.
PointBounds bounds_of(const StabilityField& field, const Slices& slices, std::size_t slice,
                      const std::vector<PointSums>& sums, std::vector<float>& by_point) {
  PointBounds bounds;
  bounds.drag_low = std::numeric_limits<double>::infinity();
  for (std::size_t n = slices.begin(slice); n < slices.end(slice); ++n) {
    const double twice_per_mass = 2.0 / field.mass(n);
    const PointSums& s = sums[n];
    const bool is_stretched = s.across.xx + s.across.yy + s.across.zz > 0.0;
    const double stiffness = twice_per_mass * largest_eigenvalue(is_stretched ? s.along + s.across : s.along);
    by_point[n] = static_cast<float>(stiffness);
    offer(bounds.stiffness, bounds.stiffness_point, stiffness, n);
    if (is_stretched) bounds.across = std::max(bounds.across, twice_per_mass * largest_eigenvalue(s.across));
    const double drag = field.drag(n);
    offer(bounds.damping, bounds.damping_point, twice_per_mass * largest_eigenvalue(s.damping) + drag, n);
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
