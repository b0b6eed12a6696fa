// The implicit scheme: its polynomial and its amplification on paper, its
// order, its states at rest, and what it must survive.
#include "implicit_plan.hpp"

#include "palpate/simulation/solver.hpp"
#include "palpate/testing/cube_tissue.hpp"
#include "palpate/testing/support.hpp"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::ImplicitPlan;
using simulation::Integrator;
using simulation::Material;
using simulation::Parameters;
using simulation::State;

namespace {

/// From a tissue with nothing stiff to k = 1e9, c = 1e6, h = 1 s and a mass of 1e-3.
const std::vector<double> spreads{1.0, 1.0 + 1e-9, 1.1, 2.0, 10.0, 60.0, 600.0, 1e4, 1e8, 1e14, 1e17};

/// The plan as a device has it: in single precision.
ImplicitPlan in_float(ImplicitPlan plan) {
  for (auto& [momentum, rate] : plan.iterations) {
    momentum = static_cast<double>(static_cast<float>(momentum));
    rate = static_cast<double>(static_cast<float>(rate));
  }
  return plan;
}

/// What a step multiplies x and h v of one mode by: hw = h omega, u = (1 - e)/(1 + h mu + hw^2) b.
double growth(double hw, double zeta, double e) {
  const double stiff = hw * hw;
  const double rest = 2.0 * zeta * hw + stiff;  // of the matrix without its mass
  const double q = (1.0 - e) / (1.0 + rest);
  Eigen::Matrix2d step;
  step << 1.0 - q * stiff, 1.0 - q * rest,  //
      -q * stiff, 1.0 - q * rest;
  return step.eigenvalues().cwiseAbs().maxCoeff();
}

Parameters stiff() {
  Parameters parameters;
  parameters.stiffness_per_s2 = 1e6;
  parameters.integrator = Integrator::implicit_euler;
  return parameters;
}

double largest_distance(const State& a, const State& b) {
  double largest = 0.0;
  for (std::size_t n = 0; n < a.positions_mm.size(); ++n)
    largest = std::max(largest, static_cast<double>((a.positions_mm[n] - b.positions_mm[n]).norm()));
  return largest;
}

/// The points of the cube's face with the smallest (or largest) z.
std::vector<std::uint32_t> face(int side, bool top) {
  std::vector<std::uint32_t> points;
  const auto area = static_cast<std::uint32_t>(side * side);
  for (std::uint32_t n = 0; n < area; ++n)
    points.push_back(top ? area * static_cast<std::uint32_t>(side - 1) + n : n);
  return points;
}

Material anchored(int side) {
  Material material;
  material.anchors = face(side, false);
  return material;
}

void run_to_rest(simulation::Solver& solver, double step_s, double most_s) {
  const int batch = std::max(1, static_cast<int>(0.1 / step_s));
  for (double t = 0.0; t < most_s; t += batch * step_s) {
    solver.step(batch, step_s);
    if (solver.health().max_speed_mm_per_s < 1e-3F) return;
  }
  FAIL() << "not at rest after " << most_s << " s: " << solver.health().max_speed_mm_per_s << " mm/s";
}

}  // namespace

TEST(ImplicitPlan, StaysWithinItsRippleOverAllEigenvalues) {
  for (const double spread : spreads) {
    const ImplicitPlan plan = in_float(simulation::implicit_plan(spread));
    ASSERT_GE(static_cast<int>(plan.iterations.size()), simulation::implicit_fewest_iterations);
    ASSERT_LE(static_cast<int>(plan.iterations.size()), simulation::implicit_most_iterations);
    EXPECT_LE(plan.ripple, 0.2500001) << spread;  // the design's, and below a third
    EXPECT_EQ(plan.error_at(0.0), 1.0);
    // The coefficients are floats, each off by up to 6e-8, and up to 100 in size.
    EXPECT_NEAR(plan.error_at(1.0), 0.0, 1e-4) << spread;
    for (int n = 0; n <= 20000; ++n) {
      const double eigenvalue = std::pow(n / 20000.0, 4.0);
      const double e = plan.error_at(eigenvalue);
      ASSERT_LE(e, 1.0) << spread << ' ' << eigenvalue;
      ASSERT_GE(e, -plan.ripple - 1e-4) << spread << ' ' << eigenvalue;
    }
  }
}

TEST(ImplicitPlan, ReachesItsRippleWhereTheIterationsSuffice) {
  for (const double spread : {1.1, 2.0, 10.0, 30.0, 60.0}) {
    const ImplicitPlan plan = simulation::implicit_plan(spread);
    ASSERT_LT(static_cast<int>(plan.iterations.size()), simulation::implicit_most_iterations);
    for (int n = 0; n <= 1000; ++n) {
      const double eigenvalue = 1.0 / spread + (1.0 - 1.0 / spread) * n / 1000.0;
      EXPECT_LE(std::abs(plan.error_at(eigenvalue)), plan.ripple + 1e-9);
    }
    EXPECT_NEAR(plan.error_at(1.0 / spread), 0.0, 1e-9);
  }
}

TEST(ImplicitScheme, AmplifiesNoModeWhateverItsStiffnessAndDamping) {
  for (const double spread : spreads) {
    const ImplicitPlan plan = in_float(simulation::implicit_plan(spread));
    for (int place = 1; place <= 60; ++place) {
      // A truncated solve meets a mode anywhere in (0, 1].
      const double e = plan.error_at(std::pow(place / 60.0, 4.0));
      for (double hw = 1e-3; hw < 1e8; hw *= 1.7) {
        ASSERT_LE(growth(hw, 0.0, e), 1.0 + 1e-9) << spread << ' ' << e << ' ' << hw;
        for (double zeta = 1e-4; zeta < 1e5; zeta *= 2.3)
          ASSERT_LE(growth(hw, zeta, e), 1.0 + 1e-9) << spread << ' ' << e << ' ' << hw << ' ' << zeta;
      }
    }
  }
  // Where it would end: just below a third.
  EXPECT_GT(growth(1e4, 0.0, -0.34), 1.0);
  EXPECT_LT(growth(1e4, 0.0, -0.33), 1.0);
}

TEST(ImplicitScheme, IsOfFirstOrderOnTheThesisOscillator) {
  const auto error = [](double h) {
    Parameters parameters;
    parameters.stiffness_per_s2 = 45.0;
    parameters.drag_per_s = 0.0;
    parameters.integrator = Integrator::implicit_euler;
    const auto solver = simulation::make_reference_solver(testing_::oscillator_tissue(), parameters);
    solver->hold({{0, 1.0F}});
    solver->step(static_cast<int>(std::lround(1.0 / h)), h);
    return std::abs(static_cast<double>(solver->state().positions_mm[1].x()) -
                    testing_::oscillator_place(1.0));
  };
  const double coarse = error(0.0025);
  const double fine = error(0.00125);
  const double finest = error(0.000625);
  EXPECT_NEAR(std::log2(coarse / fine), 1.0, 0.1);
  EXPECT_NEAR(std::log2(fine / finest), 1.0, 0.1);
}

TEST(ImplicitScheme, ComesToTheSameRestUnderGravityAsRk4) {
  // k = 1e6 and the thesis' step, 12 links; gravity that bends a cube of 6 mm by a part of a millimetre.
  const auto tissue = testing_::cube_tissue(6);
  Parameters parameters = stiff();
  parameters.gravity_mm_per_s2 = {2e4, 0.0, 5e4};
  parameters.drag_per_s = 50.0;  // both come to rest soon; drag has no say in where
  const auto implicit = simulation::make_reference_solver(tissue, parameters, anchored(6));
  run_to_rest(*implicit, 0.006, 20.0);
  parameters.integrator = Integrator::rk4;
  const auto explicit_ = simulation::make_reference_solver(tissue, parameters, anchored(6));
  run_to_rest(*explicit_, 0.0003, 2.0);
  const double sag_mm = static_cast<double>(explicit_->health().max_displacement_mm);
  EXPECT_GT(sag_mm, 0.2);
  // A speed of 1e-3 mm/s is what is left of the way there: far below 1 %.
  EXPECT_LT(largest_distance(implicit->state(), explicit_->state()), 0.01 * sag_mm);
}

TEST(ImplicitScheme, ComesToTheSameRestUnderAPullAsRk4) {
  const auto tissue = testing_::cube_tissue(6);
  Parameters parameters = stiff();
  parameters.drag_per_s = 50.0;
  std::vector<simulation::HeldPoint> held;
  for (const std::uint32_t point : face(6, true)) held.push_back({point, 1.0F});
  const auto pulled = [&](Integrator integrator, double step_s, int steps) {
    parameters.integrator = integrator;
    auto solver = simulation::make_reference_solver(tissue, parameters, anchored(6));
    solver->hold(held);
    solver->set_grab_velocity({5.0, 0.0, 5.0});  // 0.6 mm along x and z in 0.12 s
    solver->step(steps, step_s);
    solver->set_grab_velocity({0.0, 0.0, 0.0});
    run_to_rest(*solver, step_s, 20.0);
    return solver->state();
  };
  const State implicit = pulled(Integrator::implicit_euler, 0.006, 20);
  const State explicit_ = pulled(Integrator::rk4, 0.0003, 400);
  EXPECT_LT(largest_distance(implicit, explicit_), 0.01 * 0.6 * std::sqrt(2.0));
}

TEST(ImplicitScheme, PullsStiffTissueAtTheThesisStepWithoutBlowingUp) {
  Parameters parameters = stiff();
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -9810.0};
  const auto solver = simulation::make_reference_solver(testing_::cube_tissue(6), parameters, anchored(6));
  std::vector<simulation::HeldPoint> held;
  for (const std::uint32_t point : face(6, true))
    held.push_back({point, 0.25F * static_cast<float>(point % 5)});
  solver->hold(held);
  solver->set_grab_velocity({8.0, 0.0, 13.0});  // 2.9 and 4.7 mm in 60 steps
  for (int n = 0; n < 60; ++n) {
    solver->step(1, 0.006);
    ASSERT_TRUE(solver->health().finite);
    // No point runs ahead of the hand, with gravity, by more than the cube is wide.
    ASSERT_LT(solver->health().max_displacement_mm, 12.0F);
  }
  solver->set_grab_velocity({0.0, 0.0, 0.0});
  solver->hold({});
  solver->step(2000, 0.006);
  EXPECT_LT(solver->health().max_speed_mm_per_s, 1.0F);
}

TEST(ImplicitScheme, KeepsTheMomentumOfAFreeBodyHoweverRoughlyItSolves) {
  Parameters parameters = stiff();
  parameters.drag_per_s = 0.0;
  const auto solver = simulation::make_reference_solver(testing_::cube_tissue(5), parameters);
  State state = solver->state();
  testing_::Numbers numbers(3);
  for (auto& x : state.positions_mm) x += numbers.vector(0.1);
  for (auto& v : state.velocities_mm_per_s) v = numbers.vector(20.0) + Eigen::Vector3f(3.0F, -2.0F, 1.0F);
  solver->set_state(state);
  const Eigen::Vector3d before = solver->energy().momentum;
  solver->step(100, 0.006);
  // The state comes back in floats: 125 velocities of about 4 mm/s, each off by up to 2.4e-7.
  EXPECT_LT((solver->energy().momentum - before).norm(), 1e-4);
  EXPECT_GT(before.norm(), 100.0);
}

TEST(ImplicitScheme, TakesALonePointThroughAFallExactly) {
  Parameters parameters = stiff();
  parameters.drag_per_s = 0.0;
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -1000.0};
  auto tissue = testing_::cube_tissue(3);
  tissue->points.positions_mm.emplace_back(20.0F, 0.0F, 0.0F);  // no link reaches it
  tissue->points.voxels.push_back({20, 0, 0});
  tissue->points.intensities.push_back(1.0F);
  const auto solver = simulation::make_reference_solver(tissue, parameters);
  solver->step(10, 0.01);
  // Backward Euler: v = n g h, fallen g h^2 n(n + 1)/2 = 5.5 mm; floats.
  EXPECT_NEAR(solver->state().velocities_mm_per_s.back().z(), -100.0F, 1e-4F);
  EXPECT_NEAR(solver->state().positions_mm.back().z(), -5.5F, 1e-5F);
}

TEST(ImplicitScheme, LetsTissueFallAsItShouldWhereTheIterationsSuffice) {
  for (const double stiffness : {1e3, 1e4, 1e5}) {
    Parameters parameters = stiff();
    parameters.stiffness_per_s2 = stiffness;
    parameters.drag_per_s = 0.0;
    parameters.gravity_mm_per_s2 = {0.0, 0.0, -1000.0};
    const auto tissue = testing_::cube_tissue(5);
    const auto solver = simulation::make_reference_solver(tissue, parameters);
    solver->step(10, 0.006);
    // Every point, as a lone one: the state is in floats.
    for (const auto& v : solver->state().velocities_mm_per_s)
      EXPECT_LT((v - Eigen::Vector3f(0.0F, 0.0F, -60.0F)).norm(), 1e-3F) << stiffness;
  }
}

TEST(ImplicitScheme, StaysFiniteAndNearOverTheWholeRangeOfParameters) {
  testing_::Numbers numbers(11);
  const auto among = [&](double low, double high) {
    return low * std::pow(high / low, numbers.between(0.0, 1.0));
  };
  const int runs = testing_::repetitions(20, 200);
  for (int run = 0; run < runs; ++run) {
    Parameters parameters;
    parameters.integrator = Integrator::implicit_euler;
    parameters.stiffness_per_s2 = run % 10 == 9 ? 0.0 : among(1.0, 1e9);
    parameters.damping_per_s = run % 4 == 3 ? 0.0 : among(1e-2, 1e6);
    parameters.drag_per_s = among(1e-2, 1e4);
    parameters.mass = among(1e-3, 1e3);
    parameters.beat_amplitude = run % 3 == 0 ? 0.3 : 0.0;
    const double step_s = among(1e-4, 1.0);
    Material material = anchored(4);
    material.scales_stiffness = run % 2 == 0;
    material.scales_mass = run % 5 == 0;
    auto tissue = testing_::cube_tissue(4, run % 3 == 1 ? 6 : 12, 0.1, static_cast<std::uint32_t>(run));
    for (std::size_t n = 0; n < tissue->points.size(); ++n)
      material.factors.push_back(static_cast<float>(among(0.1, 10.0)));
    const auto solver = simulation::make_reference_solver(tissue, parameters, material);
    solver->set_links_alive({0, 3, 17}, false);
    State state = solver->state();
    const double apart_mm = among(0.01, 10.0);
    for (auto& x : state.positions_mm) x += numbers.vector(apart_mm);
    solver->set_state(state);
    std::vector<simulation::HeldPoint> held;
    for (const std::uint32_t point : face(4, true))
      held.push_back({point, static_cast<float>(numbers.between(0.0, 1.0))});
    solver->hold(held);
    solver->set_grab_velocity({0.0, 0.0, 1.0 / step_s});  // 20 mm in 20 steps
    for (int n = 0; n < 200; ++n) {
      solver->step(1, step_s);
      if (n == 20) solver->set_grab_velocity({0.0, 0.0, 0.0});
      if (n == 40) solver->hold({});
      const auto health = solver->health();
      // What is thrown about comes from the start and the hand: 20 mm, and
      // inertia that carries loose points on for a while.
      ASSERT_TRUE(health.finite) << run << ' ' << n;
      ASSERT_LT(health.max_displacement_mm, 400.0F)
          << run << ' ' << n << " k " << parameters.stiffness_per_s2 << " c " << parameters.damping_per_s
          << " D " << parameters.drag_per_s << " m " << parameters.mass << " h " << step_s;
    }
  }
}
