// kernels/explicit.cl, grab.cl and health.cl against the reference solver
// in double precision and against what is known exactly.
#include "palpate/simulation/solver.hpp"

#include "device_test.hpp"

#include "palpate/simulation/guard.hpp"
#include "palpate/simulation/stability.hpp"
#include "palpate/testing/cube_tissue.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace model = palpate::model;
namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::Parameters;
using simulation::Solver;
using simulation::State;

namespace {

class OpenclSolver : public testing_::DeviceTest {
 protected:
  std::unique_ptr<Solver> solver(const std::shared_ptr<model::Tissue>& tissue, const Parameters& parameters,
                                 unsigned points_per_item = 0) const {
    return simulation::make_opencl_solver(device(), tissue, parameters,
                                          {points_per_item, simulation::LayoutChoice::explicit_links});
  }
};

std::vector<simulation::HeldPoint> corner_of(const model::Tissue& tissue, float radius_mm) {
  const Eigen::Vector3f corner = tissue.points.positions_mm.back();
  std::vector<simulation::HeldPoint> held;
  for (std::uint32_t n = 0; n < tissue.points.size(); ++n) {
    const float distance = (tissue.points.positions_mm[n] - corner).norm();
    if (distance < radius_mm) held.push_back({n, 1.0F - distance / radius_mm});
  }
  return held;
}

/// A pull of one corner (fuzzy selection), a rest in the hand, a release: 500 steps.
void pull(Solver& solver, const std::vector<simulation::HeldPoint>& held, double h) {
  solver.hold(held);
  solver.set_grab_velocity({4.0, 2.0, 3.0});
  solver.step(200, h);
  solver.set_grab_velocity(Eigen::Vector3d::Zero());
  solver.step(100, h);
  solver.hold({});
  solver.step(200, h);
}

float furthest(const std::vector<Eigen::Vector3f>& a, const std::vector<Eigen::Vector3f>& b) {
  float largest = 0.0F;
  for (std::size_t n = 0; n < a.size(); ++n) {
    const float apart = (a[n] - b[n]).norm();
    if (!(apart <= largest)) largest = apart;  // NaN stays
  }
  return largest;
}

State disturbed(const Solver& solver, double displacement_mm, double speed_mm_per_s) {
  State state = solver.state();
  testing_::Numbers numbers(11);
  for (auto& x : state.positions_mm) x += numbers.vector(displacement_mm);
  for (auto& v : state.velocities_mm_per_s) v = numbers.vector(speed_mm_per_s);
  return state;
}

}  // namespace

TEST_F(OpenclSolver, FollowsTheReferenceThroughAPull) {
  const auto tissue = testing_::cube_tissue(10);
  const Parameters parameters;  // the thesis' own
  const double h =
      std::min(0.006, simulation::automatic_step_s(simulation::stable_step(*tissue, parameters)));
  const auto held = corner_of(*tissue, 3.0F);
  const auto opencl = solver(tissue, parameters);
  const auto reference = simulation::make_reference_solver(tissue, parameters);
  pull(*opencl, held, h);
  pull(*reference, held, h);
  EXPECT_NEAR(opencl->time_s(), reference->time_s(), 1e-9);
  const State a = opencl->state();
  const State b = reference->state();
  EXPECT_GT(furthest(b.positions_mm, tissue->points.positions_mm), 0.5F)
      << "the pull must have moved something";
  // Coordinates stay under 16 mm, where a float is off by 5e-7 mm at most. The body floats freely, so
  // nothing takes a shift back: 500 steps, all rounded the same way, come to 2.5e-4 mm.
  EXPECT_LT(furthest(a.positions_mm, b.positions_mm), 2.5e-4F);
  // A place that is off by e makes the stiffest mode's speed off by omega e, 400/s of 5e-7 mm a stage;
  // a few stages' worth of it is left before the dampers have taken it.
  EXPECT_LT(furthest(a.velocities_mm_per_s, b.velocities_mm_per_s), 5e-3F);
  RecordProperty("max_difference_nm", static_cast<int>(1e6F * furthest(a.positions_mm, b.positions_mm)));
}

TEST_F(OpenclSolver, FollowsTheReferenceClosely) {
  // Twenty steps from a disturbed state, links of the six-neighbour rule, gravity and drag on.
  auto tissue = std::make_shared<model::Tissue>(testing_::cube_points(6, 0.1));
  testing_::link_lattice(*tissue, 1);
  Parameters parameters;
  parameters.drag_per_s = 5.0;
  parameters.gravity_mm_per_s2 = {100.0, -9810.0, 300.0};
  const auto reference = simulation::make_reference_solver(tissue, parameters);
  const State start = disturbed(*reference, 0.05, 20.0);
  reference->set_state(start);
  reference->step(20, 0.004);
  EXPECT_GT(furthest(reference->state().positions_mm, start.positions_mm), 10.0F);
  for (const unsigned points_per_item : {1U, 4U, 8U, 16U}) {  // 216 points are no multiple of 16
    const auto opencl = solver(tissue, parameters, points_per_item);
    opencl->set_state(start);
    opencl->step(20, 0.004);
    // Coordinates up to 64 mm (they fall) are off by 2e-6 mm at most, twenty times.
    EXPECT_LT(furthest(opencl->state().positions_mm, reference->state().positions_mm), 4e-5F)
        << points_per_item << " points a work-item";
  }
  EXPECT_THROW(solver(tissue, parameters, 3), palpate::core::Error);
}

TEST_F(OpenclSolver, MeetsTheExactOscillator) {
  Parameters parameters;
  parameters.stiffness_per_s2 = 45.0;
  parameters.damping_per_s = 3.0;
  parameters.drag_per_s = 0.0;
  const auto opencl = solver(testing_::oscillator_tissue(), parameters);
  opencl->hold({{0, 1.0F}});
  for (int second = 1; second <= 2; ++second) {
    opencl->step(100, 0.01);
    // RK4's own error here is under 1e-5; rounding of coordinates to 8 mm adds 1e-6 a step at most.
    EXPECT_NEAR(static_cast<double>(opencl->state().positions_mm[1].x()), testing_::oscillator_place(second),
                1e-4);
  }
  EXPECT_EQ(opencl->state().positions_mm[0], Eigen::Vector3f(-8.0F, 0.0F, 0.0F));
}

TEST_F(OpenclSolver, SelectanceMeansTheSameAsInTheReference) {
  const auto tissue = testing_::cube_tissue(4);
  Parameters parameters;
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -500.0};
  const auto opencl = solver(tissue, parameters);
  const auto reference = simulation::make_reference_solver(tissue, parameters);
  const State start = disturbed(*opencl, 0.02, 10.0);
  for (Solver* each : {opencl.get(), reference.get()}) {
    each->set_state(start);
    each->hold({{3, 0.25F}, {0, 1.0F}, {20, 0.5F}, {20, 0.75F}});  // the last word on point 20 counts
    each->step(10, 0.003);
    each->set_grab_velocity({0.0, 30.0, 0.0});
    each->step(10, 0.003);
  }
  EXPECT_LT(furthest(opencl->state().positions_mm, reference->state().positions_mm),
            1e-5F);  // 40 roundings of 2e-7
  EXPECT_NEAR(opencl->state().positions_mm[0].y(), start.positions_mm[0].y() + 0.9F, 1e-5F);
  EXPECT_EQ(opencl->state().velocities_mm_per_s[0].y(), 30.0F);
  for (Solver* each : {opencl.get(), reference.get()}) each->set_grab_velocity(Eigen::Vector3d::Zero());
  EXPECT_EQ(opencl->state().velocities_mm_per_s[0], Eigen::Vector3f::Zero());
  EXPECT_NEAR(opencl->state().velocities_mm_per_s[20].y(), reference->state().velocities_mm_per_s[20].y(),
              1e-3F);
}

TEST_F(OpenclSolver, KeepsTheMomentumOfAFreeBody) {
  Parameters parameters;
  parameters.drag_per_s = 0.0;
  const auto tissue = testing_::cube_tissue(8);
  const auto opencl = solver(tissue, parameters);
  opencl->set_state(disturbed(*opencl, 0.05, 5.0));
  const auto before = opencl->energy();
  opencl->step(300, 0.003);
  const auto after = opencl->energy();
  // Both ends of a link round its force apart by 1e-7 of k times its extension, some 1e-4 mm/s^2; over
  // 1 s of simulated time and 2000 links at random that is under 1e-2 mm/s, of thousands.
  EXPECT_LT((after.momentum - before.momentum).norm(), 1e-2);
  EXPECT_LT(after.kinetic + after.potential, 0.5 * (before.kinetic + before.potential));
}

TEST_F(OpenclSolver, EnergyNeverGrowsWithDamping) {
  const Parameters parameters;
  const auto tissue = testing_::cube_tissue(6);
  const auto opencl = solver(tissue, parameters);
  opencl->set_state(disturbed(*opencl, 0.1, 0.0));
  const double h = simulation::automatic_step_s(simulation::stable_step(*tissue, parameters)) / 2.0;
  const double first = opencl->energy().potential;
  double last = first;
  for (int batch = 0; batch < 30; ++batch) {
    opencl->step(5, h);
    const auto energy = opencl->energy();
    EXPECT_LE(energy.kinetic + energy.potential, last + 1e-5 * first) << "batch " << batch;  // float rounding
    last = energy.kinetic + energy.potential;
  }
  EXPECT_LT(last, 0.1 * first);
}

TEST_F(OpenclSolver, RestStaysAtRest) {
  const auto tissue = testing_::cube_tissue(6);
  const auto opencl = solver(tissue, Parameters());
  EXPECT_EQ(opencl->state().positions_mm, tissue->points.positions_mm);
  opencl->step(200, 0.005);
  // rsqrt is good to 1e-7 of a length: a few of these is the standing error of a point's place.
  EXPECT_LT(opencl->health().max_displacement_mm, 3e-6F);
}

TEST_F(OpenclSolver, RunsAreAlikeBitForBit) {
  const auto tissue = testing_::cube_tissue(8);
  std::array<State, 2> results;
  for (auto& result : results) {
    const auto opencl = solver(tissue, Parameters());
    pull(*opencl, corner_of(*tissue, 3.0F), 0.004);
    result = opencl->state();
  }
  EXPECT_EQ(results[0].positions_mm, results[1].positions_mm);
  EXPECT_EQ(results[0].velocities_mm_per_s, results[1].velocities_mm_per_s);
}

TEST_F(OpenclSolver, CoincidentPointsAndLoosePointsGiveNoNaN) {
  auto tissue = testing_::loose_points({{1, 1, 1}, {1, 1, 1}, {2, 1, 1}, {5, 5, 5}});
  tissue->links.pairs = {{0, 1}, {0, 2}};
  tissue->links.rest_lengths_mm = {0.5F, 1.0F};
  const auto opencl = solver(tissue, Parameters());
  opencl->step(20, 0.001);
  EXPECT_TRUE(opencl->health().finite);
  EXPECT_EQ(opencl->health().max_displacement_mm, 0.0F);
  const auto unlinked = solver(testing_::loose_points({{0, 0, 0}}), Parameters());
  unlinked->step(3, 0.01);
  EXPECT_EQ(unlinked->health().max_displacement_mm, 0.0F);
}

TEST_F(OpenclSolver, HealthSeesTheFurthestTheFastestAndWhatIsNotFinite) {
  const auto tissue = testing_::cube_tissue(9);  // 729 points: no multiple of a work-group
  const auto opencl = solver(tissue, Parameters());
  const State rest = opencl->state();
  State state = rest;
  state.positions_mm[728] += Eigen::Vector3f(3.0F, 4.0F, 12.0F);
  state.velocities_mm_per_s[0] = {-6.0F, 8.0F, 0.0F};
  opencl->set_state(state);
  EXPECT_TRUE(opencl->health().finite);
  EXPECT_NEAR(opencl->health().max_displacement_mm, 13.0F, 1e-5F);
  EXPECT_NEAR(opencl->health().max_speed_mm_per_s, 10.0F, 1e-5F);
  for (const float wrong : {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::infinity()})
    for (const std::size_t point : {std::size_t{0}, std::size_t{400}, std::size_t{728}}) {
      state = rest;
      state.positions_mm[point].z() = wrong;
      opencl->set_state(state);
      EXPECT_FALSE(opencl->health().finite) << wrong << " at " << point;
      state = rest;
      state.velocities_mm_per_s[point].x() = wrong;
      opencl->set_state(state);
      EXPECT_FALSE(opencl->health().finite) << wrong << " at " << point;
      // The step kernels, built with relaxed arithmetic, must not hide it either.
      opencl->step(1, 0.001);
      EXPECT_FALSE(opencl->health().finite) << wrong << " after a step";
    }
}

TEST_F(OpenclSolver, SnapshotsBringBackStateAndTime) {
  const auto tissue = testing_::cube_tissue(5);
  const auto opencl = solver(tissue, Parameters());
  EXPECT_THROW(opencl->restore_snapshot(), palpate::core::Error);
  opencl->set_state(disturbed(*opencl, 0.1, 1.0));
  opencl->step(3, 0.002);
  opencl->save_snapshot();
  const State saved = opencl->state();
  opencl->step(5, 0.002);
  EXPECT_NE(opencl->state().positions_mm, saved.positions_mm);
  opencl->restore_snapshot();
  EXPECT_EQ(opencl->state().positions_mm, saved.positions_mm);
  EXPECT_EQ(opencl->state().velocities_mm_per_s, saved.velocities_mm_per_s);
  EXPECT_DOUBLE_EQ(opencl->time_s(), 0.006);
}

TEST_F(OpenclSolver, PositionsStayInOneBuffer) {
  const auto tissue = testing_::cube_tissue(4);
  const auto opencl = solver(tissue, Parameters());
  const auto* buffer = opencl->positions_buffer();
  ASSERT_NE(buffer, nullptr);
  opencl->hold({{5, 1.0F}});
  opencl->set_grab_velocity({100.0, 0.0, 0.0});
  opencl->step(3, 0.002);
  ASSERT_EQ(opencl->positions_buffer(), buffer);
  std::vector<std::array<float, 4>> raw(tissue->points.size());
  ASSERT_GE(buffer->bytes(), raw.size() * 16);
  buffer->read(raw.data(), raw.size() * 16);
  const State state = opencl->state();
  for (std::size_t n = 0; n < raw.size(); ++n)
    EXPECT_EQ(Eigen::Vector3f(raw[n][0], raw[n][1], raw[n][2]), state.positions_mm[n]);
  EXPECT_GT(opencl->bytes(), tissue->points.size() * 16 * 10);
}

TEST_F(OpenclSolver, NewParametersCountFromTheNextStep) {
  const auto tissue = testing_::loose_points({{0, 0, 0}});
  Parameters parameters;
  parameters.drag_per_s = 0.0;
  const auto opencl = solver(tissue, parameters);
  parameters.gravity_mm_per_s2 = {0.0, 10.0, 0.0};
  opencl->set_parameters(parameters);
  opencl->step(100, 0.01);
  EXPECT_NEAR(opencl->state().positions_mm[0].y(), 5.0F, 1e-4F);  // g t^2/2; RK4 is exact but for rounding
  parameters.stiffness_per_s2 = -1.0;
  EXPECT_THROW(opencl->set_parameters(parameters), palpate::core::Error);
}

TEST_F(OpenclSolver, TheGuardRecoversABlowUp) {
  const auto tissue = testing_::cube_tissue(6);
  const Parameters parameters;
  const auto opencl = solver(tissue, parameters);
  opencl->set_state(disturbed(*opencl, 0.05, 0.0));
  // The bound is at most 30 % under the true limit, so this is over 1.3 times the limit.
  simulation::Guard guard(*opencl, 1.3 / 0.7 * simulation::stable_step(*tissue, parameters).step_s);
  const double time = 400 * guard.step_s();
  const auto report = guard.advance(400);
  EXPECT_FALSE(report.paused);
  EXPECT_TRUE(report.recovered);
  EXPECT_GT(guard.recoveries(), 0);
  EXPECT_NEAR(opencl->time_s(), time, 1e-9);
  EXPECT_TRUE(opencl->health().finite);
  EXPECT_LT(opencl->health().max_displacement_mm, 0.2F);
}

TEST_F(OpenclSolver, TheGuardPausesOnAStateThatIsNotFinite) {
  const auto opencl = solver(testing_::cube_tissue(4), Parameters());
  simulation::Guard guard(*opencl, 0.002);
  EXPECT_FALSE(guard.advance(5).paused);
  State broken = opencl->state();
  const State good = broken;
  for (auto& x : broken.positions_mm) x.fill(std::numeric_limits<float>::quiet_NaN());
  opencl->set_state(broken);
  EXPECT_TRUE(guard.advance(5).paused);
  EXPECT_TRUE(opencl->health().finite);
  EXPECT_LT(furthest(opencl->state().positions_mm, good.positions_mm), 1e-4F);
}

TEST_F(OpenclSolver, SaysWhatItRunsOn) {
  const auto opencl = solver(testing_::cube_tissue(3), Parameters());
  EXPECT_EQ(opencl->device_name(), device().info().name);
  EXPECT_EQ(opencl->driver(), device().info().driver);
  EXPECT_EQ(opencl->layout(), "explicit");
}
