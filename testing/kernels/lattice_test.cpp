// kernels/lattice.cl, lattice_points.cl and lattice_health.cl against the
// reference solver in double precision and the explicit layout.
#include "device_test.hpp"

#include "palpate/model/generate.hpp"
#include "palpate/simulation/solver.hpp"
#include "palpate/testing/cube_tissue.hpp"

#include <Eigen/Geometry>

#include <cmath>

namespace core = palpate::core;
namespace model = palpate::model;
namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::Integrator;
using simulation::LayoutChoice;
using simulation::Material;
using simulation::Parameters;
using simulation::Solver;
using simulation::State;

namespace {

class LatticeSolver : public testing_::DeviceTest {
 protected:
  std::unique_ptr<Solver> lattice(const std::shared_ptr<model::Tissue>& tissue,
                                  const Parameters& parameters = {}, unsigned width = 0,
                                  const Material& material = {}) const {
    return simulation::make_opencl_solver(device(), tissue, parameters, {width, LayoutChoice::lattice},
                                          material);
  }
};

/// Stiff in one direction, soft tissue of some hundred points whose rows end anywhere.
std::shared_ptr<model::Tissue> ragged_tissue(const Eigen::Vector3d& spacing_mm = Eigen::Vector3d::Ones(),
                                             const Eigen::Matrix3d& direction = Eigen::Matrix3d::Identity()) {
  const std::array<int, 3> dims{19, 11, 10};
  testing_::Numbers numbers(3);
  std::vector<float> values(static_cast<std::size_t>(dims[0] * dims[1] * dims[2]));
  for (float& value : values) value = numbers.between(0.0, 1.0) < 0.8 ? 1.0F : 0.0F;
  const core::Volume volume(core::ImageGeometry(dims, spacing_mm, {5.0, -7.0, 3.0}, direction),
                            std::move(values));
  model::TissueParameters parameters;
  parameters.threshold_low = 0.5;
  return std::make_shared<model::Tissue>(model::generate(volume, parameters));
}

/// A box of points, each linked with its mutual 12 nearest.
std::shared_ptr<model::Tissue> box_tissue(const std::array<int, 3>& dims) {
  const auto count = static_cast<std::size_t>(dims[0]) * static_cast<std::size_t>(dims[1]) *
                     static_cast<std::size_t>(dims[2]);
  const core::Volume volume(core::ImageGeometry(dims, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()),
                            std::vector<float>(count, 1.0F));
  model::TissueParameters parameters;
  parameters.threshold_low = 0.5;
  return std::make_shared<model::Tissue>(model::generate(volume, parameters));
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

// Rest lengths are rounded to steps of 2e-5 mm at most: 1e-5 mm, of either sign,
// for each of a point's links. A chain of ten such links is off by 3e-5 mm, and
// swings there and back.
constexpr float tolerance_mm = 8e-5F;

/// What a run may meet, in turn: a pull of fuzzily held points, cuts, their return, a release.
void go_through_everything(Solver& solver, const State& start, double h) {
  solver.set_state(start);
  solver.hold({{3, 0.25F}, {0, 1.0F}, {20, 0.5F}, {150, 0.75F}});
  solver.step(5, h);
  solver.set_grab_velocity({3.0, 12.0, -5.0});
  solver.step(7, h);
  std::vector<std::uint32_t> cut;
  for (std::uint32_t link = 0; link < solver.link_alive().size(); link += 7) cut.push_back(link);
  solver.set_links_alive(cut, false);
  solver.step(7, h);
  solver.set_grab_velocity(Eigen::Vector3d::Zero());
  solver.hold({});
  cut.resize(cut.size() / 2);
  solver.set_links_alive(cut, true);
  solver.step(6, h);
}

Parameters with(Integrator integrator) {
  Parameters parameters;
  parameters.integrator = integrator;
  return parameters;
}

}  // namespace

TEST_F(LatticeSolver, FollowsTheReferenceWithEveryIntegrator) {
  const auto tissue = ragged_tissue();
  for (const auto integrator : {Integrator::rk4, Integrator::euler, Integrator::symplectic_euler,
                                Integrator::verlet, Integrator::velocity_verlet}) {
    const auto reference = simulation::make_reference_solver(tissue, with(integrator));
    const State start = disturbed(*reference, 0.05, 10.0);
    go_through_everything(*reference, start, 0.0007);  // euler is stable only so far with c = 3
    const auto solver = lattice(tissue, with(integrator));
    go_through_everything(*solver, start, 0.0007);
    EXPECT_GT(furthest(reference->state().positions_mm, start.positions_mm), 0.05F);
    EXPECT_LT(furthest(solver->state().positions_mm, reference->state().positions_mm), tolerance_mm)
        << to_string(integrator);
    EXPECT_NEAR(solver->time_s(), reference->time_s(), 1e-9);
  }
}

TEST_F(LatticeSolver, WidthsAgree) {
  const auto tissue = ragged_tissue();
  const auto reference = simulation::make_reference_solver(tissue, Parameters());
  const State start = disturbed(*reference, 0.05, 10.0);
  go_through_everything(*reference, start, 0.004);
  for (const unsigned width : {1U, 4U, 8U, 16U}) {
    const auto solver = lattice(tissue, Parameters(), width);
    EXPECT_EQ(solver->layout(), "lattice");
    go_through_everything(*solver, start, 0.004);
    EXPECT_LT(furthest(solver->state().positions_mm, reference->state().positions_mm), tolerance_mm) << width;
  }
  EXPECT_THROW(lattice(tissue, Parameters(), 3), core::Error);
}

TEST_F(LatticeSolver, FollowsTheReferenceWithMaterialAnchorsBeatAndGravity) {
  const auto tissue = ragged_tissue();
  Parameters parameters;
  parameters.gravity_mm_per_s2 = {100.0, -9810.0, 300.0};
  parameters.drag_per_s = 5.0;
  parameters.mass = 1.5;
  parameters.beat_amplitude = 0.2;
  parameters.beat_period_s = 0.1;
  Material material;
  testing_::Numbers numbers(8);
  for (std::size_t n = 0; n < tissue->points.size(); ++n)
    material.factors.push_back(static_cast<float>(numbers.between(0.5, 2.0)));
  material.scales_stiffness = material.scales_damping = material.scales_drag = material.scales_mass = true;
  material.anchors = {1, 30, 31, 32, 200};
  const auto reference = simulation::make_reference_solver(tissue, parameters, material);
  const State start = disturbed(*reference, 0.05, 10.0);
  go_through_everything(*reference, start, 0.003);
  for (const unsigned width : {8U, 16U}) {
    const auto solver = lattice(tissue, parameters, width, material);
    go_through_everything(*solver, start, 0.003);
    // Falls by centimetres; the wider swings take the rounding of rest lengths with them.
    EXPECT_LT(furthest(solver->state().positions_mm, reference->state().positions_mm), 2.0F * tolerance_mm)
        << width;
    EXPECT_EQ(solver->state().velocities_mm_per_s[30], Eigen::Vector3f::Zero());
    const auto health = solver->link_health();
    const auto known = reference->link_health();
    EXPECT_NEAR(health.kinetic, known.kinetic, 1e-3 * known.kinetic);
    EXPECT_NEAR(health.potential, known.potential, 1e-3 * std::abs(known.potential));
    EXPECT_NEAR(health.max_strain_rate_per_s, known.max_strain_rate_per_s,
                1e-2F * known.max_strain_rate_per_s);
  }
}

TEST_F(LatticeSolver, FollowsTheReferenceWhereManyLinksLeaveTheStencilAndWhereAxesAreOblique) {
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  // The lengths spread wider where the slices are apart, and their steps with them.
  for (const double slices : {1.0, 2.0, 3.0}) {
    const auto tissue = ragged_tissue({1.0, 1.0, slices}, turned);
    Parameters parameters;
    parameters.gravity_mm_per_s2 = {100.0, -981.0, 300.0};
    const auto reference = simulation::make_reference_solver(tissue, parameters);
    const State start = disturbed(*reference, 0.05, 10.0);
    const auto solver = lattice(tissue, parameters);
    for (Solver* each : {reference.get(), solver.get()}) go_through_everything(*each, start, 0.003);
    EXPECT_LT(furthest(solver->state().positions_mm, reference->state().positions_mm),
              static_cast<float>(1.0 + slices) * tolerance_mm)
        << slices;
  }
}

TEST_F(LatticeSolver, AgreesWithTheExplicitLayoutOnALatticeOfManySlabs) {
  // Forty planes of a thousand points: more than one slab.
  const auto tissue = box_tissue({40, 26, 50});
  const auto solver = simulation::make_opencl_solver(device(), tissue, Parameters());
  const auto other =
      simulation::make_opencl_solver(device(), tissue, Parameters(), {0, LayoutChoice::explicit_links});
  EXPECT_EQ(other->layout(), "explicit");
  EXPECT_FALSE(solver->layout_reason().empty());
  const State start = disturbed(*other, 0.05, 10.0);
  const auto forced = lattice(tissue);
  for (Solver* each : {forced.get(), other.get()}) {
    each->set_state(start);
    each->step(20, 0.003);
  }
  EXPECT_LT(furthest(forced->state().positions_mm, other->state().positions_mm), tolerance_mm);
  EXPECT_LT(forced->bytes(), 300 * tissue->points.size());
  // With a snapshot, which a run always has.
  forced->save_snapshot();
  EXPECT_LT(forced->bytes(), 300 * tissue->points.size());
}

// Mutual nearest points at a box's edges are two planes apart, more than a
// slab would be high where a plane is as large as this.
TEST_F(LatticeSolver, LinksThatLeaveTheStencilSpanNoMoreThanASlab) {
  model::Tissue made = *box_tissue({200, 200, 9});
  // Every tenth point of the first row is tied to the one two planes above.
  for (std::uint32_t point = 0; point < 200; point += 10) {
    made.links.pairs.push_back({point, point + 2 * 200 * 200});
    made.links.rest_lengths_mm.push_back(1.5F);
  }
  const auto tissue = std::make_shared<model::Tissue>(std::move(made));
  const auto one = lattice(tissue);
  const auto other =
      simulation::make_opencl_solver(device(), tissue, Parameters(), {0, LayoutChoice::explicit_links});
  for (Solver* each : {one.get(), other.get()}) each->step(10, 0.003);
  EXPECT_GT(other->health().max_displacement_mm, 0.05F) << "the ties pull";
  EXPECT_LT(furthest(one->state().positions_mm, other->state().positions_mm), tolerance_mm);
}

// Every sum has one order: the same bits each time. Launches of a stage each cut
// the rows into other chunks, whose ends the compiler rounds in another way.
TEST_F(LatticeSolver, ManyStepsInOneLaunchAreTheSameAsALaunchForEveryStage) {
  Parameters beating = with(Integrator::rk4);
  beating.beat_amplitude = 0.2;
  beating.beat_period_s = 0.1;
  std::vector<Parameters> all{beating};
  for (const auto integrator : {Integrator::rk4, Integrator::euler, Integrator::symplectic_euler,
                                Integrator::verlet, Integrator::velocity_verlet, Integrator::implicit_euler})
    all.push_back(with(integrator));
  // One slab that two cores share, a sheet, fewer slabs than passes at once, and many.
  for (const auto& dims :
       {std::array{6, 6, 6}, std::array{40, 40, 1}, std::array{30, 40, 4}, std::array{20, 12, 60}}) {
    const auto tissue = box_tissue(dims);
    for (const Parameters& parameters : all) {
      std::vector<State> results;
      for (const bool launches_every_stage : {false, false, true}) {
        const auto solver = simulation::make_opencl_solver(device(), tissue, parameters,
                                                           {0, LayoutChoice::lattice, launches_every_stage});
        go_through_everything(*solver, disturbed(*solver, 0.05, 10.0), 0.0007);
        for (const int steps : {1, 2, 67, 3}) solver->step(steps, 0.0007);
        results.push_back(solver->state());
      }
      const std::string which = std::to_string(dims[2]) + " planes, " + to_string(parameters.integrator);
      EXPECT_TRUE(results[0].positions_mm == results[1].positions_mm) << which;
      EXPECT_TRUE(results[0].velocities_mm_per_s == results[1].velocities_mm_per_s) << which;
      EXPECT_LT(furthest(results[0].positions_mm, results[2].positions_mm), 1e-5F) << which;
    }
  }
}

TEST_F(LatticeSolver, RunsAreAlikeBitForBit) {
  const auto tissue = ragged_tissue();
  std::array<State, 2> results;
  for (auto& result : results) {
    const auto solver = lattice(tissue);
    go_through_everything(*solver, disturbed(*solver, 0.05, 10.0), 0.004);
    result = solver->state();
  }
  EXPECT_EQ(results[0].positions_mm, results[1].positions_mm);
  EXPECT_EQ(results[0].velocities_mm_per_s, results[1].velocities_mm_per_s);
}

TEST_F(LatticeSolver, KeepsTheMomentumOfAFreeBody) {
  Parameters parameters;
  parameters.drag_per_s = 0.0;
  const auto solver = lattice(ragged_tissue(), parameters);
  solver->set_state(disturbed(*solver, 0.05, 5.0));
  const auto before = solver->energy();
  solver->step(200, 0.003);
  const auto after = solver->energy();
  // A link's force is added to one end and taken from the other, the same number: what is left is
  // the rounding of the sums, 1e-7 of 1e3 mm/s^2 a point and stage, at random.
  EXPECT_LT((after.momentum - before.momentum).norm(), 1e-2);
  EXPECT_LT(after.kinetic + after.potential, 0.5 * (before.kinetic + before.potential));
}

TEST_F(LatticeSolver, RestIsNearlyAtRest) {
  const auto tissue = testing_::cube_tissue(9);
  const auto solver = lattice(tissue);
  // Places are kept relative to their sites, up to 8 mm apart here: off by 2.4e-7 mm a component.
  EXPECT_LT(furthest(solver->state().positions_mm, tissue->points.positions_mm), 5e-7F);
  solver->step(300, 0.005);
  // Rest lengths are rounded by up to 1e-5 mm: so far is the nearest equilibrium.
  EXPECT_LT(solver->health().max_displacement_mm, 3e-5F);
  auto regular = std::make_shared<model::Tissue>(testing_::cube_points(9));
  testing_::link_lattice(*regular, 2);
  const auto exact = lattice(regular);
  exact->step(300, 0.004);
  EXPECT_LT(exact->health().max_displacement_mm, 3e-6F);  // two lengths, hardly rounded
}

TEST_F(LatticeSolver, SnapshotsBringBackStateAndTime) {
  const auto solver = lattice(ragged_tissue(), with(Integrator::verlet));
  EXPECT_THROW(solver->restore_snapshot(), core::Error);
  solver->set_state(disturbed(*solver, 0.1, 1.0));
  solver->step(3, 0.002);
  solver->save_snapshot();
  const State saved = solver->state();
  solver->step(4, 0.002);
  EXPECT_NE(solver->state().positions_mm, saved.positions_mm);
  solver->restore_snapshot();
  EXPECT_EQ(solver->state().positions_mm, saved.positions_mm);
  EXPECT_EQ(solver->state().velocities_mm_per_s, saved.velocities_mm_per_s);
  EXPECT_DOUBLE_EQ(solver->time_s(), 0.006);
  Parameters other = with(Integrator::rk4);  // in mid-run, from wherever the state lies
  solver->set_parameters(other);
  EXPECT_EQ(solver->state().positions_mm, saved.positions_mm);
}

TEST_F(LatticeSolver, ShowsItsPositionsInOneBuffer) {
  const auto tissue = ragged_tissue();
  const auto solver = lattice(tissue, with(Integrator::symplectic_euler));
  const auto* buffer = solver->positions_buffer();
  solver->hold({{5, 1.0F}});
  solver->set_grab_velocity({100.0, 0.0, 0.0});
  solver->step(3, 0.002);
  ASSERT_EQ(solver->positions_buffer(), buffer);
  std::vector<std::array<float, 4>> raw(tissue->points.size());
  buffer->read(raw.data(), raw.size() * 16);
  const State state = solver->state();
  for (std::size_t n = 0; n < raw.size(); ++n)
    EXPECT_EQ(Eigen::Vector3f(raw[n][0], raw[n][1], raw[n][2]), state.positions_mm[n]);
  EXPECT_NEAR(state.positions_mm[5].x() - tissue->points.positions_mm[5].x(), 0.6F, 1e-5F);
}

TEST_F(LatticeSolver, CoincidentAndLoosePointsGiveNoNaN) {
  auto tissue = testing_::loose_points({{1, 1, 1}, {1, 1, 1}, {2, 1, 1}, {5, 5, 5}});
  tissue->links.pairs = {{0, 1}, {0, 2}};
  tissue->links.rest_lengths_mm = {0.5F, 1.0F};
  tissue->geometry = core::ImageGeometry({4, 1, 1}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  const auto solver = lattice(tissue);
  solver->step(20, 0.001);
  EXPECT_TRUE(solver->health().finite);
  EXPECT_LT(solver->health().max_displacement_mm, 1e-6F);
  const auto unlinked = lattice(testing_::loose_points({{0, 0, 0}}));
  unlinked->step(3, 0.01);
  EXPECT_EQ(unlinked->health().max_displacement_mm, 0.0F);
}

TEST_F(LatticeSolver, HealthSeesTheFurthestTheFastestAndWhatIsNotFinite) {
  const auto tissue = ragged_tissue();
  const auto solver = lattice(tissue);
  const State rest = solver->state();
  State state = rest;
  state.positions_mm.back() += Eigen::Vector3f(3.0F, 4.0F, 12.0F);
  state.velocities_mm_per_s[0] = {-6.0F, 8.0F, 0.0F};
  solver->set_state(state);
  EXPECT_TRUE(solver->health().finite);
  EXPECT_NEAR(solver->health().max_displacement_mm, 13.0F, 1e-5F);
  EXPECT_NEAR(solver->health().max_speed_mm_per_s, 10.0F, 1e-5F);
  for (const float wrong :
       {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::infinity()}) {
    state = rest;
    state.positions_mm[100].z() = wrong;
    solver->set_state(state);
    EXPECT_FALSE(solver->health().finite);
    solver->step(1, 0.001);  // built with relaxed arithmetic, and yet it must not be hidden
    EXPECT_FALSE(solver->health().finite);
    // What waited in the sums must not outlive the state.
    solver->set_state(rest);
    solver->step(2, 0.001);
    EXPECT_TRUE(solver->health().finite);
  }
}
