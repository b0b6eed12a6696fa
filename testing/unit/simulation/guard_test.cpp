#include "palpate/simulation/guard.hpp"

#include "stability_model.hpp"

#include "palpate/simulation/stability.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::Guard;
using simulation::Integrator;
using simulation::Parameters;

namespace {

/// A solver that is lost as soon as a step is longer than `good_below_s`.
class Fragile final : public simulation::Solver {
 public:
  explicit Fragile(double good_below_limit_s)
      : Solver(testing_::cube_tissue(2)), good_below_s(good_below_limit_s) {}
  void step(int count, double step_s) override {
    healthy = healthy && step_s < good_below_s;
    steps += count;
    time += count * step_s;
    if (on_step) on_step(steps);
  }
  void hold(const std::vector<simulation::HeldPoint>&) override {}
  void set_grab_velocity(const Eigen::Vector3d&) override {}
  void set_parameters(const Parameters&) override {}
  const Parameters& parameters() const override { return parameters_; }
  simulation::State state() const override { return {}; }
  void set_state(const simulation::State&) override {}
  void save_snapshot() override {
    saved_time = time;
    saved_energy = energy;
  }
  void restore_snapshot() override {
    time = saved_time;
    healthy = true;
    displacement_mm = 0.0F;
    energy = saved_energy;
  }
  double time_s() const override { return time; }
  simulation::Health health() override { return {healthy, displacement_mm, speed_mm_per_s}; }
  simulation::LinkHealth link_health() override {
    ++looks;
    return {energy, 0.0, strain_rate_per_s};
  }
  const palpate::compute::Buffer* positions_buffer() const override { return nullptr; }
  std::string device_name() const override { return "fragile"; }
  std::string driver() const override { return {}; }
  std::string layout() const override { return "explicit"; }
  std::size_t bytes() const override { return 0; }

  bool healthy = true;
  float displacement_mm = 0.0F;
  float speed_mm_per_s = 0.0F;
  double energy = 0.0;
  float strain_rate_per_s = 0.0F;
  int looks = 0;
  double good_below_s;
  double saved_time = 0.0;
  double saved_energy = 0.0;
  int steps = 0;
  double time = 0.0;
  std::function<void(int)> on_step;

 private:
  Parameters parameters_;
};

}  // namespace

TEST(Guard, AGoodBatchIsLeftAlone) {
  Fragile solver(1.0);
  Guard guard(solver, 0.5);
  const auto report = guard.advance(10);
  EXPECT_EQ(report.steps_done, 10);
  EXPECT_FALSE(report.recovered);
  EXPECT_FALSE(report.paused);
  EXPECT_EQ(guard.recoveries(), 0);
  EXPECT_DOUBLE_EQ(solver.time, 5.0);
}

TEST(Guard, ALostBatchIsDoneAgainInHalvedStepsOverTheSameTime) {
  Fragile solver(0.3);
  Guard guard(solver, 1.0);
  const auto report = guard.advance(3);
  EXPECT_TRUE(report.recovered);
  EXPECT_FALSE(report.paused);
  EXPECT_EQ(report.steps_done, 12);
  EXPECT_EQ(guard.recoveries(), 2);
  EXPECT_DOUBLE_EQ(guard.step_s(), 0.25);
  EXPECT_DOUBLE_EQ(solver.time, 3.0);
  EXPECT_THAT(report.message, ::testing::HasSubstr("0.25"));
  EXPECT_FALSE(guard.advance(3).recovered);  // the smaller step stays
}

TEST(Guard, GivesUpAfterItsHalvingsAndStaysPausedUntilCleared) {
  Fragile solver(0.0);
  Guard guard(solver, 1.0, 3);
  const auto report = guard.advance(5);
  EXPECT_TRUE(report.paused);
  EXPECT_TRUE(guard.diverged());
  EXPECT_EQ(guard.recoveries(), 3);
  EXPECT_EQ(report.steps_done, 0);
  EXPECT_TRUE(solver.healthy);  // the last good state is back
  EXPECT_DOUBLE_EQ(solver.time, 0.0);
  EXPECT_EQ(solver.steps, 4 * 5);  // each hopeless step size was left after one look
  EXPECT_FALSE(report.message.empty());
  EXPECT_TRUE(guard.advance(5).paused);
  EXPECT_EQ(solver.steps, 4 * 5);
  guard.clear();
  EXPECT_FALSE(guard.diverged());
  EXPECT_EQ(guard.recoveries(), 0);
}

TEST(Guard, WhatFallsOutOfTheBoxIsGivenUpSoon) {
  simulation::Parameters parameters;
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -1e6};
  parameters.drag_per_s = 0.0;
  const auto tissue = testing_::cube_tissue(4);
  const auto solver = simulation::make_reference_solver(tissue, parameters);
  Guard guard(*solver, simulation::automatic_step_s(simulation::stable_step(*tissue, parameters)));
  simulation::GuardReport report;
  for (int batch = 0; batch < 1000 && !report.paused; ++batch) report = guard.advance(16);
  EXPECT_TRUE(report.paused);
  // Five sizes in a row were lost at the same time; the first of them is not the first tried.
  EXPECT_LE(guard.recoveries(), 6);
  EXPECT_THAT(report.message, ::testing::HasSubstr("gravity"));
  EXPECT_TRUE(solver->health().finite);
}

TEST(Guard, DoingATimeAgainCanBeCancelled) {
  Fragile solver(1e-3);
  const palpate::core::CancelToken cancel;
  Guard guard(solver, 1.0, Guard::usual_halvings, cancel);
  // Ten halvings are needed: 16 steps become 16384.
  solver.on_step = [&](int steps) {
    if (steps > 1000) cancel.cancel();
  };
  try {
    guard.advance(16);
    FAIL() << "it went on to the end";
  } catch (const palpate::core::Error& error) {
    EXPECT_EQ(error.kind(), palpate::core::ErrorKind::cancelled);
  }
  EXPECT_LE(solver.steps, 1000 + 2 * 16);
}

TEST(Guard, AThousandTimesItsSizeAwayIsLost) {
  Fragile solver(1.0);
  Guard guard(solver, 0.1);
  solver.displacement_mm = static_cast<float>(999.0 * solver.extent_mm());
  EXPECT_FALSE(guard.advance(1).paused);
  solver.displacement_mm = static_cast<float>(1001.0 * solver.extent_mm());
  EXPECT_TRUE(guard.advance(1).paused);
  guard.clear();
  solver.displacement_mm = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(guard.advance(1).paused);
}

TEST(Guard, RecoversARealBlowUp) {
  const auto tissue = testing_::cube_tissue(4);
  const Parameters parameters;
  const auto solver = simulation::make_reference_solver(tissue, parameters);
  auto state = solver->state();
  testing_::Numbers numbers(2);
  for (auto& x : state.positions_mm) x += numbers.vector(0.05);
  solver->set_state(state);
  // The bound is at most 30 % under the true limit (see StableStep), so this is 1.3 times the limit and more.
  Guard guard(*solver, 1.3 / 0.7 * simulation::stable_step(*tissue, parameters).step_s);
  const double time = 400 * guard.step_s();
  EXPECT_FALSE(guard.advance(400).paused);
  EXPECT_GT(guard.recoveries(), 0);
  EXPECT_NEAR(solver->time_s(), time, 1e-9);
  EXPECT_TRUE(solver->health().finite);
  EXPECT_LT(solver->health().max_displacement_mm, 0.2F);  // back near rest, not scrambled
}

TEST(Guard, InSmallBatchesItGoesBackToAStateFromBeforeTheBlowUp) {
  // A blow-up stays finite for many short batches; none of those may become the state that is restored.
  const auto tissue = testing_::cube_tissue(5);
  const Parameters parameters;
  for (const double over : {1.3, 1.6, 2.5}) {
    const auto solver = simulation::make_reference_solver(tissue, parameters);
    auto state = solver->state();
    testing_::Numbers numbers(2);
    for (auto& x : state.positions_mm) x += numbers.vector(0.05);
    solver->set_state(state);
    Guard guard(*solver, over / 0.8 * simulation::stable_step(*tissue, parameters).step_s);
    for (int frame = 0; frame < 400 && guard.recoveries() == 0; ++frame) guard.advance(1);
    ASSERT_GT(guard.recoveries(), 0) << over;
    EXPECT_FALSE(guard.diverged()) << over;
    // Half a link: nothing is scrambled. (Over twice the limit, half the step is still too long.)
    if (over < 2.0) {
      EXPECT_LT(solver->health().max_displacement_mm, 0.5F) << over;
    }
    for (int frame = 0; frame < 400; ++frame) guard.advance(1);
    EXPECT_LT(solver->health().max_displacement_mm, 0.2F) << over;
    EXPECT_LE(guard.recoveries(), 3) << over;
  }
}

TEST(Guard, TheTimeSinceTheSnapshotIsDoneAgain) {
  Fragile solver(1.5);
  Guard guard(solver, 1.0);
  solver.speed_mm_per_s = 10.0F;  // more than half a link a step: not calm, no new snapshot
  for (int batch = 0; batch < 4; ++batch) guard.advance(5);
  EXPECT_DOUBLE_EQ(solver.time, 20.0);
  EXPECT_DOUBLE_EQ(solver.saved_time, 0.0);
  solver.good_below_s = 0.7;
  const auto report = guard.advance(5);
  EXPECT_TRUE(report.recovered);
  EXPECT_EQ(report.steps_done, 10);
  EXPECT_DOUBLE_EQ(solver.time, 25.0);
  EXPECT_EQ(solver.steps, 20 + 5 + 50);
  // What has lasted for a hundred steps is kept after all.
  for (int batch = 0; batch < 10; ++batch) guard.advance(10);
  EXPECT_GT(solver.saved_time, 20.0);
}

TEST(Guard, AStateSetFromOutsideIsWhatItGoesBackTo) {
  Fragile solver(1.5);
  Guard guard(solver, 1.0);
  solver.speed_mm_per_s = 10.0F;
  guard.advance(5);
  solver.time = 70.0;  // as set_state() does
  guard.advance(5);
  EXPECT_DOUBLE_EQ(solver.saved_time, 70.0);
  guard.set_step_s(0.5);
  guard.advance(2);
  EXPECT_DOUBLE_EQ(solver.saved_time, 75.0);
}

TEST(Guard, AStateThatWasNeverFinitePausesWithTheLastGoodOneKept) {
  const auto solver = simulation::make_reference_solver(testing_::cube_tissue(3), Parameters());
  Guard guard(*solver, 0.001);
  EXPECT_FALSE(guard.advance(5).paused);
  const auto good = solver->state();
  auto broken = good;
  broken.positions_mm[4].y() = std::numeric_limits<float>::quiet_NaN();
  solver->set_state(broken);
  const auto report = guard.advance(5);
  EXPECT_TRUE(report.paused);
  EXPECT_TRUE(guard.diverged());
  EXPECT_EQ(report.steps_done, 0);
  EXPECT_TRUE(solver->health().finite);
  EXPECT_FALSE(report.message.empty());
}

// ---- the watch over the links

TEST(Guard, AJitterThatSaturatesIsCaught) {
  // A few per cent above the limit the fastest modes grow out of the rounding and
  // then stay, finite and small. A step of half the size has none of it.
  const auto tissue = testing_::cube_tissue(6);
  for (const auto scheme :
       {Integrator::rk4, Integrator::symplectic_euler, Integrator::verlet, Integrator::velocity_verlet}) {
    Parameters parameters;
    parameters.integrator = scheme;
    const double near = simulation::estimated_stable_step(*tissue, parameters).step_s;
    const double limit = testing_::measured_limit(tissue, parameters, near);
    for (const double over : {1.02, 1.05, 1.1, 1.3}) {
      const auto solver = simulation::make_reference_solver(tissue, parameters);
      auto state = solver->state();
      testing_::Numbers numbers(3);
      for (auto& x : state.positions_mm) x += numbers.vector(1e-5);
      solver->set_state(state);
      Guard guard(*solver, over * limit);
      for (int batch = 0; batch < 60 && guard.recoveries() == 0; ++batch) guard.advance(16);
      EXPECT_EQ(guard.recoveries(), 1) << to_string(scheme) << " at " << over;
      EXPECT_FALSE(guard.diverged()) << to_string(scheme) << " at " << over;
      // Back to a state before it could be seen: a hundredth of a link.
      EXPECT_LT(solver->health().max_displacement_mm, 0.01F) << to_string(scheme) << " at " << over;
      for (int batch = 0; batch < 20; ++batch) guard.advance(16);
      EXPECT_EQ(guard.recoveries(), 1) << to_string(scheme) << " at " << over;
    }
  }
}

namespace {

/// Takes the lower face of a cube of six and pulls it down by `pull_mm` in 0.05 s.
void pull_down(simulation::Solver& solver, Guard& guard, double pull_mm) {
  std::vector<simulation::HeldPoint> held;
  for (std::uint32_t n = 0; n < 36; ++n) held.push_back({n, n < 18 ? 1.0F : 0.5F});
  solver.hold(held);
  const double end_s = solver.time_s() + 0.05;
  solver.set_grab_velocity({0.0, 0.0, -pull_mm / 0.05});
  while (solver.time_s() < end_s) {
    guard.disturbed();
    guard.advance(4);
  }
  solver.set_grab_velocity(Eigen::Vector3d::Zero());
  guard.disturbed();
  guard.advance(4);
  solver.hold({});
}

}  // namespace

TEST(Guard, AReleasedPullNeverTripsIt) {
  const auto tissue = testing_::cube_tissue(6);
  for (const auto scheme : {Integrator::rk4, Integrator::symplectic_euler, Integrator::velocity_verlet})
    for (const double stiffness : {1e3, 1e4, 1e5, 1e6})
      for (const double pull_mm : {2.0, 4.0}) {
        Parameters parameters;
        parameters.integrator = scheme;
        parameters.stiffness_per_s2 = stiffness;
        const double h = 0.9 * simulation::estimated_stable_step(*tissue, parameters).step_s;
        const auto solver = simulation::make_reference_solver(tissue, parameters);
        Guard guard(*solver, h);
        for (int pulls = 0; pulls < 2; ++pulls) {
          pull_down(*solver, guard, pull_mm);
          for (int batch = 0; batch < 30; ++batch) EXPECT_FALSE(guard.advance(16).paused);
        }
        EXPECT_EQ(guard.recoveries(), 0)
            << to_string(scheme) << ", k " << stiffness << ", " << pull_mm << " mm";
      }
}

TEST(Guard, EnergyThatRisesOfItselfHalvesTheStep) {
  Fragile solver(10.0);
  Guard guard(solver, 1.0);
  solver.energy = 100.0;
  guard.advance(10);
  double last_step = 1.0;
  solver.on_step = [&](int) {
    last_step = guard.step_s();
    if (last_step > 0.6) solver.energy *= 3.0;
  };
  double time = 10.0;
  for (int batch = 0; batch < 4; ++batch) {
    time += 10.0 * guard.step_s();
    guard.advance(10);
  }
  EXPECT_EQ(guard.recoveries(), 1);
  EXPECT_EQ(guard.step_s(), 0.5);
  EXPECT_EQ(solver.energy, 100.0);
  EXPECT_DOUBLE_EQ(solver.time, time);
}

TEST(Guard, EnergyThatIsBroughtInIsNoFault) {
  Fragile solver(10.0);
  Guard guard(solver, 1.0);
  solver.energy = 100.0;
  solver.on_step = [&](int) { solver.energy *= 3.0; };
  for (int batch = 0; batch < 10; ++batch) {
    guard.disturbed();
    guard.advance(10);
  }
  EXPECT_EQ(guard.recoveries(), 0);
  EXPECT_EQ(guard.step_s(), 1.0);
}

TEST(Guard, WhatSmallerStepsSeeTooIsLeftAlone) {
  // Energy comes in at a certain time, whatever the step, and nobody told.
  Fragile solver(10.0);
  Guard guard(solver, 1.0);
  solver.energy = 1.0;
  solver.on_step = [&](int) { solver.energy = solver.time > 100.0 ? 5.0 : 1.0; };
  for (int batch = 0; batch < 40; ++batch) EXPECT_FALSE(guard.advance(10).recovered);
  EXPECT_EQ(guard.recoveries(), 0);
  EXPECT_EQ(guard.step_s(), 1.0);
  EXPECT_DOUBLE_EQ(solver.time, 400.0);
  EXPECT_LT(solver.steps, 400 + 40 * 15) << "done again a few times, not for ever";
}

TEST(Guard, LooksAtLinksEveryFortyEvaluationsOfTheForces) {
  Fragile solver(10.0);
  Guard guard(solver, 1.0);
  for (int batch = 0; batch < 100; ++batch) guard.advance(4);
  // 400 steps of RK4: 40 looks, and the one at the beginning.
  EXPECT_GE(solver.looks, 30);
  EXPECT_LE(solver.looks, 41);
}

TEST(Guard, LinksThatKeepChangingByHalfWhileEnergyGrowsAreLostOnceNoHandIsAtThem) {
  Fragile solver(10.0);
  Guard guard(solver, 1.0);
  solver.energy = 1.0;
  solver.strain_rate_per_s = 0.7F;
  const auto batches = [&](int count, bool by_hand) {
    for (int batch = 0; batch < count; ++batch) {
      if (by_hand) guard.disturbed();  // as a drag does
      guard.advance(10);
    }
  };
  batches(10, false);
  EXPECT_EQ(guard.recoveries(), 0) << "fast, but nothing grows";
  solver.on_step = [&](int) {
    if (guard.step_s() > 0.6) solver.energy *= 1.2;
  };
  batches(10, true);
  EXPECT_EQ(guard.recoveries(), 0) << "the hand does that";
  batches(10, false);
  EXPECT_EQ(guard.recoveries(), 1);
  EXPECT_EQ(guard.step_s(), 0.5);
}

// A corner pulled out by twelve links, one and a half in each step.
TEST(Guard, ADragOfManyLinksInFewStepsIsNoFaultOfTheStep) {
  const auto tissue = testing_::cube_tissue(6);
  const Parameters parameters;
  const auto solver = simulation::make_reference_solver(tissue, parameters);
  const double step_s = 0.6 * simulation::stable_step(*tissue, parameters).step_s;
  Guard guard(*solver, step_s);
  const auto last = static_cast<std::uint32_t>(tissue->points.size() - 1);
  solver->hold({{last, 1.0F}, {last - 1, 1.0F}, {last - 6, 1.0F}});
  solver->set_grab_velocity({1.5 / step_s, 0.0, 0.0});
  for (int n = 0; n < 8; ++n) {
    guard.disturbed();
    guard.advance(1);
  }
  solver->set_grab_velocity(Eigen::Vector3d::Zero());
  guard.disturbed();
  for (int n = 0; n < 30; ++n) guard.advance(10);
  EXPECT_EQ(guard.recoveries(), 0);
  EXPECT_FALSE(guard.diverged());
  EXPECT_GT(solver->health().max_displacement_mm, 11.9F);
}
