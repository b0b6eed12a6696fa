#include "palpate/session/run.hpp"

#include "solver_setup.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::session {
namespace {

/// Steps between two looks of the guard and the cancel token. Fixed, so that
/// a run does not depend on the machine's speed.
constexpr int steps_per_batch = 16;
/// Times that differ by less than this part of a step are the same step boundary.
constexpr double boundary = 1e-6;

interaction::Ray ray_at(const std::vector<interaction::GesturePoint>& path, double t_s) {
  if (t_s <= path.front().t_s) return path.front().ray;
  if (t_s >= path.back().t_s) return path.back().ray;
  const auto after = std::upper_bound(path.begin(), path.end(), t_s,
                                      [](double t, const interaction::GesturePoint& p) { return t < p.t_s; });
  const auto before = after - 1;
  const double part = (t_s - before->t_s) / (after->t_s - before->t_s);
  interaction::Ray ray;
  ray.origin_mm = before->ray.origin_mm + part * (after->ray.origin_mm - before->ray.origin_mm);
  const Eigen::Vector3d direction =
      before->ray.direction + part * (after->ray.direction - before->ray.direction);
  // Opposite directions have no middle: keep the earlier one.
  ray.direction = direction.norm() > 1e-9 ? Eigen::Vector3d(direction.normalized()) : before->ray.direction;
  return ray;
}

/// Plays a gesture at the boundaries of the steps.
class GesturePlayer {
 public:
  GesturePlayer(const interaction::Gesture& gesture, simulation::Solver& solver, const model::Tissue& tissue)
      : gesture_(gesture),
        adjacency_(model::adjacency_of(tissue.links, tissue.points.size())),
        grab_(solver, tissue, adjacency_) {}

  /// Before a step from t to t + h. False while nothing happens in it.
  bool before_step(double t_s, double h_s) {
    release_if_over(t_s, h_s);
    while (!grabbing_ && next_ < gesture_.steps.size() &&
           gesture_.steps[next_].path.front().t_s <= t_s + boundary * h_s) {
      begin(next_++);
      release_if_over(t_s, h_s);
    }
    if (!grabbing_) return false;
    const auto& path = gesture_.steps[next_ - 1].path;
    grab_.drag_to(ray_at(path, t_s + h_s), h_s);
    return true;
  }
  void at_end(double t_s, double h_s) { release_if_over(t_s, h_s); }
  /// When the next use of a tool begins; infinite after the last.
  double next_begin_s() const {
    return next_ < gesture_.steps.size() ? gesture_.steps[next_].path.front().t_s
                                         : std::numeric_limits<double>::infinity();
  }
  const std::vector<core::Warning>& warnings() const { return warnings_; }

 private:
  void begin(std::size_t index) {
    const auto& step = gesture_.steps[index];
    grabbing_ =
        grab_.begin(step.path.front().ray, interaction::reach_of(step), step.radius_mm, step.selection);
    if (!grabbing_)
      warnings_.push_back({"gesture-missed", "steps[" + std::to_string(index) +
                                                 "] of the gesture met no tissue and did nothing."});
  }
  void release_if_over(double t_s, double h_s) {
    if (!grabbing_ || gesture_.steps[next_ - 1].path.back().t_s > t_s + boundary * h_s) return;
    grab_.release();
    grabbing_ = false;
  }

  const interaction::Gesture& gesture_;
  model::Adjacency adjacency_;
  Grab grab_;
  std::size_t next_ = 0;
  bool grabbing_ = false;
  std::vector<core::Warning> warnings_;
};

struct Plan {
  double step_s = 0.0;
  double end_s = 0.0;
};

/// A step that the user named is kept; the automatic one is shortened a little
/// so that whole steps make the time.
Plan plan_of(const SimulationSettings& settings, const simulation::StableStep& bound,
             const RunRequest& request) {
  Plan plan;
  plan.step_s = settings.step_s ? *settings.step_s : simulation::automatic_step_s(bound);
  if (!(plan.step_s > 0.0) || !std::isfinite(plan.step_s) || plan.step_s > 1.0)
    core::throw_usage("The step must be above 0 s and at most 1 s.");
  if (request.steps) {
    if (*request.steps < 0) core::throw_usage("The number of steps must not be negative.");
    plan.end_s = static_cast<double>(*request.steps) * plan.step_s;
    return plan;
  }
  if (!(request.seconds >= 0.0) || request.seconds > 1e6)
    core::throw_usage("The time to simulate must be from 0 to 1000000 s.");
  const double steps = std::ceil(request.seconds / plan.step_s - boundary);
  if (!settings.step_s && steps > 0.0) plan.step_s = request.seconds / steps;
  plan.end_s = steps * plan.step_s;
  return plan;
}

/// Advances to the end of the plan; the result's counts and message.
void advance(const Plan& plan, GesturePlayer* player, simulation::Solver& solver, simulation::Guard& guard,
             RunResult& result, const core::Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  // Counted in steps, not in sums of times, so that no rounding adds one.
  double t_s = 0.0;
  while (!guard.diverged()) {
    const double h_s = guard.step_s();
    const double left = std::round((plan.end_s - t_s) / h_s);
    if (left < 1.0) break;
    int count = static_cast<int>(std::min<double>(steps_per_batch, left));
    if (player != nullptr) {
      if (player->before_step(t_s, h_s)) {
        count = 1;
      } else {
        const double free_steps = std::ceil((player->next_begin_s() - t_s) / h_s - boundary);
        count = static_cast<int>(std::clamp(free_steps, 1.0, static_cast<double>(count)));
      }
    }
    progress.report(t_s / plan.end_s, "Simulating");
    const auto report = guard.advance(count);
    result.steps += report.steps_done;
    t_s += static_cast<double>(count) * h_s;
    if (!report.message.empty()) result.message = report.message;
    if (report.paused) break;
  }
  if (player != nullptr) player->at_end(t_s, guard.step_s());
  solver.health();  // waits for the queue, so that the time is that of the work
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

RunResult run(const BuiltTissue& tissue, const BoundSurface& surface, const SimulationSettings& settings,
              const RunRequest& request, const core::Progress& progress) {
  const Plan plan = plan_of(settings, tissue.stable_step, request);
  if (request.gesture) interaction::check_within(*request.gesture, plan.end_s * (1.0 + boundary));
  progress.report(0.0, "Preparing the device");
  SolverOnDevice on = open_solver(request.device, tissue.tissue, settings.parameters);
  simulation::Solver& solver = *on.solver;
  simulation::Guard guard(solver, plan.step_s, simulation::Guard::usual_halvings, progress.cancel());
  std::optional<GesturePlayer> player;
  if (request.gesture) player.emplace(*request.gesture, solver, *tissue.tissue);

  RunResult result;
  advance(plan, player ? &*player : nullptr, solver, guard, result, progress.part(0.0, 0.98));
  if (player) result.warnings = player->warnings();
  result.state = solver.state();
  SurfaceFollower follower(on, surface, tissue.tissue->points.center_mm);
  if (follower.mapped()) {
    auto deformed = std::make_shared<surface::DeformedSurface>(follower.vertex_count());
    follower.deform(result.state.positions_mm, *deformed);
    result.surface = std::move(deformed);
  }
  result.energy = solver.energy();
  result.step_s = guard.step_s();
  result.stable_step_s = tissue.stable_step.step_s;
  result.seconds = result.state.time_s;
  result.max_displacement_mm = max_displacement_mm(*tissue.tissue, result.state.positions_mm);
  result.recoveries = guard.recoveries();
  result.diverged = guard.diverged();
  result.integrator = simulation::to_string(settings.parameters.integrator);
  result.layout = solver.layout();
  result.device = solver.device_name();
  result.driver = solver.driver();
  progress.report(1.0, "Simulated");
  return result;
}

}  // namespace palpate::session
