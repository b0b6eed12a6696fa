// The implicit scheme on a device, in both layouts, against its twin in double
// precision and against RK4.
#include "device_test.hpp"

#include "palpate/model/generate.hpp"
#include "palpate/simulation/solver.hpp"
#include "palpate/testing/cube_tissue.hpp"
#include "palpate/testing/support.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::Integrator;
using simulation::LayoutChoice;
using simulation::Material;
using simulation::Parameters;
using simulation::State;

namespace {

/// Rest lengths are kept in 16 bits on the lattice: some 1e-5 of a millimetre
/// off, and the ends of stretched links with them.
constexpr double lattice_tolerance_mm = 2e-4;
/// Floats near 5 mm, and the 1e-6 of a step that a device's rsqrt and sums may be off.
constexpr double explicit_tolerance_mm = 2e-5;

class ImplicitDevice : public testing_::DeviceTest {
 protected:
  std::unique_ptr<simulation::Solver> solver_of(const std::shared_ptr<palpate::model::Tissue>& tissue,
                                                const Parameters& parameters, LayoutChoice layout,
                                                const Material& material = {}, unsigned width = 0) const {
    simulation::OpenclOptions options;
    options.layout = layout;
    options.points_per_item = width;
    return simulation::make_opencl_solver(device(), tissue, parameters, options, material);
  }
};

double largest_distance(const State& a, const State& b) {
  double largest = 0.0;
  for (std::size_t n = 0; n < a.positions_mm.size(); ++n) {
    const double distance = static_cast<double>((a.positions_mm[n] - b.positions_mm[n]).norm());
    largest = distance <= largest ? largest : distance;  // NaN comes through
  }
  return largest;
}

double tolerance_of(const simulation::Solver& solver) {
  return solver.layout() == "lattice" ? lattice_tolerance_mm : explicit_tolerance_mm;
}

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

Parameters stiff() {
  Parameters parameters;
  parameters.stiffness_per_s2 = 1e6;
  parameters.integrator = Integrator::implicit_euler;
  parameters.gravity_mm_per_s2 = {300.0, -200.0, -9810.0};
  return parameters;
}

constexpr LayoutChoice both_layouts[] = {LayoutChoice::explicit_links, LayoutChoice::lattice};

/// Holds the upper face by halves and wholes and pulls it for `steps` steps.
void pull(simulation::Solver& solver, int side, int steps, double step_s, double mm) {
  std::vector<simulation::HeldPoint> held;
  for (const std::uint32_t point : face(side, true)) held.push_back({point, point % 3 == 0 ? 0.5F : 1.0F});
  solver.hold(held);
  const double speed = mm / (steps * step_s);
  solver.set_grab_velocity({0.0, speed, 0.5 * speed});
  solver.step(steps, step_s);
  solver.set_grab_velocity({0.0, 0.0, 0.0});
}

}  // namespace

TEST_F(ImplicitDevice, StepsAsTheReferenceDoes) {
  const auto tissue = testing_::cube_tissue(6);
  const auto reference = simulation::make_reference_solver(tissue, stiff(), anchored(6));
  pull(*reference, 6, 20, 0.006, 1.0);
  for (const auto layout : both_layouts) {
    const auto solver = solver_of(tissue, stiff(), layout, anchored(6));
    pull(*solver, 6, 20, 0.006, 1.0);
    EXPECT_LT(largest_distance(solver->state(), reference->state()), tolerance_of(*solver))
        << solver->layout();
  }
}

TEST_F(ImplicitDevice, StepsAsTheReferenceDoesWithEveryWidth) {
  // Few kinds of links, since each width is compiled anew.
  const auto tissue = testing_::cube_tissue(6, 6);
  const auto reference = simulation::make_reference_solver(tissue, stiff(), anchored(6));
  pull(*reference, 6, 20, 0.006, 1.0);
  const unsigned widths[] = {1, 4, 8, 16};
  const int count = testing_::repetitions(1, 4);
  for (const auto layout : both_layouts)
    for (int n = 0; n < count; ++n) {
      const unsigned width = widths[n];
      const auto solver = solver_of(tissue, stiff(), layout, anchored(6), width);
      pull(*solver, 6, 20, 0.006, 1.0);
      EXPECT_LT(largest_distance(solver->state(), reference->state()), tolerance_of(*solver))
          << solver->layout() << ' ' << width;
    }
}

TEST_F(ImplicitDevice, KnowsTheMaterialTheBeatAndCuts) {
  const auto tissue = testing_::cube_tissue(6);
  Parameters parameters = stiff();
  parameters.stiffness_per_s2 = 3e5;
  parameters.gravity_mm_per_s2 /= 20.0;  // cut tissue that folds up magnifies what is off
  parameters.damping_per_s = 20.0;
  parameters.drag_per_s = 2.0;
  parameters.mass = 1.7;
  parameters.beat_amplitude = 0.05;
  parameters.beat_period_s = 0.3;
  Material material = anchored(6);
  testing_::Numbers numbers(5);
  for (std::size_t n = 0; n < tissue->points.size(); ++n)
    material.factors.push_back(static_cast<float>(numbers.between(0.4, 2.0)));
  material.scales_stiffness = material.scales_damping = true;
  material.scales_drag = material.scales_mass = true;
  std::vector<std::uint32_t> cut;
  for (std::uint32_t link = 0; link < tissue->links.size(); link += 7) cut.push_back(link);
  const auto run = [&](simulation::Solver& solver) {
    solver.set_links_alive(cut, false);
    solver.step(10, 0.006);
    solver.set_links_alive({cut[0], cut[1]}, true);
    pull(solver, 6, 10, 0.006, 0.2);
    solver.hold({});
    solver.step(10, 0.006);
  };
  const auto reference = simulation::make_reference_solver(tissue, parameters, material);
  run(*reference);
  for (const auto layout : both_layouts) {
    const auto solver = solver_of(tissue, parameters, layout, material);
    run(*solver);
    EXPECT_LT(largest_distance(solver->state(), reference->state()), tolerance_of(*solver))
        << solver->layout();
    EXPECT_DOUBLE_EQ(solver->time_s(), reference->time_s());
  }
}

TEST_F(ImplicitDevice, TakesLinksThatLeaveTheStencilAlong) {
  // A link over three sites besides the lattice's own: the overflow list, or a longer column.
  auto tissue = testing_::cube_tissue(6);
  auto& links = tissue->links;
  const auto place =
      std::count_if(links.pairs.begin(), links.pairs.end(), [](const auto& pair) { return pair[0] == 0; });
  links.pairs.insert(links.pairs.begin() + place, {0, 215});
  links.rest_lengths_mm.insert(links.rest_lengths_mm.begin() + place, 6.0F);  // 2.7 mm short
  Parameters parameters = stiff();
  parameters.gravity_mm_per_s2.setZero();  // nothing holds it, and floats far away are coarse
  const auto reference = simulation::make_reference_solver(tissue, parameters);
  reference->step(30, 0.006);
  for (const auto layout : both_layouts) {
    const auto solver = solver_of(tissue, parameters, layout);
    solver->step(30, 0.006);
    EXPECT_LT(largest_distance(solver->state(), reference->state()), tolerance_of(*solver))
        << solver->layout();
  }
}

TEST_F(ImplicitDevice, GoesThroughLargeTissueInParts) {
  // More than the lattice takes through the caches at once: passes follow one another by slabs.
  auto tissue = std::make_shared<palpate::model::Tissue>(testing_::cube_points(33, 0.1));
  tissue->links = palpate::model::link_nearest(tissue->points, Eigen::Vector3d::Ones(), 12);
  State states[2];
  for (std::size_t n = 0; n < 2; ++n) {
    const auto solver = solver_of(tissue, stiff(), both_layouts[n], anchored(33));
    solver->step(10, 0.006);
    states[n] = solver->state();
  }
  EXPECT_LT(largest_distance(states[0], states[1]), lattice_tolerance_mm);
}

TEST_F(ImplicitDevice, ComesToTheRestOfRk4) {
  const auto tissue = testing_::cube_tissue(6);
  Parameters parameters = stiff();
  parameters.drag_per_s = 50.0;  // rest is reached soon; drag has no say in where it is
  parameters.gravity_mm_per_s2 = {2e4, 0.0, 5e4};
  for (const auto layout : both_layouts) {
    parameters.integrator = Integrator::rk4;
    const auto explicit_ = solver_of(tissue, parameters, layout, anchored(6));
    explicit_->step(4000, 0.0003);
    ASSERT_LT(explicit_->health().max_speed_mm_per_s, 0.01F);
    parameters.integrator = Integrator::implicit_euler;
    const auto implicit = solver_of(tissue, parameters, layout, anchored(6));
    implicit->step(600, 0.006);
    ASSERT_LT(implicit->health().max_speed_mm_per_s, 0.01F);
    const double sag_mm = static_cast<double>(explicit_->health().max_displacement_mm);
    EXPECT_GT(sag_mm, 0.2);
    EXPECT_LT(largest_distance(implicit->state(), explicit_->state()), 0.01 * sag_mm) << implicit->layout();
  }
}

TEST_F(ImplicitDevice, GivesTheSameBitsEveryTime) {
  const auto tissue = testing_::cube_tissue(7);
  for (const auto layout : both_layouts) {
    State states[2];
    for (State& state : states) {
      const auto solver = solver_of(tissue, stiff(), layout, anchored(7));
      pull(*solver, 7, 15, 0.006, 1.0);
      state = solver->state();
    }
    EXPECT_EQ(largest_distance(states[0], states[1]), 0.0);
  }
}

TEST_F(ImplicitDevice, TakesOverFromAnotherSchemeAndGivesBack) {
  const auto tissue = testing_::cube_tissue(5);
  Parameters parameters = stiff();
  const auto run = [&](simulation::Solver& solver) {
    for (const auto integrator : {Integrator::symplectic_euler, Integrator::implicit_euler, Integrator::rk4,
                                  Integrator::implicit_euler}) {
      parameters.integrator = integrator;
      solver.set_parameters(parameters);
      solver.step(5, integrator == Integrator::implicit_euler ? 0.006 : 0.0002);
    }
  };
  const auto reference = simulation::make_reference_solver(tissue, parameters, anchored(5));
  run(*reference);
  for (const auto layout : both_layouts) {
    const auto solver = solver_of(tissue, parameters, layout, anchored(5));
    run(*solver);
    EXPECT_LT(largest_distance(solver->state(), reference->state()), tolerance_of(*solver))
        << solver->layout();
  }
}

TEST_F(ImplicitDevice, StaysFiniteInSinglePrecisionAtTheEndsOfTheRange) {
  struct Extreme {
    double stiffness, damping, mass, step_s, drag;
  };
  const Extreme extremes[] = {{1e9, 1e6, 1e-3, 1.0, 0.0}, {1e9, 0.0, 1e-3, 1.0, 1e4},
                              {1e9, 0.0, 1e3, 1e-3, 0.1}, {1e6, 1e6, 1.0, 0.006, 0.1},
                              {0.0, 1e6, 1e-3, 1.0, 0.1}, {0.0, 0.0, 1e-3, 1.0, 0.0},
                              {1e6, 3.0, 1.0, 1e-7, 0.1}, {1e9, 3.0, 1.0, 0.02, 0.1}};
  auto tissue = testing_::cube_tissue(4);
  tissue->points.positions_mm[21] = tissue->points.positions_mm[22];  // coincident
  for (const auto layout : both_layouts) {
    const auto solver = solver_of(tissue, stiff(), layout, anchored(4));
    const State rest = solver->state();
    for (const Extreme& extreme : extremes) {
      Parameters parameters = stiff();
      parameters.stiffness_per_s2 = extreme.stiffness;
      parameters.damping_per_s = extreme.damping;
      parameters.drag_per_s = extreme.drag;
      parameters.mass = extreme.mass;
      parameters.gravity_mm_per_s2.setZero();
      solver->set_parameters(parameters);
      State start = rest;
      testing_::Numbers numbers(2);
      for (auto& x : start.positions_mm) x += numbers.vector(2.0);
      solver->set_state(start);
      pull(*solver, 4, 20, extreme.step_s, 20.0);
      solver->hold({});
      solver->step(100, extreme.step_s);
      const auto health = solver->health();
      EXPECT_TRUE(health.finite) << solver->layout() << ' ' << extreme.stiffness << ' ' << extreme.damping;
      // 20 mm by the hand; what it let go flies on where nothing holds it (k = 0, no drag).
      if (extreme.stiffness > 0.0 && extreme.step_s > 1e-6) {
        EXPECT_LT(health.max_displacement_mm, 200.0F) << solver->layout() << ' ' << extreme.stiffness << ' '
                                                      << extreme.damping << ' ' << extreme.step_s;
      }
    }
  }
}

TEST_F(ImplicitDevice, TakesTissueWithoutLinksAndASinglePoint) {
  Parameters parameters = stiff();
  parameters.drag_per_s = 0.0;
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -1000.0};
  for (const auto layout : both_layouts) {
    const auto solver = solver_of(testing_::loose_points({{0.0F, 0.0F, 0.0F}}), parameters, layout);
    solver->step(10, 0.01);
    // Backward Euler falls g h^2 n (n + 1)/2 = 5.5 mm; in floats.
    EXPECT_NEAR(solver->state().positions_mm[0].z(), -5.5F, 1e-5F) << solver->layout();
    EXPECT_NEAR(solver->state().velocities_mm_per_s[0].z(), -100.0F, 1e-4F);
  }
}
