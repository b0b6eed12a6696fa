#include "driver_loop.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::session {
namespace {

constexpr double frame_s = 1.0 / 60.0;
/// The longest that commands wait for a batch of steps.
constexpr double batch_wall_s = 0.025;
constexpr std::size_t history_bytes = std::size_t{256} << 20U;
/// Weight of the newest measurement in the smoothed ones: about ten frames.
constexpr double newest = 0.1;

double seconds(DriverLoop::Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

DriverLoop::Clock::duration wall(double duration_s) {
  return std::chrono::duration_cast<DriverLoop::Clock::duration>(std::chrono::duration<double>(duration_s));
}

void smooth(double& value, double measured) {
  value = value > 0.0 ? (1.0 - newest) * value + newest * measured : measured;
}

}  // namespace

DriverLoop::DriverLoop(const DriverSetup& setup, Publish publish, Tell tell, const core::CancelToken& stop)
    : setup_(setup), publish_(std::move(publish)), tell_(std::move(tell)), history_(history_bytes) {
  const auto& tissue = setup_.tissue.tissue;
  bound_ = setup_.tissue.stable_step;
  adjacency_ = model::adjacency_of(tissue->links, tissue->points.size());
  stop.check();
  on_ = open_solver(setup_.device, tissue, setup_.settings.parameters);
  stop.check();
  follower_.emplace(on_, setup_.surface, tissue->points.center_mm);
  stop.check();
  grab_.emplace(*on_.solver, *tissue, adjacency_);
  guard_.emplace(*on_.solver, simulation::automatic_step_s(bound_), simulation::Guard::usual_halvings, stop);
  use_step();
  if (setup_.start) restore(*setup_.start);
  setup_.start.reset();
}

void DriverLoop::apply(const Command& command) {
  std::visit([this](const auto& one) { on(one); }, command);
}

void DriverLoop::publish_if_changed() {
  if (changed_) publish();
}

// ---- commands

void DriverLoop::on(const command::Play&) {
  if (playing_) return;
  if (guard_->diverged()) {
    tell_({DriverEvent::Kind::diverged,
           "The simulation cannot go on from here. Reset it, undo the last drag, or take a smaller step.",
           "diverged", ""});
    return;
  }
  playing_ = true;
  last_ = Clock::now();
  owed_s_ = 0.0;
  changed_ = true;
}

void DriverLoop::on(const command::Pause&) { pause(); }

void DriverLoop::on(const command::StepOnce&) {
  pause();
  if (!guard_->diverged()) take_steps(1);
}

void DriverLoop::on(const command::Reset&) {
  let_go();
  history_.push(on_.solver->state());
  simulation::State rest;
  rest.positions_mm = setup_.tissue.tissue->points.positions_mm;
  rest.velocities_mm_per_s.assign(rest.positions_mm.size(), Eigen::Vector3f::Zero());
  restore(rest);
}

void DriverLoop::on(const command::SetParameters& command) {
  simulation::check(command.parameters);
  setup_.settings.parameters = command.parameters;
  on_.solver->set_parameters(command.parameters);
  update_bound(on_.solver->state().positions_mm);
  use_step();
}

void DriverLoop::on(const command::SetStep& command) {
  if (command.step_s && (!(*command.step_s > 0.0) || *command.step_s > 1.0))
    core::throw_usage("The step must be above 0 s and at most 1 s.");
  setup_.settings.step_s = command.step_s;
  use_step();
}

void DriverLoop::on(const command::SetSettings& command) {
  on(command::SetStep{command.settings.step_s});
  on(command::SetParameters{command.settings.parameters});
}

void DriverLoop::on(const command::GrabAt& command) {
  let_go();
  auto before = on_.solver->state();
  if (!grab_->begin(command.ray, command.reach, command.radius_mm, command.kind)) return;
  before_drag_ = std::move(before);
  grab_radius_mm_ = command.radius_mm;
  changed_ = true;
}

void DriverLoop::on(const command::DragTo& command) {
  if (grab_->active()) drag_ray_ = command.ray;
}

void DriverLoop::on(const command::Release&) { let_go(); }

void DriverLoop::on(const command::Undo&) {
  let_go();
  if (const auto state = history_.undo(on_.solver->state())) restore(*state);
}

void DriverLoop::on(const command::Redo&) {
  let_go();
  if (const auto state = history_.redo(on_.solver->state())) restore(*state);
}

// ---- parts of them

/// One drag is one command of the history, whatever happened in it.
void DriverLoop::let_go() {
  if (!grab_->active()) return;
  grab_->release();
  drag_ray_.reset();
  history_.push(std::move(*before_drag_));
  before_drag_.reset();
  changed_ = true;
}

void DriverLoop::restore(const simulation::State& state) {
  on_.solver->set_state(state);
  guard_->clear();
  update_bound(state.positions_mm);
  use_step();
  owed_s_ = 0.0;
}

void DriverLoop::update_bound(const std::vector<Eigen::Vector3f>& positions_mm) {
  bound_ = simulation::stable_step(*setup_.tissue.tissue, setup_.settings.parameters, {&positions_mm});
}

/// The step that the user named, or the automatic one. A named step above the
/// bound is allowed: the frame says both, and the guard watches.
void DriverLoop::use_step() {
  guard_->set_step_s(setup_.settings.step_s ? *setup_.settings.step_s : simulation::automatic_step_s(bound_));
  if (guard_->diverged()) guard_->clear();
  changed_ = true;
}

void DriverLoop::pause() {
  if (playing_) changed_ = true;
  playing_ = false;
  realtime_factor_ = 0.0;
}

// ---- time

/// The selection reaches the newest ray by the end of the batch, but takes at
/// least a frame's time for it, so that a slow device does not turn a drag of
/// the mouse into a blow.
void DriverLoop::steer_grab(double batch_s) {
  if (!grab_->active()) return;
  if (drag_ray_)
    grab_->drag_to(*drag_ray_, std::max(batch_s, frame_s));
  else
    grab_->rest();
}

void DriverLoop::take_steps(int count) {
  const auto start = Clock::now();
  steer_grab(count * guard_->step_s());
  const auto report = guard_->advance(count);
  smooth(wall_per_step_s_, seconds(Clock::now() - start) / std::max(1, report.steps_done));
  changed_ = true;
  if (report.paused || guard_->diverged()) {
    pause();
    tell_({DriverEvent::Kind::diverged, report.message, "diverged", ""});
  } else if (report.recovered) {
    tell_({DriverEvent::Kind::recovered, report.message, "recovered", ""});
  }
}

int DriverLoop::steps_due(double owed_s) const {
  const double due = std::floor(owed_s / guard_->step_s() + 1e-9);
  // Until the device's speed is known, a few at a time.
  const double affordable = wall_per_step_s_ > 0.0 ? std::floor(batch_wall_s / wall_per_step_s_) : 2.0;
  return static_cast<int>(std::clamp(due, 0.0, std::max(1.0, affordable)));
}

DriverLoop::Clock::time_point DriverLoop::advance(Clock::time_point now) {
  if (!playing_) return Clock::time_point::max();
  const double step_s = guard_->step_s();
  const double elapsed_s = seconds(now - last_);
  // A frame at a time, so that the screen is fed evenly.
  if (owed_s_ + elapsed_s < std::max(step_s, frame_s) * (1.0 - 1e-6))
    return last_ + wall(std::max(step_s, frame_s) - owed_s_);
  last_ = now;
  owed_s_ += elapsed_s;
  const int count = steps_due(owed_s_);
  const double before_s = on_.solver->time_s();
  take_steps(count);
  const double simulated_s = on_.solver->time_s() - before_s;
  if (!playing_) return Clock::time_point::max();
  owed_s_ -= simulated_s;
  if (elapsed_s > 0.0) smooth(realtime_factor_, simulated_s / elapsed_s);
  // What the device cannot make is not owed: the tissue runs slower than real time.
  owed_s_ = std::clamp(owed_s_, 0.0, std::max(step_s, frame_s));
  return last_ + wall(std::max(0.0, std::max(guard_->step_s(), frame_s) - owed_s_));
}

// ---- frames

std::shared_ptr<std::vector<Eigen::Vector3f>> DriverLoop::positions_now() {
  auto positions = positions_.take([] { return std::make_unique<std::vector<Eigen::Vector3f>>(); });
  const auto* buffer = on_.solver->positions_buffer();
  if (buffer == nullptr) {
    *positions = on_.solver->state().positions_mm;
    return positions;
  }
  positions->resize(setup_.tissue.tissue->points.size());
  buffer->visit([&](const void* memory) {
    const auto* xyzw = static_cast<const float*>(memory);
    for (auto& position : *positions) {
      position = {xyzw[0], xyzw[1], xyzw[2]};
      xyzw += 4;
    }
  });
  return positions;
}

void DriverLoop::publish() {
  changed_ = false;
  Frame frame;
  auto positions = positions_now();
  if (follower_->mapped()) {
    auto deformed =
        surfaces_.take([&] { return std::make_unique<surface::DeformedSurface>(follower_->vertex_count()); });
    follower_->deform(*positions, *deformed);
    frame.surface = std::move(deformed);
  }
  frame.max_displacement_mm = max_displacement_mm(*setup_.tissue.tissue, *positions);
  frame.positions_mm = std::move(positions);
  frame.time_s = on_.solver->time_s();
  if (grab_->active()) {
    frame.held_points = grab_->selection().points;
    frame.grab_origin_mm = grab_->origin_mm();
    frame.grab_radius_mm = grab_radius_mm_;
  }
  frame.playing = playing_;
  frame.step_s = guard_->step_s();
  frame.stable_step_s = bound_.step_s;
  frame.worst_point = bound_.worst_point;
  frame.ms_per_step = wall_per_step_s_ * 1000.0;
  frame.realtime_factor = realtime_factor_;
  frame.recoveries = guard_->recoveries();
  frame.diverged = guard_->diverged();
  frame.can_undo = history_.can_undo() || grab_->active();
  frame.can_redo = history_.can_redo();
  frame.device = on_.solver->device_name();
  publish_(std::move(frame));
}

}  // namespace palpate::session
