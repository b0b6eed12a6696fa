#include "implicit_reference.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::simulation {

namespace {

using Vectors = std::vector<Eigen::Vector3d>;

struct Linearised {
  Vectors load;                         ///< b = h (F - h K v)
  std::vector<Eigen::Matrix3d> matrix;  ///< h C + h^2 K of each link
  std::vector<double> bound;            ///< B w/m of each point
};

Linearised linearised(const ImplicitSystem& system, double h, const Vectors& x, const Vectors& v) {
  const std::size_t count = x.size();
  Linearised result;
  result.load.resize(count);
  std::vector<Eigen::Matrix3d> blocks(count, Eigen::Matrix3d::Zero());
  for (std::size_t n = 0; n < count; ++n)
    result.load[n] = h * (system.mass[n] * system.gravity_mm_per_s2 - system.drag[n] * v[n]);
  for (const auto& link : system.links) {
    const auto [i, j] = link.ends;
    const Eigen::Vector3d apart = x[j] - x[i];
    const double length = apart.norm();
    result.matrix.push_back(Eigen::Matrix3d::Zero());
    if (length < 1e-15) continue;  // coincident points: no direction, no force
    const Eigen::Vector3d n = apart / length;
    const Eigen::Matrix3d along = n * n.transpose();
    // Across the link the true stiffness is k (1 - L0/l): its size, lest a
    // pressed link throw its ends aside, and no more than that along it.
    const double across = std::min(1.0, std::abs(1.0 - link.rest_length_mm / length));
    const Eigen::Matrix3d stiffness =
        link.stiffness * (along + across * (Eigen::Matrix3d::Identity() - along));
    const Eigen::Vector3d speed = v[j] - v[i];
    const Eigen::Vector3d force = link.stiffness * (length - link.rest_length_mm) * n +
                                  link.damping * along * speed + h * stiffness * speed;
    result.load[i] += h * force;
    result.load[j] -= h * force;
    result.matrix.back() = h * link.damping * along + h * h * stiffness;
    blocks[i] += result.matrix.back();
    blocks[j] += result.matrix.back();
  }
  // One bound for all that is joined, so that B is a multiple of the masses
  // and internal forces give a free tissue no momentum however roughly the
  // system is solved; a point without links has its own and is solved exactly.
  result.bound.resize(count);
  double largest = 1.0;
  for (std::size_t n = 0; n < count; ++n) {
    result.bound[n] =
        1.0 + system.freedom[n] / system.mass[n] * (h * system.drag[n] + 2.0 * eigenvalue_bound(blocks[n]));
    largest = std::max(largest, result.bound[n]);
  }
  for (std::size_t n = 0; n < count; ++n)
    if (!blocks[n].isZero(0.0)) result.bound[n] = largest;
  return result;
}

/// B^-1 (b - A u).
Vectors residual(const ImplicitSystem& system, const Linearised& linear, double h, const Vectors& u) {
  Vectors rest = linear.load;
  for (std::size_t n = 0; n < system.links.size(); ++n) {
    const auto [i, j] = system.links[n].ends;
    const Eigen::Vector3d pull = linear.matrix[n] * (u[j] - u[i]);
    rest[i] += pull;
    rest[j] -= pull;
  }
  for (std::size_t n = 0; n < rest.size(); ++n)
    rest[n] =
        (system.freedom[n] / system.mass[n] * (rest[n] - h * system.drag[n] * u[n]) - u[n]) / linear.bound[n];
  return rest;
}

}  // namespace

void implicit_step(const ImplicitSystem& system, const ImplicitPlan& plan, double step_s,
                   std::vector<Eigen::Vector3d>& positions_mm,
                   std::vector<Eigen::Vector3d>& velocities_mm_per_s) {
  const Linearised linear = linearised(system, step_s, positions_mm, velocities_mm_per_s);
  Vectors u(positions_mm.size(), Eigen::Vector3d::Zero());
  Vectors before = u;
  for (const auto& [momentum, rate] : plan.iterations) {
    const Vectors rest = residual(system, linear, step_s, u);
    for (std::size_t n = 0; n < u.size(); ++n)
      before[n] = u[n] + momentum * (u[n] - before[n]) + rate * rest[n];
    std::swap(u, before);
  }
  for (std::size_t n = 0; n < u.size(); ++n) {
    velocities_mm_per_s[n] += u[n];
    positions_mm[n] += step_s * system.freedom[n] * velocities_mm_per_s[n];
  }
}

}  // namespace palpate::simulation
