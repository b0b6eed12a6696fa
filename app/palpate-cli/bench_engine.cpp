#include "bench_engine.hpp"

#include "core_distance.hpp"
#include "values.hpp"

#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/simulation/published.hpp"
#include "palpate/simulation/solver.hpp"
#include "palpate/simulation/stability.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>

namespace palpate::cli {
namespace {

using Clock = std::chrono::steady_clock;
constexpr double thesis_step_s = 0.006;
constexpr int compared_steps = 10;
constexpr double patience_s = 45.0;  // for runs that are taken again

enum class Body { cube, heart };

struct Case {
  const char* name;
  Body body;
  int side;  ///< points along an edge of the cube
  model::LinkRule links;
  double noise;
  simulation::Integrator integrator;
};

constexpr double jitter = 0.1;
constexpr auto nearest = model::LinkRule::nearest;
constexpr auto rk4 = simulation::Integrator::rk4;
/// The mapping paper's model: 18 neighbours, springs without dampers.
constexpr std::array<Case, 13> cases{{{"jittered-20k", Body::cube, 27, nearest, jitter, rk4},
                                      {"jittered-216k", Body::cube, 60, nearest, jitter, rk4},
                                      {"jittered-1m", Body::cube, 100, nearest, jitter, rk4},
                                      {"heart-708k", Body::heart, 0, nearest, jitter, rk4},
                                      {"lattice18-20k-verlet", Body::cube, 27, model::LinkRule::lattice18,
                                       0.0, simulation::Integrator::verlet},
                                      {"growth-20k", Body::cube, 27, nearest, jitter, rk4},
                                      {"growth-50k", Body::cube, 37, nearest, jitter, rk4},
                                      {"growth-100k", Body::cube, 46, nearest, jitter, rk4},
                                      {"growth-200k", Body::cube, 58, nearest, jitter, rk4},
                                      {"growth-500k", Body::cube, 79, nearest, jitter, rk4},
                                      {"growth-1m", Body::cube, 100, nearest, jitter, rk4},
                                      {"growth-2m", Body::cube, 126, nearest, jitter, rk4},
                                      {"growth-5m", Body::cube, 171, nearest, jitter, rk4}}};

const Case& case_of(const std::string& name) {
  return *std::find_if(cases.begin(), cases.end(), [&](const Case& one) { return name == one.name; });
}

constexpr float inside = 100.0F;

/// A thick-walled half-open ellipsoid, the shape of a left ventricle, that
/// fills about a quarter of the thesis' 116 x 200 x 117 voxels.
bool is_heart_wall(const Eigen::Vector3d& place) {
  constexpr double cavity = 0.78;  // of the outer axes
  constexpr double base = 0.8;     // where the wall ends, along the long axis
  return place.norm() <= 1.0 && place.norm() >= cavity && place.y() <= base;
}

core::Volume volume_of(const Case& one) {
  const std::array<int, 3> dims = one.body == Body::cube ? std::array<int, 3>{one.side, one.side, one.side}
                                                         : std::array<int, 3>{116, 200, 117};
  std::vector<float> voxels;
  voxels.reserve(static_cast<std::size_t>(dims[0]) * static_cast<std::size_t>(dims[1]) *
                 static_cast<std::size_t>(dims[2]));
  const auto part = [&](int at, std::size_t axis) { return (2.0 * at + 1.0) / dims[axis] - 1.0; };
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j)
      for (int i = 0; i < dims[0]; ++i)
        voxels.push_back(
            one.body == Body::cube || is_heart_wall({part(i, 0), part(j, 1), part(k, 2)}) ? inside : 0.0F);
  return {core::ImageGeometry(dims, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()), std::move(voxels)};
}

model::Tissue tissue_of(const Case& one, const core::Volume& volume, const core::Progress& progress) {
  model::TissueParameters parameters;
  parameters.threshold_low = inside / 2.0;
  parameters.noise = one.noise;
  parameters.links = one.links;
  return model::generate(volume, parameters, progress);
}

/// The tissue in a slow swing, so that nothing is zero or too small to count.
simulation::State swinging(const model::Tissue& tissue) {
  simulation::State state;
  state.positions_mm = tissue.points.positions_mm;
  for (const auto& x : state.positions_mm)
    state.velocities_mm_per_s.emplace_back(20.0F * std::sin(0.1F * x.y()), 15.0F * std::cos(0.07F * x.z()),
                                           10.0F * std::sin(0.05F * x.x() + 1.0F));
  return state;
}

double furthest_mm(const simulation::State& a, const simulation::State& b) {
  double largest = 0.0;
  for (std::size_t n = 0; n < a.positions_mm.size(); ++n) {
    const double apart = static_cast<double>((a.positions_mm[n] - b.positions_mm[n]).norm());
    if (!(apart <= largest)) largest = apart;  // NaN stays
  }
  return largest;
}

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

using Steps = std::function<void(int)>;

/// Seconds a step, over as many steps as fill a run.
class Timer {
 public:
  Timer(Steps steps, const compute::Device& device, double run_s)
      : steps_(std::move(steps)), device_(device) {
    timed(2);
    constexpr int first = 3;
    const double each_s = timed(first);
    count_ = static_cast<int>(std::clamp(run_s / each_s, 2.0, 20000.0));
  }
  double run() const { return timed(count_); }

 private:
  double timed(int count) const {
    const auto start = Clock::now();
    steps_(count);
    device_.finish();
    return seconds_since(start) / count;
  }
  Steps steps_;
  const compute::Device& device_;
  int count_ = 1;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

double evaluations(const EngineFigure& figure, const std::string& integrator, double ms_per_step) {
  const double passes = integrator == "rk4" ? 4.0 : 1.0;
  return 2.0 * static_cast<double>(figure.links) * passes / (ms_per_step / 1000.0);
}

/// Both from the same state, ten steps of the same size.
void compare(EngineFigure& figure, simulation::Solver& solver, simulation::PublishedSimulation& published,
             const std::shared_ptr<const model::Tissue>& tissue, double step_s) {
  const auto state = swinging(*tissue);
  solver.set_state(state);
  solver.step(compared_steps, step_s);
  published.set_state(state);
  if (solver.parameters().integrator == simulation::Integrator::rk4) {
    published.step(compared_steps, step_s);
    figure.compared_with = "the published layout";
    figure.max_difference_mm = furthest_mm(solver.state(), published.state());
    return;
  }
  // Another integrator goes another way: then against the same in double.
  const auto reference = simulation::make_reference_solver(tissue, solver.parameters());
  reference->set_state(state);
  reference->step(compared_steps, step_s);
  figure.compared_with = "the CPU reference";
  figure.max_difference_mm = furthest_mm(solver.state(), reference->state());
}

struct Run {
  double our_s = 0.0;
  double their_s = 0.0;
  double round_trip_ns = 0.0;
};

/// In turn, as many as figure.runs says. Of a processor those runs are taken again
/// in which the host had put its cores on different caches: a run has to be had on
/// one machine. Which, is decided by the cores' distance, not by the times.
void take_runs(EngineFigure& figure, const Timer& ours, const Timer& theirs, bool on_processor, double wait_s,
               const core::Progress& progress) {
  const auto distance_ns = [&] { return on_processor ? core_round_trip_ns() : 0.0; };
  const auto start = Clock::now();
  std::vector<Run> near;
  std::vector<Run> far;
  const auto wanted = static_cast<std::size_t>(figure.runs);
  while (near.size() < wanted && (near.size() + far.size() < wanted || seconds_since(start) < wait_s)) {
    const double before_ns = distance_ns();
    Run run{ours.run(), theirs.run(), 0.0};
    run.round_trip_ns = std::max(before_ns, distance_ns());
    (run.round_trip_ns > far_apart_ns ? far : near).push_back(run);
    progress.report(static_cast<double>(near.size()) / figure.runs, "Measuring " + figure.name);
  }
  figure.disturbed_runs = static_cast<int>(wanted - near.size());
  figure.repeated_runs = static_cast<int>(near.size() + far.size() - wanted);
  near.insert(near.end(), far.end() - figure.disturbed_runs, far.end());
  std::vector<double> our_s;
  std::vector<double> their_s;
  for (const Run& run : near) {
    our_s.push_back(run.our_s);
    their_s.push_back(run.their_s);
    figure.core_round_trip_ns = std::max(figure.core_round_trip_ns, run.round_trip_ns);
  }
  figure.ms_per_step = median(our_s) * 1000.0;
  figure.baseline_ms_per_step = median(their_s) * 1000.0;
}

}  // namespace

const std::vector<std::string>& engine_cases() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const Case& one : cases) list.emplace_back(one.name);
    return list;
  }();
  return names;
}

EngineFigure measure_engine(const std::string& name, const compute::Device& device, double triad_gb_s,
                            bool quick, const core::Progress& progress) {
  const Case& one = case_of(name);
  const core::Volume volume = volume_of(one);
  EngineFigure figure;
  figure.name = name;
  simulation::Parameters parameters;
  parameters.integrator = one.integrator;
  if (one.links == model::LinkRule::lattice18) parameters.damping_per_s = 0.0;

  const auto start = Clock::now();
  const auto tissue = std::make_shared<const model::Tissue>(tissue_of(one, volume, progress.part(0.0, 0.2)));
  const auto solver = simulation::make_opencl_solver(device, tissue, parameters);
  device.finish();
  figure.build_s = seconds_since(start);
  progress.report(0.3, "Measuring " + name);

  simulation::Parameters plain = parameters;
  plain.integrator = rk4;
  simulation::PublishedSimulation published(device, *tissue, plain);
  const double step_s =
      std::min(thesis_step_s, simulation::automatic_step_s(simulation::stable_step(*tissue, parameters)));
  figure.points = tissue->points.size();
  figure.links = tissue->links.size();
  figure.integrator = simulation::to_string(one.integrator);
  figure.layout = solver->layout();
  compare(figure, *solver, published, tissue, step_s);
  progress.report(0.4, "Measuring " + name);

  const double run_s = quick ? 0.1 : 0.4;
  figure.runs = quick ? 3 : 5;
  const Timer ours([&](int count) { solver->step(count, step_s); }, device, run_s);
  const Timer theirs([&](int count) { published.step(count, step_s); }, device, run_s);
  take_runs(figure, ours, theirs, device.info().type == compute::DeviceType::cpu, quick ? 0.0 : patience_s,
            progress.part(0.4, 1.0));
  figure.link_evaluations_per_s = evaluations(figure, figure.integrator, figure.ms_per_step);
  figure.baseline_link_evaluations_per_s = evaluations(figure, "rk4", figure.baseline_ms_per_step);
  figure.speedup = figure.link_evaluations_per_s / figure.baseline_link_evaluations_per_s;
  figure.bytes_per_step = static_cast<double>(solver->bytes_per_step());
  figure.bandwidth_fraction = figure.bytes_per_step / (figure.ms_per_step / 1000.0) / (triad_gb_s * 1e9);
  figure.realtime_factor = thesis_step_s * 1000.0 / figure.ms_per_step;
  const auto points = static_cast<double>(figure.points);
  figure.device_bytes_per_point = static_cast<double>(solver->bytes()) / points;
  figure.baseline_bytes_per_point = static_cast<double>(published.bytes()) / points;
  return figure;
}

Json to_json(const EngineFigure& figure) {
  Json object;
  object["name"] = figure.name;
  object["points"] = figure.points;
  object["links"] = figure.links;
  object["integrator"] = figure.integrator;
  object["layout"] = figure.layout;
  object["runs"] = figure.runs;
  object["repeated_runs"] = figure.repeated_runs;
  object["disturbed_runs"] = figure.disturbed_runs;
  object["core_round_trip_ns"] =
      figure.core_round_trip_ns > 0.0 ? number(figure.core_round_trip_ns) : Json(nullptr);
  object["ms_per_step"] = number(figure.ms_per_step);
  object["baseline_ms_per_step"] = number(figure.baseline_ms_per_step);
  object["speedup"] = number(figure.speedup);
  object["max_difference_mm"] = number(figure.max_difference_mm);
  object["compared_with"] = figure.compared_with;
  object["link_evaluations_per_s"] = number(figure.link_evaluations_per_s);
  object["baseline_link_evaluations_per_s"] = number(figure.baseline_link_evaluations_per_s);
  const bool known = figure.bytes_per_step > 0.0;
  object["bytes_per_step"] = known ? number(figure.bytes_per_step) : Json(nullptr);
  object["bandwidth_fraction"] = known ? number(figure.bandwidth_fraction) : Json(nullptr);
  object["realtime_factor"] = number(figure.realtime_factor);
  object["build_s"] = number(figure.build_s);
  object["device_bytes_per_point"] = number(figure.device_bytes_per_point);
  object["baseline_bytes_per_point"] = number(figure.baseline_bytes_per_point);
  return object;
}

std::string to_text(const EngineFigure& figure) {
  std::string text = shown_count(figure.points) + " points, " + figure.layout + ", " + figure.integrator +
                     ": " + shown(figure.ms_per_step, 3) + " ms a step; published layout " +
                     shown(figure.baseline_ms_per_step, 3) + " ms: " + shown(figure.speedup, 3) + " times; " +
                     shown(figure.link_evaluations_per_s / 1e9, 3) + " G links/s; real time times " +
                     shown(figure.realtime_factor, 3);
  if (figure.bytes_per_step > 0.0)
    text += "; " + shown(100.0 * figure.bandwidth_fraction, 3) + " % of the triad";
  if (figure.disturbed_runs > 0)
    text += "; " + std::to_string(figure.disturbed_runs) + " of " + std::to_string(figure.runs) +
            " runs with the processors on different caches (" + shown(figure.core_round_trip_ns, 2) +
            " ns there and back)";
  return text + "; built in " + shown(figure.build_s, 3) + " s; " + shown(figure.device_bytes_per_point, 3) +
         " bytes a point; within " + shown(figure.max_difference_mm, 2) + " mm of " + figure.compared_with;
}

}  // namespace palpate::cli
