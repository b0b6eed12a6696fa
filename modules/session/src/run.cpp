#include "palpate/session/run.hpp"

#include "solver_setup.hpp"
#include "step_plan.hpp"

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
  StepPlan step;
  double end_s = 0.0;
};

/// A step that the user named is kept, or taken in parts; the automatic one is
/// shortened a little so that whole steps make the time.
Plan plan_of(const SimulationSettings& settings, const simulation::StableStep& limit,
             const RunRequest& request) {
  Plan plan;
  plan.step = plan_step(settings.step_s, limit);
  const double asked_step_s = settings.step_s.value_or(plan.step.step_s);
  if (request.steps) {
    if (*request.steps < 0) core::throw_usage("The number of steps must not be negative.");
    plan.end_s = static_cast<double>(*request.steps) * asked_step_s;
    return plan;
  }
  if (!(request.seconds >= 0.0) || request.seconds > 1e6)
    core::throw_usage("The time to simulate must be from 0 to 1000000 s.");
  const double steps = std::ceil(request.seconds / asked_step_s - boundary);
  if (!settings.step_s && steps > 0.0) plan.step.step_s = request.seconds / steps;
  plan.end_s = settings.step_s ? steps * asked_step_s : request.seconds;
  return plan;
}

/// Shortens the step while the tissue is stretched, and so stiffer than at rest.
class StretchWatch {
 public:
  StretchWatch(const BuiltTissue& tissue, const SimulationSettings& settings,
               const simulation::Solver& solver, StableLimit limit)
      : tissue_(tissue), settings_(settings), solver_(solver), limit_(limit) {}

  /// The step to go on with, given how far points are from rest. Looks again
  /// only when that changed by a third, since a look costs as much as some steps.
  double step_s(double now_s, std::int64_t steps_taken, const simulation::Guard& guard,
                double displacement_mm) {
    const double change_mm = std::abs(displacement_mm - looked_at_mm_);
    const bool is_due = steps_taken - looked_at_ >= steps_between_looks &&
                        change_mm > std::max(0.2 * solver_.link_length_mm(), looked_at_mm_ / 3.0);
    if (!is_due) return now_s;
    looked_at_ = steps_taken;
    looked_at_mm_ = displacement_mm;
    const auto state = solver_.state();
    limit_.set_stretched(
        simulation::stable_step(*tissue_.tissue, settings_.parameters,
                                {&state.positions_mm, &solver_.link_alive(), &solver_.material()}));
    const double wanted_s = plan_step(settings_.step_s, limit_.now()).step_s;
    // A step that the guard halved is not made longer again.
    const bool shorter = wanted_s < 0.98 * now_s;
    const bool longer = wanted_s > 1.1 * now_s && guard.recoveries() == 0;
    return shorter || longer ? wanted_s : now_s;
  }

 private:
  static constexpr std::int64_t steps_between_looks = 16;
  const BuiltTissue& tissue_;
  const SimulationSettings& settings_;
  const simulation::Solver& solver_;
  StableLimit limit_;
  std::int64_t looked_at_ = 0;
  double looked_at_mm_ = 0.0;
};

/// Advances to the end of the plan; the result's counts and message.
void advance(const Plan& plan, GesturePlayer* player, StretchWatch& stretch, simulation::Solver& solver,
             simulation::Guard& guard, RunResult& result, const core::Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  // Counted in steps, not in sums of times, so that no rounding adds one.
  double t_s = 0.0;
  while (!guard.diverged()) {
    const double left_s = plan.end_s - t_s;
    if (left_s < 0.5 * guard.step_s()) break;
    const double wanted_s = stretch.step_s(guard.step_s(), result.steps, guard,
                                           static_cast<double>(solver.health().max_displacement_mm));
    // Whole steps make the time that is left.
    if (wanted_s != guard.step_s()) guard.set_step_s(left_s / std::ceil(left_s / wanted_s - boundary));
    const double h_s = guard.step_s();
    int count =
        static_cast<int>(std::clamp(std::round(left_s / h_s), 1.0, static_cast<double>(steps_per_batch)));
    if (player != nullptr) {
      if (player->before_step(t_s, h_s)) {
        count = 1;
        guard.disturbed();
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

/// The largest stable step of the tissue at rest: the estimate, where steps are to be taken.
StableLimit limit_of(const BuiltTissue& tissue, const SimulationSettings& settings, const RunRequest& request,
                     const core::Progress& progress) {
  StableLimit limit;
  const simulation::StabilityCase at{nullptr, nullptr, &tissue.material};
  limit.set_bound(simulation::stable_step(*tissue.tissue, settings.parameters, at));
  if (request.steps != 0L)
    limit.set_estimate(simulation::estimated_stable_step(*tissue.tissue, settings.parameters, at, progress));
  return limit;
}

}  // namespace

RunResult run(const BuiltTissue& tissue, const BoundSurface& surface, const SimulationSettings& settings,
              const RunRequest& request, const core::Progress& progress) {
  const StableLimit limit = limit_of(tissue, settings, request, progress.part(0.0, 0.02));
  const Plan plan = plan_of(settings, limit.now(), request);
  if (request.gesture) interaction::check_within(*request.gesture, plan.end_s * (1.0 + boundary));
  progress.report(0.02, "Preparing the device");
  simulation::OpenclOptions options;
  options.layout = settings.layout;
  SolverOnDevice on =
      open_solver(request.device, tissue.tissue, settings.parameters, options, tissue.material);
  simulation::Solver& solver = *on.solver;
  simulation::Guard guard(solver, plan.step.step_s, simulation::Guard::usual_halvings, progress.cancel());
  std::optional<GesturePlayer> player;
  if (request.gesture) player.emplace(*request.gesture, solver, *tissue.tissue);

  RunResult result;
  StretchWatch stretch(tissue, settings, solver, limit);
  advance(plan, player ? &*player : nullptr, stretch, solver, guard, result, progress.part(0.02, 0.98));
  if (player) result.warnings = player->warnings();
  if (const auto text = explain(plan.step, settings.step_s.value_or(0.0), limit.now()); !text.empty())
    result.warnings.push_back({plan.step.has_no_limit ? "no-stable-step" : "substeps", text});
  result.state = solver.state();
  SurfaceFollower follower(on, surface, tissue.tissue->points.center_mm);
  if (follower.mapped()) {
    auto deformed = std::make_shared<surface::DeformedSurface>(follower.vertex_count());
    follower.deform(result.state.positions_mm, *deformed);
    result.surface = std::move(deformed);
  }
  result.energy = solver.energy();
  result.step_s = guard.step_s();
  result.substeps = plan.step.substeps;
  result.stable_step_s = limit.now().step_s;
  result.stable_step_is_estimate = limit.now().is_estimate;
  result.worst_point = limit.now().worst_point;
  result.seconds = result.state.time_s;
  result.max_displacement_mm = max_displacement_mm(*tissue.tissue, result.state.positions_mm);
  result.recoveries = guard.recoveries();
  result.diverged = guard.diverged();
  result.integrator = simulation::to_string(settings.parameters.integrator);
  result.layout = solver.layout();
  result.layout_reason = solver.layout_reason();
  result.device = solver.device_name();
  result.driver = solver.driver();
  progress.report(1.0, "Simulated");
  return result;
}

}  // namespace palpate::session
