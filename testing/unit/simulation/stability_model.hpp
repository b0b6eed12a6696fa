#pragma once

#include "palpate/simulation/solver.hpp"
#include "palpate/simulation/stability.hpp"
#include "palpate/testing/cube_tissue.hpp"

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>

#include <cmath>
#include <memory>

// Stability the slow way: dense matrices and their eigenvalues by Eigen, and
// runs that are tried until they blow up.
namespace palpate::testing {

/// `count` points at random in a box of one point per cubic millimetre, no
/// two nearer than 0.3 mm, mutual twelve nearest.
inline std::shared_ptr<model::Tissue> random_model(std::size_t count, std::uint32_t seed) {
  Numbers numbers(seed);
  const double half = std::cbrt(static_cast<double>(count)) / 2.0;
  std::vector<Eigen::Vector3f> places;
  while (places.size() < count) {
    const Eigen::Vector3f place = numbers.vector(half);
    bool free = true;
    for (const auto& other : places) free = free && (other - place).norm() > 0.3F;
    if (free) places.push_back(place);
  }
  auto tissue = loose_points(places);
  link_mutual_nearest(*tissue, 12);
  return tissue;
}

/// Stiffness and damping of a case with masses taken in: x'' = -A x - B x'.
struct DenseModel {
  Eigen::MatrixXd a, b;
  double omega2() const { return top(a); }
  double decay() const { return top(b); }
  static double top(const Eigen::MatrixXd& m) {
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(m, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff();
  }
};
inline DenseModel dense_model(const model::Tissue& tissue, const simulation::Parameters& p,
                              const simulation::StabilityCase& at = {}) {
  const auto& x = at.positions_mm != nullptr ? *at.positions_mm : tissue.points.positions_mm;
  const auto size = static_cast<Eigen::Index>(3 * x.size());
  const simulation::Material plain;
  const auto& material = at.material != nullptr ? *at.material : plain;
  const auto factor = [&](std::size_t point, bool scaled) {
    return scaled && !material.factors.empty() ? static_cast<double>(material.factors[point]) : 1.0;
  };
  DenseModel dense{Eigen::MatrixXd::Zero(size, size), Eigen::MatrixXd::Zero(size, size)};
  for (std::size_t n = 0; n < tissue.links.size(); ++n) {
    if (at.link_alive != nullptr && (*at.link_alive)[n] == 0) continue;
    const auto [first, second] = tissue.links.pairs[n];
    const double rest = static_cast<double>(tissue.links.rest_lengths_mm[n]);
    if (rest == 0.0) continue;
    const Eigen::Vector3d apart = (x[second] - x[first]).cast<double>();
    const Eigen::Vector3d direction = apart.normalized();
    const Eigen::Matrix3d along = direction * direction.transpose();
    const double k = p.stiffness_per_s2 * 0.5 *
                     (factor(first, material.scales_stiffness) + factor(second, material.scales_stiffness));
    const double c = p.damping_per_s * 0.5 *
                     (factor(first, material.scales_damping) + factor(second, material.scales_damping));
    const Eigen::Matrix3d stiff =
        k * (along + (1.0 - rest / apart.norm()) * (Eigen::Matrix3d::Identity() - along));
    const Eigen::Matrix3d damped = c * along;
    const Eigen::Index i = 3 * static_cast<Eigen::Index>(first);
    const Eigen::Index j = 3 * static_cast<Eigen::Index>(second);
    for (const auto& [matrix, block] : {std::pair{&dense.a, &stiff}, std::pair{&dense.b, &damped}}) {
      matrix->block<3, 3>(i, i) += *block;
      matrix->block<3, 3>(j, j) += *block;
      matrix->block<3, 3>(i, j) -= *block;
      matrix->block<3, 3>(j, i) -= *block;
    }
  }
  Eigen::VectorXd root_mass(size);
  for (Eigen::Index n = 0; n < size; ++n) {
    const auto point = static_cast<std::size_t>(n / 3);
    root_mass[n] = std::sqrt(p.mass * factor(point, material.scales_mass));
    dense.b(n, n) += p.drag_per_s * factor(point, material.scales_drag);
  }
  const auto inverse = root_mass.cwiseInverse().asDiagonal();
  dense.a = inverse * dense.a * inverse;
  dense.b = inverse * dense.b * inverse;
  return dense;
}

/// The matrix of one step of a scheme for x'' = -A x - B x', on (x, v).
inline Eigen::MatrixXd amplification(simulation::Integrator scheme, const Eigen::MatrixXd& a,
                                     const Eigen::MatrixXd& b, double h) {
  const Eigen::Index n = a.rows();
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(n, n);
  Eigen::MatrixXd rate = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  rate << Eigen::MatrixXd::Zero(n, n), one, -a, -b;
  const Eigen::MatrixXd whole = Eigen::MatrixXd::Identity(2 * n, 2 * n);
  if (scheme == simulation::Integrator::euler) return whole + h * rate;
  if (scheme == simulation::Integrator::rk4) {
    const Eigen::MatrixXd z = h * rate;
    return whole + z * (whole + z / 2.0 * (whole + z / 3.0 * (whole + z / 4.0)));
  }
  const Eigen::MatrixXd place = whole.topRows(n);
  const Eigen::MatrixXd speed = whole.bottomRows(n);
  const Eigen::MatrixXd force = -a * place - b * speed;
  Eigen::MatrixXd step(2 * n, 2 * n);
  if (scheme == simulation::Integrator::velocity_verlet) {
    const Eigen::MatrixXd next = place + h * speed + h * h / 2.0 * force;
    const Eigen::MatrixXd predicted = speed + h * force;
    step << next, speed + h / 2.0 * (force - a * next - b * predicted);
  } else {  // symplectic Euler; the position form of Verlet is the same with v = (x - x-)/h
    const Eigen::MatrixXd next = speed + h * force;
    step << place + h * next, next;
  }
  return step;
}
inline double spectral_radius(const Eigen::MatrixXd& m) { return m.eigenvalues().cwiseAbs().maxCoeff(); }

/// By how much a small random disturbance grows over `steps` steps of h, by
/// the reference solver: 1e-4 mm/s, so small that all stays linear until it
/// has grown a thousandfold.
inline double growth(const std::shared_ptr<model::Tissue>& tissue, const simulation::Parameters& parameters,
                     double h, int steps, const simulation::Material& material = {}) {
  const auto solver = simulation::make_reference_solver(tissue, parameters, material);
  auto state = solver->state();
  Numbers numbers(3);
  double before = 0.0;
  for (auto& v : state.velocities_mm_per_s) {
    v = numbers.vector(1e-4);
    before = std::max(before, static_cast<double>(v.norm()));
  }
  solver->set_state(state);
  for (int done = 0; done < steps; done += 50) {
    solver->step(std::min(50, steps - done), h);
    const auto health = solver->health();
    if (!health.finite) return INFINITY;
    const double grown = static_cast<double>(health.max_speed_mm_per_s) / before;
    if (grown > 1e4) return grown;
  }
  return static_cast<double>(solver->health().max_speed_mm_per_s) / before;
}

/// The step at which runs begin to blow up, to 0.1 % of `near`, by halving between 0.7 and 1.4 of it.
inline double measured_limit(const std::shared_ptr<model::Tissue>& tissue,
                             const simulation::Parameters& parameters, double near, int steps = 600,
                             const simulation::Material& material = {}) {
  double calm = 0.7 * near;
  double wild = 1.4 * near;
  while (wild - calm > 0.002 * near) {
    const double h = 0.5 * (calm + wild);
    (growth(tissue, parameters, h, steps, material) > 1000.0 ? wild : calm) = h;
  }
  return 0.5 * (calm + wild);
}

}  // namespace palpate::testing
