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
/// With fewer links an estimate takes some tens of milliseconds at most, and is
/// waited for; with more it is found beside, and not while the run needs the cores.
constexpr std::size_t links_to_wait_for = 100000;
constexpr std::size_t links_while_playing = 300000;
/// Between looks at how far stretching has stiffened the tissue.
constexpr double look_every_s = 0.25;

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

DriverLoop::DriverLoop(const DriverSetup& setup, Publish publish, Tell tell, Post post,
                       core::CancelToken stop)
    : setup_(setup),
      publish_(std::move(publish)),
      tell_(std::move(tell)),
      post_(std::move(post)),
      stop_(std::move(stop)),
      history_(history_bytes) {
  const auto& tissue = setup_.tissue.tissue;
  adjacency_ = model::adjacency_of(tissue->links, tissue->points.size());
  stop_.check();
  simulation::OpenclOptions options;
  options.layout = setup_.settings.layout;
  attach(open_solver(setup_.device, tissue, setup_.settings.parameters, options, setup_.tissue.material));
  update_limit();
  try {
    use_step();
  } catch (const core::Error& error) {
    // Explicit Euler without damping: it begins all the same, with a short step, and says so.
    if (error.kind() != core::ErrorKind::usage) throw;
    guard_->set_step_s(0.1 / limit_.now().omega_per_s);
    tell_({DriverEvent::Kind::refused, error.what(), error.code(), ""});
  }
  if (setup_.start) restore(*setup_.start);
  setup_.start.reset();
}

/// All that refers to a solver is made anew with it.
void DriverLoop::attach(SolverOnDevice on) {
  guard_.reset();
  grab_.reset();
  follower_.reset();
  on_ = std::move(on);
  const auto& tissue = *setup_.tissue.tissue;
  stop_.check();
  follower_.emplace(on_, setup_.surface, tissue.points.center_mm);
  stop_.check();
  grab_.emplace(*on_.solver, tissue, adjacency_);
  guard_.emplace(*on_.solver, setup_.settings.step_s.value_or(1e-3), simulation::Guard::usual_halvings,
                 stop_);
}

void DriverLoop::apply(const Command& command) {
  std::visit([this](const auto& one) { on(one); }, command);
}

void DriverLoop::publish_if_changed() {
  if (changed_) publish();
  look_for_work();
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
  if (setup_.tissue.tissue->links.size() > links_while_playing && worker_.is_busy()) {
    worker_.cancel();
    wants_estimate_ = !limit_.has_estimate();
    looked_at_mm_ = 0.0;  // the look was not finished
  }
  last_ = Clock::now();
  owed_s_ = 0.0;
  changed_ = true;
}

void DriverLoop::on(const command::Pause&) { pause(); }

void DriverLoop::on(const command::StepOnce&) {
  pause();
  if (!guard_->diverged()) take_steps(substeps_);
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
  const auto before = setup_.settings.parameters;
  setup_.settings.parameters = command.parameters;
  try {
    on_.solver->set_parameters(command.parameters);
    update_limit();
    use_step();
  } catch (const core::Error& error) {
    // Refused, as a whole: what the solver or the step cannot do is not half set.
    if (error.kind() != core::ErrorKind::usage) throw;
    setup_.settings.parameters = before;
    on_.solver->set_parameters(before);
    update_limit();
    use_step();
    throw;
  }
}

void DriverLoop::on(const command::SetStep& command) {
  plan_step(command.step_s, limit_.now());  // throws where it cannot be taken
  setup_.settings.step_s = command.step_s;
  use_step();
}

void DriverLoop::on(const command::SetSettings& command) {
  if (command.settings.step_s && !(*command.settings.step_s > 0.0 && *command.settings.step_s <= 1.0))
    plan_step(command.settings.step_s, limit_.now());
  simulation::check(command.settings.parameters);
  apply_material(command.settings);
  // The step of old need not fit the parameters to come, nor the other way round.
  const auto step_before_s = setup_.settings.step_s;
  setup_.settings.step_s = command.settings.step_s;
  try {
    on(command::SetParameters{command.settings.parameters});
  } catch (...) {
    setup_.settings.step_s = step_before_s;
    use_step();
    throw;
  }
}

/// Layout, scaling and anchors. What needs another solver makes one beside the
/// old one, which stays where that fails.
void DriverLoop::apply_material(const SimulationSettings& settings) {
  auto& now = setup_.settings;
  const bool new_anchors =
      settings.anchors.rule != now.anchors.rule || settings.anchors.file != now.anchors.file ||
      settings.anchors.sha256 != now.anchors.sha256 || !(settings.anchors.painted == now.anchors.painted);
  const bool new_scaling = settings.scaling.stiffness != now.scaling.stiffness ||
                           settings.scaling.damping != now.scaling.damping ||
                           settings.scaling.drag != now.scaling.drag ||
                           settings.scaling.mass != now.scaling.mass;
  const bool new_layout = settings.layout != now.layout;
  if (!new_anchors && !new_scaling && !new_layout) return;
  auto material = setup_.tissue.material;
  if (new_anchors || new_scaling) material = material_of(*setup_.tissue.tissue, settings);
  if (new_scaling || new_layout) {
    simulation::OpenclOptions options;
    options.layout = settings.layout;
    auto on = open_solver(setup_.device, setup_.tissue.tissue, now.parameters, options, material);
    let_go();
    on.solver->set_state(on_.solver->state());
    std::vector<std::uint32_t> cut;
    const auto& alive = on_.solver->link_alive();
    for (std::size_t link = 0; link < alive.size(); ++link)
      if (alive[link] == 0) cut.push_back(static_cast<std::uint32_t>(link));
    if (!cut.empty()) on.solver->set_links_alive(cut, false);
    attach(std::move(on));
    wall_per_step_s_ = 0.0;
  } else {
    on_.solver->set_anchors(material.anchors);
    guard_->disturbed();
  }
  setup_.tissue.material = std::move(material);
  now.anchors = settings.anchors;
  now.scaling = settings.scaling;
  now.layout = settings.layout;
  changed_ = true;
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
  guard_->disturbed();
  drag_ray_.reset();
  history_.push(std::move(*before_drag_));
  before_drag_.reset();
  changed_ = true;
}

void DriverLoop::restore(const simulation::State& state) {
  on_.solver->set_state(state);
  guard_->clear();
  // What is being found is of the places before.
  ++epoch_;
  worker_.cancel();
  wants_estimate_ = !limit_.has_estimate();
  looked_at_mm_ = static_cast<double>(on_.solver->health().max_displacement_mm);
  limit_.set_stretched(
      simulation::stable_step(*setup_.tissue.tissue, setup_.settings.parameters,
                              {&state.positions_mm, &on_.solver->link_alive(), &setup_.tissue.material}));
  use_step();
  owed_s_ = 0.0;
}

/// After anything but the places changed: links, parameters, material.
void DriverLoop::update_limit() {
  ++epoch_;
  worker_.cancel();
  const auto& tissue = *setup_.tissue.tissue;
  const simulation::StabilityCase at{nullptr, &on_.solver->link_alive(), &setup_.tissue.material};
  limit_.set_bound(simulation::stable_step(tissue, setup_.settings.parameters, at));
  wants_estimate_ = tissue.links.size() > links_to_wait_for;
  if (!wants_estimate_)
    limit_.set_estimate(
        simulation::estimated_stable_step(tissue, setup_.settings.parameters, at, core::Progress({}, stop_)));
  looked_at_mm_ = 0.0;  // the stretch is looked at again: here where that is quick
  if (!wants_estimate_ && is_stretched()) find_stretched_now();
  changed_ = true;
}

bool DriverLoop::is_stretched() const {
  return std::abs(shown_displacement_mm_ - looked_at_mm_) > 0.1 * on_.solver->link_length_mm();
}

void DriverLoop::find_stretched_now() {
  const auto positions_mm = on_.solver->state().positions_mm;
  looked_at_mm_ = shown_displacement_mm_;
  limit_.set_stretched(
      simulation::stable_step(*setup_.tissue.tissue, setup_.settings.parameters,
                              {&positions_mm, &on_.solver->link_alive(), &setup_.tissue.material}));
}

/// The step that the user named, in parts where it is above the limit, or the automatic one.
void DriverLoop::use_step() {
  const StepPlan plan = plan_step(setup_.settings.step_s, limit_.now());
  substeps_ = plan.substeps;
  guard_->set_step_s(plan.step_s);
  if (guard_->diverged()) guard_->clear();
  changed_ = true;
}

/// As the limit changes by itself: a step that the guard halved is not made longer again.
void DriverLoop::follow_limit() {
  const StepPlan plan = plan_step(setup_.settings.step_s, limit_.now());
  const double now_s = guard_->step_s();
  const bool shorter = plan.step_s < 0.98 * now_s;
  const bool longer = plan.step_s > 1.02 * now_s && guard_->recoveries() == 0;
  changed_ = true;
  if (!shorter && !longer) return;
  substeps_ = plan.substeps;
  guard_->set_step_s(plan.step_s);
}

void DriverLoop::pause() {
  if (playing_) changed_ = true;
  playing_ = false;
  realtime_factor_ = 0.0;
}

// ---- limits that are found beside the simulation

void DriverLoop::on(const command::Limited& command) {
  if (command.epoch != epoch_ || !command.found) return;  // it woke the loop for the next, no more
  if (command.is_of_rest)
    limit_.set_estimate(*command.found);
  else
    limit_.set_stretched(*command.found);
  follow_limit();
}

void DriverLoop::look_for_work() {
  if (worker_.is_busy() || !shown_mm_) return;
  const bool may_take_cores = !playing_ || setup_.tissue.tissue->links.size() <= links_while_playing;
  if (wants_estimate_ && may_take_cores) {
    wants_estimate_ = false;
    return find_estimate();
  }
  const bool moved = std::abs(shown_displacement_mm_ - looked_at_mm_) > 0.1 * on_.solver->link_length_mm();
  if (moved && Clock::now() >= look_next_) find_stretched();
}

void DriverLoop::find_estimate() {
  auto work = [tissue = setup_.tissue.tissue, material = setup_.tissue.material,
               parameters = setup_.settings.parameters,
               alive = on_.solver->link_alive()](const core::Progress& progress) {
    return simulation::estimated_stable_step(*tissue, parameters, {nullptr, &alive, &material}, progress);
  };
  worker_.start(std::move(work), [this, epoch = epoch_](const auto& found) {
    post_(command::Limited{found, true, epoch});
  });
}

void DriverLoop::find_stretched() {
  looked_at_mm_ = shown_displacement_mm_;
  // At most a twentieth of the time.
  const double cost_s = 1e-7 * static_cast<double>(setup_.tissue.tissue->links.size());
  look_next_ = Clock::now() + wall(std::max(look_every_s, 20.0 * cost_s));
  auto work = [tissue = setup_.tissue.tissue, material = setup_.tissue.material,
               parameters = setup_.settings.parameters, alive = on_.solver->link_alive(),
               positions = shown_mm_](const core::Progress&) {
    return simulation::stable_step(*tissue, parameters, {positions.get(), &alive, &material});
  };
  worker_.start(std::move(work), [this, epoch = epoch_](const auto& found) {
    post_(command::Limited{found, false, epoch});
  });
}

// ---- time

/// The selection reaches the newest ray by the end of the batch, but takes at
/// least a frame's time for it, so that a slow device does not turn a drag of
/// the mouse into a blow.
void DriverLoop::steer_grab(double batch_s) {
  if (!grab_->active()) return;
  const bool was_moving = grab_->moving();
  if (drag_ray_)
    grab_->drag_to(*drag_ray_, std::max(batch_s, frame_s));
  else
    grab_->rest();
  if (was_moving || grab_->moving()) guard_->disturbed();
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
  shown_mm_ = positions;
  shown_displacement_mm_ = frame.max_displacement_mm;
  frame.positions_mm = std::move(positions);
  frame.time_s = on_.solver->time_s();
  if (grab_->active()) {
    frame.held_points = grab_->selection().points;
    frame.grab_origin_mm = grab_->origin_mm();
    frame.grab_radius_mm = grab_radius_mm_;
  }
  frame.playing = playing_;
  frame.step_s = guard_->step_s();
  const auto limit = limit_.now();
  frame.substeps = substeps_;
  frame.stable_step_s = limit.step_s;
  frame.worst_point = limit.worst_point;
  frame.stable_step_is_estimate = limit.is_estimate;
  frame.ms_per_step = wall_per_step_s_ * 1000.0;
  frame.realtime_factor = realtime_factor_;
  frame.recoveries = guard_->recoveries();
  frame.diverged = guard_->diverged();
  frame.can_undo = history_.can_undo() || grab_->active();
  frame.can_redo = history_.can_redo();
  frame.device = on_.solver->device_name();
  frame.layout = on_.solver->layout();
  frame.layout_reason = on_.solver->layout_reason();
  publish_(std::move(frame));
}

}  // namespace palpate::session
