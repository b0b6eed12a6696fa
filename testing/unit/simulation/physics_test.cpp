// Every explicit integrator and every force of the reference solver against
// what does not come from it: derivatives of the energy, conserved quantities,
// an exact solution, the papers' recursion by hand.
#include "palpate/core/error.hpp"
#include "palpate/simulation/solver.hpp"
#include "palpate/simulation/stability.hpp"
#include "palpate/testing/cube_tissue.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numeric>

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
/// Those that neither gain nor lose energy of themselves.
const std::vector<Integrator> geometric_ones{Integrator::symplectic_euler, Integrator::verlet,
                                             Integrator::velocity_verlet};

Parameters undamped(Integrator integrator) {
  Parameters parameters;
  parameters.damping_per_s = 0.0;
  parameters.drag_per_s = 0.0;
  parameters.integrator = integrator;
  return parameters;
}

/// Factors from 1/2 to 2, on all that can be scaled.
Material scaled_material(std::size_t points) {
  Material material;
  testing_::Numbers numbers(23);
  for (std::size_t n = 0; n < points; ++n)
    material.factors.push_back(static_cast<float>(numbers.between(0.5, 2.0)));
  material.scales_stiffness = material.scales_damping = material.scales_drag = material.scales_mass = true;
  return material;
}

State disturbed(const Solver& solver, double displacement_mm, double speed_mm_per_s) {
  State state = solver.state();
  testing_::Numbers numbers(7);
  for (auto& x : state.positions_mm) x += numbers.vector(displacement_mm);
  for (auto& v : state.velocities_mm_per_s) v = numbers.vector(speed_mm_per_s);
  return state;
}

double total(const Solver& solver) {
  const auto energy = solver.energy();
  return energy.kinetic + energy.potential;
}

std::shared_ptr<model::Tissue> random_tissue() {
  testing_::Numbers numbers(31);
  std::vector<Eigen::Vector3f> places;
  for (int n = 0; n < 40; ++n) places.push_back(numbers.vector(2.0));
  auto tissue = testing_::loose_points(places);
  testing_::link_mutual_nearest(*tissue, 12);
  return tissue;
}

struct Model {
  const char* name;
  std::shared_ptr<model::Tissue> tissue;
  double disturbance_mm;
  float stretch;
  std::vector<std::uint32_t> cut;
  bool scaled;
  double beat_amplitude;
};

std::vector<Model> models() {
  std::vector<Model> all;
  const auto cube = testing_::cube_tissue(3);
  all.push_back({"cube", cube, 0.2, 1.0F, {}, false, 0.0});
  all.push_back({"stretched", cube, 0.05, 1.5F, {}, false, 0.0});
  all.push_back({"random", random_tissue(), 0.2, 1.0F, {}, false, 0.0});
  all.push_back({"cut", cube, 0.2, 1.0F, {0, 5, 6, 17, 40}, false, 0.0});
  auto gaps = testing_::cube_tissue(3);
  gaps->links.rest_lengths_mm[3] = gaps->links.rest_lengths_mm[30] = 0.0F;  // no links
  all.push_back({"links without a length", gaps, 0.2, 1.0F, {}, false, 0.0});
  all.push_back({"scaled", random_tissue(), 0.2, 1.0F, {2, 3}, true, 0.0});
  all.push_back({"beating", cube, 0.1, 1.1F, {8}, true, 0.3});
  return all;
}

}  // namespace

TEST(Physics, ForcesAreTheNegativeGradientOfTheEnergy) {
  for (const auto& [name, tissue, disturbance_mm, stretch, cut, scaled, beat_amplitude] : models()) {
    SCOPED_TRACE(name);
    const std::size_t points = tissue->points.size();
    const Material material = scaled ? scaled_material(points) : Material();
    Parameters parameters = undamped(Integrator::euler);
    parameters.gravity_mm_per_s2 = {30.0, -4000.0, 500.0};
    parameters.mass = 1.5;
    parameters.beat_amplitude = beat_amplitude;
    parameters.beat_period_s = 0.8;
    const auto solver = simulation::make_reference_solver(tissue, parameters, material);
    solver->set_links_alive(cut, false);
    State start = disturbed(*solver, disturbance_mm, 0.0);
    start.time_s = 0.3;                 // in the middle of a beat
    for (auto& x : start.positions_mm)  // on a grid of 2^-16 mm, so that steps of 2^-10 mm are exact in float
      for (auto& value : x.reshaped()) value = std::round(value * stretch * 65536.0F) / 65536.0F;
    solver->set_state(start);
    solver->step(1, 0.0009765625);  // Euler from rest: v = h a, and 2^-10 s divides out exactly
    const State after = solver->state();
    const float delta = 0.0009765625F;
    for (std::size_t point = 0; point < points; ++point)
      for (int axis = 0; axis < 3; ++axis) {
        State beside = start;
        beside.positions_mm[point][axis] = start.positions_mm[point][axis] + delta;
        solver->set_state(beside);
        const double above = solver->energy().potential;
        beside.positions_mm[point][axis] = start.positions_mm[point][axis] - delta;
        solver->set_state(beside);
        const double below = solver->energy().potential;
        const double gradient = (above - below) / (2.0 * static_cast<double>(delta));
        const double mass = parameters.mass * (scaled ? static_cast<double>(material.factors[point]) : 1.0);
        const double force = mass * 1024.0 * static_cast<double>(after.velocities_mm_per_s[point][axis]);
        // Of a link at length l the difference leaves k delta^2 (L0/l)/(2 l^2) at most: 0.1 for twelve
        // links, k of 2e4 and l of 1 mm; random points are nearer to each other. The velocity is a float.
        EXPECT_NEAR(force, -gradient, 0.5 + 2e-7 * std::abs(force)) << "point " << point << " axis " << axis;
      }
  }
}

TEST(Physics, AFreeBodyKeepsItsMomentumAndItsSpin) {
  const auto tissue = testing_::cube_tissue(4);
  const Material material = scaled_material(tissue->points.size());
  for (const Integrator integrator : explicit_ones) {
    SCOPED_TRACE(simulation::to_string(integrator));
    Parameters parameters = undamped(integrator);
    parameters.mass = 2.0;
    const auto solver = simulation::make_reference_solver(tissue, parameters, material);
    State start = disturbed(*solver, 0.02, 2.0);
    for (std::size_t n = 0; n < start.positions_mm.size(); ++n)  // a drift and a spin on top
      start.velocities_mm_per_s[n] +=
          Eigen::Vector3f(3, -2, 1) + Eigen::Vector3f(0, 0, 2).cross(start.positions_mm[n]);
    const auto spin = [&](const State& state) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t n = 0; n < state.positions_mm.size(); ++n)
        sum += parameters.mass * static_cast<double>(material.factors[n]) *
               state.positions_mm[n].cast<double>().cross(state.velocities_mm_per_s[n].cast<double>());
      return sum;
    };
    solver->set_state(start);
    const Eigen::Vector3d momentum = solver->energy().momentum;
    const Eigen::Vector3d spin_before = spin(start);
    ASSERT_GT(momentum.norm(), 100.0);
    ASSERT_GT(spin_before.norm(), 100.0);
    // Euler is unstable without damping: few and short steps.
    const bool is_euler = integrator == Integrator::euler;
    solver->step(is_euler ? 50 : 500, is_euler ? 1e-4 : 1.5e-3);
    // A sum of 64 velocities of up to 10 mm/s read back as floats, masses up to 4.
    EXPECT_LT((solver->energy().momentum - momentum).norm(), 2e-4);
    // Symplectic schemes keep the spin of central forces exactly: left are the
    // floats, 64 moments of at most 10 mm/s and 30 mm. Euler loses h^2 v x a a
    // step and RK4 its own order, a thousandth here.
    const bool is_geometric = !is_euler && integrator != Integrator::rk4;
    EXPECT_LT((spin(solver->state()) - spin_before).norm(), is_geometric ? 1e-3 : 1e-3 * spin_before.norm());
  }
}

TEST(Physics, EnergyOfAnUndampedBodyStaysInABand) {
  const auto tissue = testing_::cube_tissue(4);
  for (const Integrator integrator : geometric_ones) {
    SCOPED_TRACE(simulation::to_string(integrator));
    const auto solver = simulation::make_reference_solver(tissue, undamped(integrator));
    solver->set_state(disturbed(*solver, 0.05, 0.0));
    const double first = total(*solver);
    // omega <= 2 sqrt(12 k/...) of some 400/s: h omega is about 0.4, and 6000 steps are 400 fast periods.
    double lowest = first;
    double highest = first;
    std::vector<double> means(2, 0.0);
    for (int batch = 0; batch < 600; ++batch) {
      solver->step(10, 0.001);
      const double now = total(*solver);
      lowest = std::min(lowest, now);
      highest = std::max(highest, now);
      means[batch < 300 ? 0 : 1] += now / 300.0;
    }
    // First order in h omega for symplectic Euler, second for velocity Verlet; random phases of 192 modes.
    const double band = integrator == Integrator::velocity_verlet ? 0.05 : 0.25;
    EXPECT_GT(lowest, (1.0 - band) * first);
    EXPECT_LT(highest, (1.0 + band) * first);
    EXPECT_NEAR(means[1], means[0], 0.01 * first) << "a drift";
  }
}

TEST(Physics, RungeKuttaNeverGainsEnergy) {
  const auto solver = simulation::make_reference_solver(testing_::cube_tissue(4), undamped(Integrator::rk4));
  solver->set_state(disturbed(*solver, 0.05, 0.0));
  const double first = total(*solver);
  double last = first;
  for (int batch = 0; batch < 100; ++batch) {
    solver->step(10, 0.002);
    EXPECT_LE(total(*solver), last + 1e-6 * first) << "batch " << batch;  // 1e-6: the state is read as floats
    last = total(*solver);
  }
  EXPECT_GT(last, 0.2 * first);  // and loses it only slowly, h omega being 0.8
}

TEST(Physics, EnergyNeverRisesWithDamping) {
  const auto tissue = testing_::cube_tissue(4);
  const Material material = scaled_material(tissue->points.size());
  for (const Integrator integrator : explicit_ones) {
    SCOPED_TRACE(simulation::to_string(integrator));
    Parameters parameters = undamped(integrator);
    parameters.drag_per_s = 5.0;
    parameters.damping_per_s = 30.0;
    const auto solver = simulation::make_reference_solver(tissue, parameters, material);
    solver->set_state(disturbed(*solver, 0.1, 0.0));
    const double first = total(*solver);
    double last = first;
    const bool is_geometric = integrator == Integrator::symplectic_euler || integrator == Integrator::verlet;
    for (int batch = 0; batch < 50; ++batch) {
      solver->step(20, 0.0002);
      // 1e-6: the state is read as floats. Symplectic Euler's energy swings by
      // h omega/2 of itself, 5 % here, about one that falls.
      EXPECT_LE(total(*solver), (is_geometric ? 1.05 : 1.0) * last + 1e-6 * first) << "batch " << batch;
      last = total(*solver);
    }
    EXPECT_LT(last, 0.05 * first);
  }
}

namespace {

/// Distance to the exact solution of x'' + 3x' + 45x = 0, in x and x'/omega,
/// as a part of the amplitude left after `time_s`.
double oscillator_error(Integrator integrator, double h, double time_s) {
  Parameters parameters = undamped(integrator);
  parameters.stiffness_per_s2 = 45.0;
  parameters.damping_per_s = 3.0;
  Material material;
  material.anchors = {0};
  const auto solver = simulation::make_reference_solver(testing_::oscillator_tissue(), parameters, material);
  solver->step(static_cast<int>(std::lround(time_s / h)), h);
  const State state = solver->state();
  const double omega = std::sqrt(45.0 - 2.25);
  const double speed = -std::exp(-1.5 * time_s) * 225.0 / omega * std::sin(omega * time_s);
  const double x_error = static_cast<double>(state.positions_mm[1].x()) - testing_::oscillator_place(time_s);
  const double v_error = static_cast<double>(state.velocities_mm_per_s[1].x()) - speed;
  EXPECT_EQ(state.positions_mm[0], Eigen::Vector3f(-8.0F, 0.0F, 0.0F));
  return std::hypot(x_error, v_error / omega) / (5.0 * std::exp(-1.5 * time_s));
}

}  // namespace

TEST(Physics, IntegratorsHaveTheirOrders) {
  struct Case {
    Integrator integrator;
    double order;
    double time_s;
  };
  // RK4 is so exact that the float of the state hides it after a second: its
  // error counts up while the motion dies away, and floats are relative.
  for (const auto& [integrator, order, time_s] :
       {Case{Integrator::euler, 1.0, 1.0}, Case{Integrator::symplectic_euler, 1.0, 1.0},
        Case{Integrator::verlet, 1.0, 1.0}, Case{Integrator::velocity_verlet, 2.0, 1.0},
        Case{Integrator::rk4, 4.0, 10.0}}) {
    SCOPED_TRACE(simulation::to_string(integrator));
    const double coarse = oscillator_error(integrator, 0.01, time_s);
    const double fine = oscillator_error(integrator, 0.005, time_s);
    EXPECT_NEAR(std::log2(coarse / fine), order, 0.1);
    RecordProperty("order_of_" + simulation::to_string(integrator), std::to_string(std::log2(coarse / fine)));
    if (integrator == Integrator::rk4) {
      // One halving more is lost in the float; one before shows that it is no accident.
      EXPECT_NEAR(std::log2(oscillator_error(integrator, 0.02, time_s) / coarse), order, 0.1);
      continue;
    }
    EXPECT_NEAR(std::log2(fine / oscillator_error(integrator, 0.0025, time_s)), order, 0.1);
  }
}

TEST(Physics, VerletIsThePapersRecursion) {
  Parameters parameters = undamped(Integrator::verlet);
  parameters.stiffness_per_s2 = 45.0;
  parameters.damping_per_s = 3.0;
  const auto solver = simulation::make_reference_solver(testing_::oscillator_tissue(), parameters);
  solver->hold({{0, 1.0F}});
  State start = solver->state();
  start.velocities_mm_per_s[1].x() = 2.0F;
  solver->set_state(start);
  const double h = 0.01;
  double x = 5.0;
  double before = x - h * 2.0;
  for (int n = 0; n < 100; ++n) {
    const double next = 2.0 * x - before + h * h * (-45.0 * x - 3.0 * (x - before) / h);
    before = x;
    x = next;
  }
  solver->step(100, h);
  EXPECT_NEAR(solver->state().positions_mm[1].x(), static_cast<float>(x), 1e-6F);  // the float of the state
  EXPECT_NEAR(solver->state().velocities_mm_per_s[1].x(), static_cast<float>((x - before) / h), 1e-5F);
}

TEST(Physics, VelocityVerletStepsAsLongAsItsLimitSays) {
  // For one mode the step matrix is stable while h mu < 2 and (h omega)^2 < 4 - 2 h mu + (h mu)^2, with
  // mu = c_modal: by its trace and determinant (Jury). omega^2 = 45, mu = 3: h < 2/3 by the first,
  // 36 h^2 + 6 h - 4 < 0, so h < 0.2603, by the second.
  const double limit = (-6.0 + std::sqrt(36.0 + 4.0 * 36.0 * 4.0)) / 72.0;
  for (const auto& [h, stable] : {std::pair(0.98 * limit, true), std::pair(1.02 * limit, false)}) {
    Parameters parameters = undamped(Integrator::velocity_verlet);
    parameters.stiffness_per_s2 = 45.0;
    parameters.damping_per_s = 3.0;
    const auto solver = simulation::make_reference_solver(testing_::oscillator_tissue(), parameters);
    solver->hold({{0, 1.0F}});
    State start = solver->state();
    start.positions_mm[1].x() = 0.01F;  // small, lest it pass through the other point
    solver->set_state(start);
    solver->step(200, h);
    const float place = std::abs(solver->state().positions_mm[1].x());
    EXPECT_EQ(place < 0.01F, stable) << h;
  }
}

TEST(Physics, ALinkWithoutALengthOrCutDoesNotAct) {
  auto tissue = testing_::loose_points({{0, 0, 0}, {1, 0, 0}, {0, 2, 0}});
  tissue->links.pairs = {{0, 1}, {0, 2}};
  tissue->links.rest_lengths_mm = {0.0F, 1.0F};
  for (const Integrator integrator : explicit_ones) {
    Parameters parameters;
    parameters.integrator = integrator;
    const auto solver = simulation::make_reference_solver(tissue, parameters);
    EXPECT_EQ(solver->energy().potential, 0.5 * 10000.0);  // the stretched one
    solver->set_links_alive({1}, false);
    EXPECT_EQ(solver->energy().potential, 0.0);
    EXPECT_EQ(solver->link_alive(), (std::vector<std::uint8_t>{1, 0}));
    solver->step(10, 0.001);
    EXPECT_EQ(solver->health().max_displacement_mm, 0.0F);
    solver->set_links_alive({1}, true);
    solver->step(10, 0.001);
    EXPECT_GT(solver->health().max_displacement_mm, 0.01F);
    EXPECT_EQ(solver->state().positions_mm[1], Eigen::Vector3f(1, 0, 0));
    EXPECT_THROW(solver->set_links_alive({2}, false), palpate::core::Error);
  }
}

TEST(Physics, AnchorsNeverMove) {
  const auto tissue = testing_::cube_tissue(3);
  Material material;
  material.anchors = {0, 5, 26};
  for (const Integrator integrator : explicit_ones) {
    SCOPED_TRACE(simulation::to_string(integrator));
    Parameters parameters;
    parameters.integrator = integrator;
    parameters.gravity_mm_per_s2 = {0.0, 0.0, -9810.0};
    const auto solver = simulation::make_reference_solver(tissue, parameters, material);
    State moving = solver->state();
    for (auto& v : moving.velocities_mm_per_s) v = {1.0F, 2.0F, 3.0F};
    solver->set_state(moving);
    solver->hold({{5, 1.0F}, {6, 0.5F}, {26, 0.25F}});
    solver->set_grab_velocity({20.0, 0.0, 0.0});
    solver->step(20, 0.0005);
    const auto expect_still = [&](std::uint32_t point) {
      EXPECT_EQ(solver->state().positions_mm[point], tissue->points.positions_mm[point]);
      EXPECT_EQ(solver->state().velocities_mm_per_s[point], Eigen::Vector3f::Zero());
    };
    for (const std::uint32_t point : {0U, 5U, 26U}) expect_still(point);
    EXPECT_GT((solver->state().positions_mm[6] - tissue->points.positions_mm[6]).norm(), 0.05F);
    // Another list: 26 is free now, and 7 stays where it is from here on.
    solver->set_anchors({0, 5, 7});
    const Eigen::Vector3f place = solver->state().positions_mm[7];
    solver->hold({});
    solver->step(20, 0.0005);
    EXPECT_EQ(solver->state().positions_mm[7], place);
    EXPECT_NE(solver->state().positions_mm[26], tissue->points.positions_mm[26]);
    expect_still(0);
    EXPECT_THROW(solver->set_anchors({27}), palpate::core::Error);
  }
}

TEST(Physics, ABeatShortensTheTissueAndLetsItGoAgain) {
  auto tissue = testing_::loose_points({{0, 0, 0}, {2, 0, 0}});
  tissue->links.pairs = {{0, 1}};
  tissue->links.rest_lengths_mm = {2.0F};
  for (const Integrator integrator : explicit_ones) {
    SCOPED_TRACE(simulation::to_string(integrator));
    Parameters parameters = undamped(integrator);
    parameters.damping_per_s = 100.0;  // 2 c/(2 sqrt(2 k)) = 0.7 of critical: it follows
    parameters.beat_amplitude = 0.25;
    parameters.beat_period_s = 2.0;
    Material material;
    material.anchors = {0};
    const auto solver = simulation::make_reference_solver(tissue, parameters, material);
    solver->step(1000, 0.001);
    // It lags by c/k = 0.01 s at a speed of 0 and bends by A L0 (pi/T)^2 2 of 2.5 mm/s^2, m/k of it: 2.5e-4.
    EXPECT_NEAR(solver->state().positions_mm[1].x(), 1.5F, 1e-3F);
    solver->step(1000, 0.001);
    EXPECT_NEAR(solver->state().positions_mm[1].x(), 2.0F, 1e-3F);
    EXPECT_DOUBLE_EQ(simulation::rest_scale_at(parameters, 2.0 * std::round(solver->time_s() / 2.0)), 1.0);
  }
}

TEST(Physics, AnIntegratorMayBeSwitchedInMidRun) {
  // All of them on one motion, a second each, in steps so small that each is good to 1e-3 of it.
  Parameters parameters = undamped(Integrator::rk4);
  parameters.stiffness_per_s2 = 45.0;
  parameters.damping_per_s = 3.0;
  Material material;
  material.anchors = {0};
  const auto solver = simulation::make_reference_solver(testing_::oscillator_tissue(), parameters, material);
  double time_s = 0.0;
  for (const Integrator integrator :
       {Integrator::verlet, Integrator::rk4, Integrator::euler, Integrator::verlet,
        Integrator::velocity_verlet, Integrator::symplectic_euler}) {
    parameters.integrator = integrator;
    solver->set_parameters(parameters);
    solver->step(2500, 1e-4);
    time_s += 0.25;
    // Of first order: h omega^2 t/2 of the amplitude, 45e-4 * 1.5/2 of 5 mm at most.
    EXPECT_NEAR(static_cast<double>(solver->state().positions_mm[1].x()), testing_::oscillator_place(time_s),
                0.017);
  }
  EXPECT_NEAR(solver->time_s(), 1.5, 1e-9);
}

TEST(Physics, LinkHealthIsWhatIsWorkedOutByHand) {
  auto tissue = testing_::loose_points({{0, 0, 0}, {3, 0, 0}, {3, 4, 0}});
  tissue->links.pairs = {{0, 1}, {1, 2}};
  tissue->links.rest_lengths_mm = {2.0F, 4.0F};
  Parameters parameters = undamped(Integrator::rk4);
  parameters.stiffness_per_s2 = 100.0;
  parameters.mass = 2.0;
  parameters.gravity_mm_per_s2 = {0.0, -10.0, 0.0};
  Material material;
  material.factors = {1.0F, 3.0F, 2.0F};
  material.scales_stiffness = material.scales_mass = true;
  const auto solver = simulation::make_reference_solver(tissue, parameters, material);
  State state = solver->state();
  state.velocities_mm_per_s = {{0.0F, 0.0F, 0.0F}, {-5.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}};
  solver->set_state(state);
  // k of 200 and 250; masses 2, 6, 4; heights 0, 0, 4.
  auto health = solver->link_health();
  EXPECT_DOUBLE_EQ(health.potential, 0.5 * 200.0 * 1.0 + 4.0 * 10.0 * 4.0);
  EXPECT_DOUBLE_EQ(health.kinetic, 0.5 * 6.0 * 25.0 + 0.5 * 4.0 * 1.0);
  EXPECT_FLOAT_EQ(health.max_strain_rate_per_s, 2.5F);  // 5/2; the other 1/4
  EXPECT_EQ(solver->energy().momentum, Eigen::Vector3d(-30.0, 4.0, 0.0));
  solver->set_anchors({0});
  EXPECT_FLOAT_EQ(solver->link_health().max_strain_rate_per_s, 0.25F);
  solver->hold({{2, 0.1F}});
  EXPECT_EQ(solver->link_health().max_strain_rate_per_s, 0.0F);
  solver->hold({});
  solver->set_links_alive({1}, false);
  EXPECT_EQ(solver->link_health().max_strain_rate_per_s, 0.0F);
  EXPECT_DOUBLE_EQ(solver->link_health().potential, 0.5 * 200.0 * 1.0 + 4.0 * 10.0 * 4.0);
}
