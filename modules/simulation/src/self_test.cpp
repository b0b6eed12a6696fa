#include "palpate/simulation/self_test.hpp"

#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/simulation/solver.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>

namespace palpate::simulation {

namespace {

constexpr int compared_steps = 10;
constexpr double step_s = 0.004;
constexpr double tolerance_mm = 5e-4;
constexpr int stages = 4;  // of RK4
constexpr int batches = 5;
constexpr double batch_s = 0.05;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::shared_ptr<const model::Tissue> cube(int side) {
  const core::ImageGeometry geometry({side, side, side}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  const core::Volume volume(geometry, std::vector<float>(geometry.voxel_count(), 1.0F));
  model::TissueParameters parameters;
  parameters.threshold_low = 0.5;
  return std::make_shared<const model::Tissue>(model::generate(volume, parameters));
}

/// Stretched along x, sheared, and moving against itself: every link works.
State begin(const model::Tissue& tissue) {
  State state;
  for (const auto& rest : tissue.points.positions_mm) {
    state.positions_mm.emplace_back(1.03F * rest.x(), rest.y() + 0.02F * rest.x(), 0.99F * rest.z());
    state.velocities_mm_per_s.emplace_back(10.0F * std::sin(0.7F * rest.y()),
                                           10.0F * std::cos(0.5F * rest.z()),
                                           10.0F * std::sin(0.6F * rest.x()));
  }
  return state;
}

/// Infinite where one of them is not finite.
double furthest(const std::vector<Eigen::Vector3f>& a, const std::vector<Eigen::Vector3f>& b) {
  double largest = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n) {
    const double apart = (a[n].cast<double>() - b[n].cast<double>()).norm();
    if (!std::isfinite(apart)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, apart);
  }
  return largest;
}

/// Seconds a step, the best of some batches.
double measured_step_s(Solver& solver) {
  const auto timed = [&solver](int count) {
    const auto start = std::chrono::steady_clock::now();
    solver.step(count, step_s);
    solver.health();  // waits
    return seconds_since(start);
  };
  const double first_s = timed(2);
  const int count = std::clamp(static_cast<int>(2.0 * batch_s / std::max(first_s, 1e-6)), 1, 1000);
  double best_s = std::numeric_limits<double>::infinity();
  for (int batch = 0; batch < batches; ++batch) best_s = std::min(best_s, timed(count) / count);
  return best_s;
}

void run(const compute::Device& device, LayoutChoice layout,
         const std::shared_ptr<const model::Tissue>& tissue, const State& from, const State& expected,
         SelfTestCase& result) {
  OpenclOptions options;
  options.layout = layout;
  const auto solver = make_opencl_solver(device, tissue, Parameters{}, options);
  solver->set_state(from);
  solver->step(compared_steps, step_s);
  result.max_difference_mm = furthest(solver->state().positions_mm, expected.positions_mm);
  if (!(result.max_difference_mm <= tolerance_mm)) {
    result.failure = "its positions differ from the reference's by " +
                     std::to_string(result.max_difference_mm) + " mm, where " + std::to_string(tolerance_mm) +
                     " mm are allowed";
    return;
  }
  const double measured_s = measured_step_s(*solver);
  result.ms_per_step = 1e3 * measured_s;
  result.link_evaluations_per_s = 2.0 * stages * static_cast<double>(result.links) / measured_s;
  result.passed = true;
}

}  // namespace

bool SelfTest::passed() const {
  return !cases.empty() &&
         std::all_of(cases.begin(), cases.end(), [](const auto& one) { return one.passed; });
}

SelfTest self_test(const compute::Device& device, int side, const core::Progress& progress) {
  const auto tissue = cube(side);
  const State from = begin(*tissue);
  const auto reference = make_reference_solver(tissue, Parameters{});
  reference->set_state(from);
  for (int n = 0; n < compared_steps; ++n) {
    progress.cancel().check();
    progress.report(0.5 * n / compared_steps, "Reference");
    reference->step(1, step_s);
  }
  const State expected = reference->state();

  SelfTest result;
  for (const auto layout : {LayoutChoice::lattice, LayoutChoice::explicit_links}) {
    progress.cancel().check();
    progress.report(result.cases.empty() ? 0.5 : 0.75, to_string(layout));
    SelfTestCase one;
    one.layout = to_string(layout);
    one.integrator = to_string(Parameters{}.integrator);
    one.points = tissue->points.size();
    one.links = tissue->links.pairs.size();
    one.steps = compared_steps;
    one.step_s = step_s;
    one.motion_mm = furthest(from.positions_mm, expected.positions_mm);
    one.tolerance_mm = tolerance_mm;
    try {
      run(device, layout, tissue, from, expected, one);
    } catch (const core::Error& error) {
      if (error.kind() == core::ErrorKind::cancelled) throw;
      one.failure = error.what();
    }
    result.cases.push_back(one);
  }
  return result;
}

}  // namespace palpate::simulation
