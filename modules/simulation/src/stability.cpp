#include "palpate/simulation/stability.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
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

struct Worst {
  double value = 0.0;
  std::size_t point = 0;
  void offer(double other, std::size_t where) {
    if (!(other > value)) return;  // the first of equals stays, and NaN never comes in
    value = other;
    point = where;
  }
};

struct Bounds {
  Worst stiffness;  ///< lambda_max(S)
  Worst damping;    ///< lambda_max(sum n n^T)
};

/// Over the points [begin, end): pairs are sorted, so that nearly all of the
/// pairs of a range lie together and every thread can look through all.
Bounds bounds_of(const model::LinkGraph& links, const std::vector<Eigen::Vector3f>& positions,
                 double stiffness, std::size_t begin, std::size_t end) {
  std::vector<Symmetric3> directions(end - begin);
  std::vector<Symmetric3> stretch(end - begin);  // sum max(0, 1 - L0/l)(I - n n^T)
  for (std::size_t link = 0; link < links.size(); ++link) {
    const std::array<std::size_t, 2> ends{links.pairs[link][0], links.pairs[link][1]};
    const bool first = ends[0] >= begin && ends[0] < end;
    const bool second = ends[1] >= begin && ends[1] < end;
    if (!first && !second) continue;
    const Eigen::Vector3d apart = (positions[ends[1]] - positions[ends[0]]).cast<double>();
    const double length = apart.norm();
    if (length == 0.0) continue;  // no direction, no force
    const Eigen::Vector3d n = apart / length;
    const double stretched = std::max(0.0, 1.0 - static_cast<double>(links.rest_lengths_mm[link]) / length);
    for (const std::size_t point : ends) {
      if (point < begin || point >= end) continue;
      directions[point - begin].add_outer(n, 1.0);
      if (stretched == 0.0) continue;
      stretch[point - begin].add_identity(stretched);
      stretch[point - begin].add_outer(n, -stretched);
    }
  }
  Bounds bounds;
  for (std::size_t n = 0; n < directions.size(); ++n) {
    const Symmetric3& d = directions[n];
    const Symmetric3& s = stretch[n];
    const double direction = largest_eigenvalue(d);
    const bool is_stretched = s.xx + s.yy + s.zz > 0.0;
    const double whole = is_stretched ? largest_eigenvalue({d.xx + s.xx, d.yy + s.yy, d.zz + s.zz,
                                                            d.xy + s.xy, d.xz + s.xz, d.yz + s.yz})
                                      : direction;
    bounds.stiffness.offer(stiffness * whole, begin + n);
    bounds.damping.offer(direction, begin + n);
  }
  return bounds;
}

}  // namespace

StableStep stable_step(const model::Tissue& tissue, const Parameters& parameters, const StabilityCase& at) {
  const auto& positions_mm = at.positions_mm != nullptr ? *at.positions_mm : tissue.points.positions_mm;
  const std::size_t points = tissue.points.size();
  if (positions_mm.size() != points)
    throw core::Error(core::ErrorKind::internal, "state-size",
                      std::to_string(positions_mm.size()) + " positions do not fit a tissue of " +
                          std::to_string(points) + " points.");
  constexpr std::size_t worth_a_thread = 20000;
  const std::size_t threads =
      std::clamp<std::size_t>(points / worth_a_thread, 1, std::max(1U, std::thread::hardware_concurrency()));
  std::vector<Bounds> parts(threads);
  const auto work = [&](std::size_t n) {
    parts[n] = bounds_of(tissue.links, positions_mm, parameters.stiffness_per_s2, points * n / threads,
                         points * (n + 1) / threads);
  };
  std::vector<std::thread> workers;
  for (std::size_t n = 1; n < threads; ++n) workers.emplace_back(work, n);
  work(0);
  for (auto& worker : workers) worker.join();

  Bounds bounds;
  for (const auto& part : parts) {
    bounds.stiffness.offer(part.stiffness.value, part.stiffness.point);
    bounds.damping.offer(part.damping.value, part.damping.point);
  }
  // RK4 (docs/physics.md): the worst damped oscillation, and pure decay.
  const double infinite = std::numeric_limits<double>::infinity();
  const double omega = std::sqrt(2.0 * bounds.stiffness.value);
  const double mu = 2.0 * parameters.damping_per_s * bounds.damping.value + parameters.drag_per_s;
  const double by_oscillation = omega > 0.0 ? 2.616 / omega : infinite;
  const double by_decay = mu > 0.0 ? 2.785 / mu : infinite;
  return {std::min(by_oscillation, by_decay), omega,
          by_decay < by_oscillation ? bounds.damping.point : bounds.stiffness.point, mu, false};
}

StableStep estimated_stable_step(const model::Tissue& tissue, const Parameters& parameters,
                                 const StabilityCase& at, const core::Progress&) {
  return stable_step(tissue, parameters, at);
}

double automatic_step_s(const StableStep& bound) { return std::min(0.9 * bound.step_s, 0.02); }

}  // namespace palpate::simulation
