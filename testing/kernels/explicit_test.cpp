// kernels/explicit.cl and explicit_health.cl: every integrator, material,
// beat, anchor and cut against the reference solver in double precision.
#include "device_test.hpp"

#include "palpate/simulation/solver.hpp"
#include "palpate/testing/cube_tissue.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace model = palpate::model;
namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::Integrator;
using simulation::Material;
using simulation::Parameters;
using simulation::Solver;
using simulation::State;

namespace {

const std::vector<Integrator> explicit_ones{Integrator::euler, Integrator::symplectic_euler,
                                            Integrator::verlet, Integrator::velocity_verlet, Integrator::rk4};

class ExplicitLayout : public testing_::DeviceTest {
 protected:
  std::unique_ptr<Solver> solver(const std::shared_ptr<model::Tissue>& tissue, const Parameters& parameters,
                                 const Material& material = {}, unsigned points_per_item = 0) const {
    simulation::OpenclOptions options;
    options.points_per_item = points_per_item;
    options.layout = simulation::LayoutChoice::explicit_links;
    return simulation::make_opencl_solver(device(), tissue, parameters, options, material);
  }
};

Material material_of(std::size_t points, int scaled) {
  Material material;
  testing_::Numbers numbers(23);
  for (std::size_t n = 0; n < points; ++n)
    material.factors.push_back(static_cast<float>(numbers.between(0.5, 2.0)));
  material.scales_stiffness = (scaled & 1) != 0;
  material.scales_damping = (scaled & 2) != 0;
  material.scales_drag = (scaled & 4) != 0;
  material.scales_mass = (scaled & 8) != 0;
  return material;
}

State disturbed(const Solver& solver, double displacement_mm, double speed_mm_per_s) {
  State state = solver.state();
  testing_::Numbers numbers(11);
  for (auto& x : state.positions_mm) x += numbers.vector(displacement_mm);
  for (auto& v : state.velocities_mm_per_s) v = numbers.vector(speed_mm_per_s);
  return state;
}

float furthest(const std::vector<Eigen::Vector3f>& a, const std::vector<Eigen::Vector3f>& b) {
  float largest = 0.0F;
  for (std::size_t n = 0; n < a.size(); ++n) {
    const float apart = (a[n] - b[n]).norm();
    if (!(apart <= largest)) largest = apart;  // NaN stays
  }
  return largest;
}

Parameters busy(Integrator integrator) {
  Parameters parameters;
  parameters.integrator = integrator;
  parameters.damping_per_s = 8.0;
  parameters.drag_per_s = 2.0;
  parameters.mass = 1.25;
  parameters.gravity_mm_per_s2 = {50.0, -300.0, 20.0};
  parameters.beat_period_s = 0.2;
  parameters.beat_amplitude = 0.05;
  return parameters;
}

constexpr double step_s = 0.0005;

/// Everything that may happen to a run: 80 steps.
void live(Solver& solver) {
  solver.hold({{0, 1.0F}, {20, 0.5F}, {21, 0.25F}, {100, 1.0F}});
  solver.step(7, step_s);  // odd: a scheme that alternates between two arrays ends in the other
  solver.set_grab_velocity({8.0, -4.0, 2.0});
  solver.step(13, step_s);
  solver.set_links_alive({3, 10, 11, 250, 400}, false);
  solver.set_anchors({3, 50, 100});
  solver.step(15, step_s);
  solver.set_grab_velocity(Eigen::Vector3d::Zero());
  solver.hold({{30, 0.5F}});
  solver.set_links_alive({10, 250}, true);
  solver.step(15, step_s);
  solver.hold({});
  solver.step(30, step_s);
}

// Coordinates to 4 mm round by 1.2e-7 mm at most (half a spacing of 2.4e-7), in
// each of 80 steps: 1e-5 mm if all went one way. Velocities are off by omega,
// some 400/s, times a few of these places at once.
constexpr float place_tolerance_mm = 1e-5F;
constexpr float speed_tolerance_mm_per_s = 1e-3F;

}  // namespace

TEST_F(ExplicitLayout, FollowsTheReferenceInEveryIntegratorAndWidth) {
  const auto tissue = testing_::cube_tissue(6);  // 216 points: no multiple of 16
  for (const Integrator integrator : explicit_ones) {
    const Material none;
    const auto reference = simulation::make_reference_solver(tissue, busy(integrator), none);
    const State start = disturbed(*reference, 0.05, 10.0);
    reference->set_state(start);
    live(*reference);
    EXPECT_GT(furthest(reference->state().positions_mm, start.positions_mm), 0.1F);
    for (const unsigned points_per_item : {1U, 4U, 8U, 16U}) {
      SCOPED_TRACE(simulation::to_string(integrator) + " " + std::to_string(points_per_item));
      const auto opencl = solver(tissue, busy(integrator), none, points_per_item);
      opencl->set_state(start);
      live(*opencl);
      const State a = opencl->state();
      const State b = reference->state();
      EXPECT_LT(furthest(a.positions_mm, b.positions_mm), place_tolerance_mm);
      EXPECT_LT(furthest(a.velocities_mm_per_s, b.velocities_mm_per_s), speed_tolerance_mm_per_s);
      EXPECT_NEAR(a.time_s, b.time_s, 1e-12);
    }
  }
}

TEST_F(ExplicitLayout, FollowsTheReferenceWithScaledMaterials) {
  const auto tissue = testing_::cube_tissue(6);
  std::vector<unsigned> widths{0, 1, 4, 8, 16};
  widths.resize(static_cast<std::size_t>(testing_::repetitions(1, 5)));
  // Each alone, and all at once.
  for (const int scaled : {1, 2, 4, 8, 15}) {
    const Material material = material_of(tissue->points.size(), scaled);
    for (const Integrator integrator : {Integrator::rk4, Integrator::velocity_verlet, Integrator::verlet}) {
      if (scaled != 15 && integrator != Integrator::rk4) continue;
      const auto reference = simulation::make_reference_solver(tissue, busy(integrator), material);
      const State start = disturbed(*reference, 0.05, 10.0);
      reference->set_state(start);
      live(*reference);
      const State expected = reference->state();
      for (const unsigned points_per_item : widths) {
        SCOPED_TRACE(simulation::to_string(integrator) + " " + std::to_string(scaled) + " by " +
                     std::to_string(points_per_item));
        const auto opencl = solver(tissue, busy(integrator), material, points_per_item);
        opencl->set_state(start);
        live(*opencl);
        EXPECT_LT(furthest(opencl->state().positions_mm, expected.positions_mm), place_tolerance_mm);
        EXPECT_LT(furthest(opencl->state().velocities_mm_per_s, expected.velocities_mm_per_s),
                  speed_tolerance_mm_per_s);
      }
      // The factors matter: without them it would be another motion by far.
      const auto plain = simulation::make_reference_solver(tissue, busy(integrator));
      plain->set_state(start);
      live(*plain);
      EXPECT_GT(furthest(plain->state().positions_mm, expected.positions_mm), 100.0F * place_tolerance_mm);
    }
  }
}

TEST_F(ExplicitLayout, SwitchesIntegratorsInMidRunWithTheState) {
  const auto tissue = testing_::cube_tissue(5);
  const auto opencl = solver(tissue, busy(Integrator::rk4));
  const auto reference = simulation::make_reference_solver(tissue, busy(Integrator::rk4));
  const State start = disturbed(*reference, 0.05, 10.0);
  for (Solver* each : {opencl.get(), reference.get()}) {
    each->set_state(start);
    for (const Integrator integrator : {Integrator::verlet, Integrator::rk4, Integrator::euler,
                                        Integrator::velocity_verlet, Integrator::symplectic_euler}) {
      each->set_parameters(busy(integrator));
      each->step(11, step_s);
    }
  }
  EXPECT_LT(furthest(opencl->state().positions_mm, reference->state().positions_mm), place_tolerance_mm);
  EXPECT_EQ(opencl->parameters().integrator, Integrator::symplectic_euler);
}

TEST_F(ExplicitLayout, PositionsStayInOneBufferAndSnapshotsHoldInEveryIntegrator) {
  const auto tissue = testing_::cube_tissue(4);
  for (const Integrator integrator : explicit_ones) {
    SCOPED_TRACE(simulation::to_string(integrator));
    const auto opencl = solver(tissue, busy(integrator));
    const auto* buffer = opencl->positions_buffer();
    opencl->set_state(disturbed(*opencl, 0.05, 5.0));
    opencl->save_snapshot();
    opencl->step(5, step_s);
    const State first = opencl->state();
    ASSERT_EQ(opencl->positions_buffer(), buffer);
    std::vector<std::array<float, 4>> raw(tissue->points.size());
    buffer->read(raw.data(), raw.size() * 16);
    for (std::size_t n = 0; n < raw.size(); ++n)
      ASSERT_EQ(Eigen::Vector3f(raw[n][0], raw[n][1], raw[n][2]), first.positions_mm[n]);
    // From the snapshot, the same time in other batches: bit for bit, the beat's phase included.
    opencl->restore_snapshot();
    opencl->step(2, step_s);
    opencl->step(3, step_s);
    EXPECT_EQ(opencl->state().positions_mm, first.positions_mm);
    EXPECT_EQ(opencl->state().velocities_mm_per_s, first.velocities_mm_per_s);
    opencl->restore_snapshot();
    opencl->set_anchors({7});
    opencl->restore_snapshot();
    EXPECT_EQ(opencl->state().velocities_mm_per_s[7], Eigen::Vector3f::Zero());
  }
}

TEST_F(ExplicitLayout, RunsAreAlikeBitForBit) {
  const auto tissue = testing_::cube_tissue(8);
  const Material material = material_of(tissue->points.size(), 15);
  for (const Integrator integrator : explicit_ones) {
    std::array<State, 2> results;
    for (auto& result : results) {
      const auto opencl = solver(tissue, busy(integrator), material);
      opencl->set_state(disturbed(*opencl, 0.05, 5.0));
      live(*opencl);
      result = opencl->state();
    }
    EXPECT_EQ(results[0].positions_mm, results[1].positions_mm) << simulation::to_string(integrator);
    EXPECT_EQ(results[0].velocities_mm_per_s, results[1].velocities_mm_per_s);
  }
}

TEST_F(ExplicitLayout, CutLinksAndLinksWithoutALengthDoNotAct) {
  auto tissue = testing_::loose_points({{0, 0, 0}, {1, 0, 0}, {0, 2, 0}});
  tissue->links.pairs = {{0, 1}, {0, 2}};
  tissue->links.rest_lengths_mm = {0.0F, 1.0F};
  const auto opencl = solver(tissue, Parameters());
  opencl->set_links_alive({1, 1}, false);
  opencl->step(10, 0.001);
  EXPECT_EQ(opencl->health().max_displacement_mm, 0.0F);
  EXPECT_EQ(opencl->link_health().potential, 0.0);
  opencl->set_links_alive({1}, true);
  EXPECT_NEAR(opencl->link_health().potential, 5000.0, 1e-2);
  opencl->step(10, 0.001);
  EXPECT_GT(opencl->health().max_displacement_mm, 0.01F);
  EXPECT_EQ(opencl->state().positions_mm[1], Eigen::Vector3f(1, 0, 0));
  EXPECT_THROW(opencl->set_links_alive({2}, false), palpate::core::Error);
}

TEST_F(ExplicitLayout, AnchorsNeverMoveUnderAGrab) {
  const auto tissue = testing_::cube_tissue(3);
  Material material;
  material.anchors = {5, 0, 26, 5};
  for (const Integrator integrator : explicit_ones) {
    SCOPED_TRACE(simulation::to_string(integrator));
    const auto opencl = solver(tissue, busy(integrator), material);
    opencl->set_state(disturbed(*opencl, 0.0, 5.0));
    opencl->hold({{5, 1.0F}, {6, 0.5F}, {26, 0.25F}});
    opencl->set_grab_velocity({20.0, 0.0, 0.0});
    opencl->step(21, step_s);
    for (const std::uint32_t point : {0U, 5U, 26U}) {
      EXPECT_EQ(opencl->state().positions_mm[point], tissue->points.positions_mm[point]);
      EXPECT_EQ(opencl->state().velocities_mm_per_s[point], Eigen::Vector3f::Zero());
    }
    EXPECT_GT((opencl->state().positions_mm[6] - tissue->points.positions_mm[6]).norm(), 0.05F);
    EXPECT_THROW(opencl->set_anchors({27}), palpate::core::Error);
  }
}

TEST_F(ExplicitLayout, ABeatBringsRestLengthsBackAfterAPeriod) {
  const auto tissue = testing_::cube_tissue(4);
  Parameters parameters = busy(Integrator::rk4);
  parameters.gravity_mm_per_s2.setZero();
  parameters.damping_per_s = 50.0;
  const auto opencl = solver(tissue, parameters);
  opencl->step(200, step_s);                               // half a period: 5 % shorter
  EXPECT_GT(opencl->health().max_displacement_mm, 0.08F);  // corners lie 2.6 mm from the middle
  parameters.beat_amplitude = 0.0;
  opencl->set_parameters(parameters);
  const double squeezed = opencl->link_health().potential;
  parameters.beat_amplitude = 0.05;
  opencl->set_parameters(parameters);
  opencl->step(200, step_s);
  const double beaten = opencl->link_health().potential;
  EXPECT_EQ(beaten, [&] {  // at a whole period the lengths are L0 again
    parameters.beat_amplitude = 0.0;
    opencl->set_parameters(parameters);
    return opencl->link_health().potential;
  }());
  EXPECT_LT(beaten, 0.01 * squeezed);
}

TEST_F(ExplicitLayout, LinkHealthIsTheHostsSum) {
  const auto tissue = testing_::cube_tissue(9);  // 729 points: no multiple of a work-group
  const Material material = material_of(tissue->points.size(), 15);
  for (const unsigned points_per_item : {0U, 1U}) {
    const bool scaled = points_per_item == 0;
    const auto opencl =
        solver(tissue, busy(Integrator::rk4), scaled ? material : Material(), points_per_item);
    const auto reference =
        simulation::make_reference_solver(tissue, busy(Integrator::rk4), scaled ? material : Material());
    State state = disturbed(*opencl, 0.05, 5.0);
    state.velocities_mm_per_s[40] *= 50.0F;
    state.velocities_mm_per_s[700] *= 100.0F;
    state.time_s = 0.07;
    for (Solver* each : {opencl.get(), reference.get()}) {
      each->set_state(state);
      each->set_anchors({700});
      each->hold({{600, 0.1F}});
      each->set_links_alive({0, 100, 1000}, false);
    }
    const auto compare = [&] {
      const auto a = opencl->link_health();
      const auto b = reference->link_health();
      EXPECT_EQ(opencl->link_health().potential, a.potential);  // summed in one order
      // Sums of floats, each good to some 1e-6 of the whole.
      EXPECT_NEAR(a.kinetic, b.kinetic, 1e-5 * b.kinetic);
      EXPECT_NEAR(a.potential, b.potential, 1e-5 * b.potential);
      EXPECT_NEAR(a.max_strain_rate_per_s, b.max_strain_rate_per_s, 1e-5F * b.max_strain_rate_per_s);
      return b;
    };
    const auto before = compare();
    EXPECT_GT(before.max_strain_rate_per_s, 50.0F);
    // The fastest point counts no more once it is held.
    for (Solver* each : {opencl.get(), reference.get()}) each->hold({{40, 0.5F}});
    EXPECT_LT(compare().max_strain_rate_per_s, 0.5F * before.max_strain_rate_per_s);
  }
}

TEST_F(ExplicitLayout, TakesNoMoreMemoryThanPromised) {
  const auto tissue = testing_::cube_tissue(16);
  const auto opencl = solver(tissue, busy(Integrator::rk4), material_of(tissue->points.size(), 15));
  const double points = static_cast<double>(tissue->points.size());
  EXPECT_LE(static_cast<double>(opencl->bytes()), (250.0 + 10.0 * 12.0) * points);
  EXPECT_GT(opencl->bytes_per_step(),
            tissue->points.size() * 4 * 8 * 12);  // four passes over the links alone
  const auto implicit = solver(tissue, busy(Integrator::implicit_euler));
  EXPECT_EQ(implicit->bytes_per_step(), 0U) << "it is not known";
  implicit->set_parameters(busy(Integrator::verlet));
  EXPECT_GT(implicit->bytes_per_step(), tissue->points.size() * 8 * 12);
}

TEST_F(ExplicitLayout, TheLayoutIsChosenByName) {
  const auto tissue = testing_::cube_tissue(3);
  EXPECT_EQ(solver(tissue, Parameters())->layout(), "explicit");
  EXPECT_EQ(simulation::layout_of("explicit"), simulation::LayoutChoice::explicit_links);
  EXPECT_THROW(simulation::layout_of("planar"), palpate::core::Error);
}
