// The reference solver against what does not come from it: exact solutions,
// derivatives of the energy, conserved quantities.
#include "palpate/core/error.hpp"
#include "palpate/simulation/solver.hpp"
#include "palpate/simulation/stability.hpp"
#include "palpate/testing/cube_tissue.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>

namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::Parameters;
using simulation::State;

namespace {

Parameters undamped() {
  Parameters parameters;
  parameters.damping_per_s = 0.0;
  parameters.drag_per_s = 0.0;
  return parameters;
}

Eigen::Vector3d angular_momentum(const State& state) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t n = 0; n < state.positions_mm.size(); ++n)
    sum += state.positions_mm[n].cast<double>().cross(state.velocities_mm_per_s[n].cast<double>());
  return sum;
}

/// A state with every point displaced and moving at random.
State disturbed(const simulation::Solver& solver, double displacement_mm, double speed_mm_per_s) {
  State state = solver.state();
  testing_::Numbers numbers(7);
  for (auto& x : state.positions_mm) x += numbers.vector(displacement_mm);
  for (auto& v : state.velocities_mm_per_s) v = numbers.vector(speed_mm_per_s);
  return state;
}

/// Distance to the exact solution after one second in steps of h.
double oscillator_error(double h) {
  Parameters parameters = undamped();
  parameters.stiffness_per_s2 = 45.0;
  parameters.damping_per_s = 3.0;
  const auto solver = simulation::make_reference_solver(testing_::oscillator_tissue(), parameters);
  solver->hold({{0, 1.0F}});
  solver->step(static_cast<int>(std::lround(1.0 / h)), h);
  return std::abs(static_cast<double>(solver->state().positions_mm[1].x()) - testing_::oscillator_place(1.0));
}

}  // namespace

TEST(ReferenceSolver, IsOfFourthOrderOnTheThesisOscillator) {
  // 0.02 to 0.01 s: small enough for the leading term, large enough that the
  // error (1e-6 and up) stands well over the 1e-7 of the float state.
  const double coarse = oscillator_error(0.04);
  const double fine = oscillator_error(0.02);
  const double finest = oscillator_error(0.01);
  EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.1);
  EXPECT_NEAR(std::log2(fine / finest), 4.0, 0.1);
  EXPECT_LT(finest, 1e-4);
}

TEST(ReferenceSolver, ForceIsTheNegativeGradientOfTheEnergy) {
  Parameters parameters = undamped();
  parameters.gravity_mm_per_s2 = {30.0, -4000.0, 500.0};
  const auto solver = simulation::make_reference_solver(testing_::cube_tissue(3), parameters);
  State start = disturbed(*solver, 0.2, 0.0);
  // From rest, v(h) = h a + O(h^3): with h = 1e-5 s the next term is 1e-5 of it.
  const double h = 1e-5;
  solver->set_state(start);
  solver->step(1, h);
  const State after = solver->state();
  // Central difference over 2^-7 mm, exact in float: its error is (delta/l)^2/6, 1e-5 of k.
  const float delta = 0.0078125F;
  for (auto& x : start.positions_mm)
    for (int axis = 0; axis < 3; ++axis) x[axis] = std::round(x[axis] * 1024.0F) / 1024.0F;
  solver->set_state(start);
  solver->step(1, h);
  const State moved = solver->state();
  for (std::size_t point = 0; point < start.positions_mm.size(); ++point)
    for (int axis = 0; axis < 3; ++axis) {
      State beside = start;
      beside.positions_mm[point][axis] = start.positions_mm[point][axis] + delta;
      solver->set_state(beside);
      const double above = solver->energy().potential;
      beside.positions_mm[point][axis] = start.positions_mm[point][axis] - delta;
      solver->set_state(beside);
      const double below = solver->energy().potential;
      const double gradient = (above - below) / (2.0 * static_cast<double>(delta));
      const double force = static_cast<double>(moved.velocities_mm_per_s[point][axis]) / h;
      // Forces here are up to some 1e4; k delta^2/l over twelve links is under 10.
      EXPECT_NEAR(force, -gradient, 10.0) << "point " << point << " axis " << axis;
    }
}

TEST(ReferenceSolver, EnergyIsLostAsTheDampersAndTheDragSay) {
  Parameters parameters = undamped();
  parameters.damping_per_s = 100.0;
  parameters.drag_per_s = 20.0;
  const auto tissue = testing_::cube_tissue(3);
  const auto solver = simulation::make_reference_solver(tissue, parameters);
  solver->set_state(disturbed(*solver, 0.0, 50.0));
  const auto rate = [&] {  // dE/dt = -sum c (n.(v_j - v_i))^2 - D sum v^2
    const State state = solver->state();
    double sum = 0.0;
    for (const auto& [i, j] : tissue->links.pairs) {
      const Eigen::Vector3d n = (state.positions_mm[j] - state.positions_mm[i]).cast<double>().normalized();
      const double along =
          n.dot((state.velocities_mm_per_s[j] - state.velocities_mm_per_s[i]).cast<double>());
      sum -= parameters.damping_per_s * along * along;
    }
    for (const auto& v : state.velocities_mm_per_s)
      sum -= parameters.drag_per_s * v.cast<double>().squaredNorm();
    return sum;
  };
  const double h = 2e-5;
  const auto total = [&] { return solver->energy().kinetic + solver->energy().potential; };
  const double energy_before = total();
  const double rate_before = rate();
  solver->step(1, h);
  // Trapezoid over one small step: (mu h)^2/12 of itself (1e-4), and float rounding of E over h.
  EXPECT_NEAR((total() - energy_before) / h, (rate_before + rate()) / 2.0, 2e-3 * std::abs(rate_before));
}

TEST(ReferenceSolver, AFreeBodyKeepsItsMomentumAndItsSpin) {
  Parameters parameters;
  parameters.drag_per_s = 0.0;  // dampers act along links: they take no momentum
  const auto tissue = testing_::cube_tissue(4);
  const auto solver = simulation::make_reference_solver(tissue, parameters);
  State start = disturbed(*solver, 0.05, 5.0);
  for (std::size_t n = 0; n < start.positions_mm.size(); ++n)  // a drift and a spin on top
    start.velocities_mm_per_s[n] +=
        Eigen::Vector3f(3, -2, 1) + Eigen::Vector3f(0, 0, 2).cross(start.positions_mm[n]);
  solver->set_state(start);
  const Eigen::Vector3d momentum = solver->energy().momentum;
  const Eigen::Vector3d spin = angular_momentum(start);
  solver->step(500, simulation::stable_step(*tissue, parameters).step_s / 4.0);
  // Momentum is a sum of 64 velocities read back as floats (10 mm/s, 5e-7 each).
  EXPECT_LT((solver->energy().momentum - momentum).norm(), 1e-4);
  EXPECT_GT(momentum.norm(), 100.0);
  // RK4 keeps spin to its own order only: a thousandth at a quarter of the largest step.
  EXPECT_LT((angular_momentum(solver->state()) - spin).norm(), 1e-3 * spin.norm());
  EXPECT_GT(spin.norm(), 100.0);
}

TEST(ReferenceSolver, EnergyNeverGrowsWithDamping) {
  const Parameters parameters;
  const auto tissue = testing_::cube_tissue(4);
  const auto solver = simulation::make_reference_solver(tissue, parameters);
  solver->set_state(disturbed(*solver, 0.1, 0.0));
  const double h = simulation::stable_step(*tissue, parameters).step_s / 2.0;
  double last = solver->energy().kinetic + solver->energy().potential;
  const double first = last;
  for (int batch = 0; batch < 50; ++batch) {
    solver->step(4, h);
    const double now = solver->energy().kinetic + solver->energy().potential;
    EXPECT_LE(now, last + 1e-6 * first) << "batch " << batch;  // 1e-6: the state is read as floats
    last = now;
  }
  EXPECT_LT(last, 0.05 * first);
}

TEST(ReferenceSolver, SelectanceScalesTheDerivative) {
  // With alpha = 1/2: x' = v/2, v' = g/2; from (1 - alpha) v0 the solution is a parabola, exact in RK4.
  Parameters parameters = undamped();
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -8.0};
  const auto solver = simulation::make_reference_solver(testing_::loose_points({{0, 0, 0}}), parameters);
  State start = solver->state();
  start.velocities_mm_per_s[0] = {4.0F, 0.0F, 0.0F};
  solver->set_state(start);
  solver->hold({{0, 0.5F}});
  EXPECT_FLOAT_EQ(solver->state().velocities_mm_per_s[0].x(), 2.0F);
  solver->step(100, 0.01);
  EXPECT_NEAR(solver->state().velocities_mm_per_s[0].z(), -4.0F, 1e-5F);
  EXPECT_NEAR(solver->state().positions_mm[0].z(), -1.0F, 1e-5F);
  EXPECT_NEAR(solver->state().positions_mm[0].x(), 1.0F, 1e-5F);
}

TEST(ReferenceSolver, AGrabCarriesWhatItHoldsAndLeavesNoStaleVelocity) {
  const auto solver =
      simulation::make_reference_solver(testing_::loose_points({{0, 0, 0}, {1, 0, 0}}), undamped());
  solver->hold({{0, 1.0F}});
  solver->set_grab_velocity({10.0, 0.0, -5.0});
  solver->step(10, 0.01);
  EXPECT_NEAR((solver->state().positions_mm[0] - Eigen::Vector3f(1.0F, 0.0F, -0.5F)).norm(), 0.0F, 1e-6F);
  EXPECT_EQ(solver->state().velocities_mm_per_s[0], Eigen::Vector3f(10.0F, 0.0F, -5.0F));
  EXPECT_EQ(solver->state().positions_mm[1], Eigen::Vector3f(1.0F, 0.0F, 0.0F));
  solver->set_grab_velocity(Eigen::Vector3d::Zero());
  EXPECT_EQ(solver->state().velocities_mm_per_s[0], Eigen::Vector3f::Zero());
  solver->step(10, 0.01);
  EXPECT_NEAR(solver->state().positions_mm[0].x(), 1.0F, 1e-6F);
}

TEST(ReferenceSolver, CoincidentPointsGiveNoForceAndNoNaN) {
  auto tissue = testing_::loose_points({{1, 1, 1}, {1, 1, 1}, {2, 1, 1}});
  tissue->links.pairs = {{0, 1}, {0, 2}};
  tissue->links.rest_lengths_mm = {0.0F, 1.0F};
  const auto solver = simulation::make_reference_solver(tissue, Parameters());
  solver->step(20, 0.001);
  EXPECT_TRUE(solver->health().finite);
  EXPECT_EQ(solver->health().max_displacement_mm, 0.0F);
}

TEST(ReferenceSolver, SnapshotsBringBackStateAndTime) {
  const auto solver = simulation::make_reference_solver(testing_::cube_tissue(3), Parameters());
  EXPECT_THROW(solver->restore_snapshot(), palpate::core::Error);
  solver->set_state(disturbed(*solver, 0.1, 1.0));
  solver->step(3, 0.001);
  solver->save_snapshot();
  const State saved = solver->state();
  solver->step(5, 0.001);
  EXPECT_NE(solver->state().positions_mm, saved.positions_mm);
  solver->restore_snapshot();
  EXPECT_EQ(solver->state().positions_mm, saved.positions_mm);
  EXPECT_EQ(solver->state().velocities_mm_per_s, saved.velocities_mm_per_s);
  EXPECT_DOUBLE_EQ(solver->time_s(), 0.003);
}

TEST(ReferenceSolver, WhatDoesNotFitIsRefused) {
  const auto solver = simulation::make_reference_solver(testing_::cube_tissue(2), Parameters());
  EXPECT_THROW(solver->set_state(State{}), palpate::core::Error);
  EXPECT_THROW(solver->hold({{8, 1.0F}}), palpate::core::Error);
  EXPECT_THROW(solver->hold({{0, 1.5F}}), palpate::core::Error);
  EXPECT_THROW(solver->hold({{0, std::nanf("")}}), palpate::core::Error);
}
