#include "palpate/simulation/guard.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

namespace palpate::simulation {

namespace {
constexpr double lost_beyond_extents = 1000.0;
constexpr double calm_links_per_step = 0.5;
/// A blow-up that has begun to move visibly is lost well within this many
/// steps; what is still there after them is fast, not broken.
constexpr std::int64_t lasting_steps = 100;
/// A step that is too long loses the state at another time once it is halved;
/// what is lost at the same time this often is thrown out by what acts on it.
constexpr int same_times = 4;
constexpr double same_within = 0.1;
}  // namespace

Guard::Guard(Solver& solver, double step_s, int max_halvings, core::CancelToken cancel)
    : solver_(solver),
      step_s_(step_s),
      max_halvings_(max_halvings),
      cancel_(std::move(cancel)),
      // A single point has no extent; a millimetre then stands for it.
      lost_beyond_mm_(lost_beyond_extents * std::max(solver.extent_mm(), 1.0)),
      time_s_(solver.time_s()) {
  if (!is_lost(solver_.health())) save();
}

void Guard::set_step_s(double step_s) {
  snapshot_is_stale_ = snapshot_is_stale_ || step_s != step_s_;
  step_s_ = step_s;
}

void Guard::clear() {
  diverged_ = false;
  recoveries_ = 0;
  snapshot_is_stale_ = true;
}

bool Guard::is_lost(const Health& health) const {
  return !health.finite || !(static_cast<double>(health.max_displacement_mm) <= lost_beyond_mm_);
}

bool Guard::is_calm(const Health& health) const {
  return static_cast<double>(health.max_speed_mm_per_s) * step_s_ <=
         calm_links_per_step * solver_.link_length_mm();
}

void Guard::save() {
  solver_.save_snapshot();
  has_snapshot_ = true;
  snapshot_is_stale_ = false;
  steps_since_snapshot_ = 0;
}

std::optional<double> Guard::lost_after_s(std::int64_t steps, int look) {
  for (std::int64_t done = 0; done < steps;) {
    cancel_.check();
    const int count = static_cast<int>(std::min<std::int64_t>(steps - done, look));
    solver_.step(count, step_s_);
    done += count;
    if (is_lost(solver_.health())) return static_cast<double>(done) * step_s_;
  }
  return std::nullopt;
}

GuardReport Guard::pause(const std::string& message) {
  if (has_snapshot_) solver_.restore_snapshot();
  diverged_ = true;
  GuardReport report;
  report.paused = true;
  report.message = message;
  return report;
}

GuardReport Guard::advance(int count) {
  GuardReport report;
  if (diverged_ || count <= 0) {
    report.paused = diverged_;
    if (diverged_)
      report.message = "The simulation is paused: it could not be kept finite. Reset it to go on.";
    return report;
  }
  const Health before = solver_.health();
  if (is_lost(before))
    return pause(has_snapshot_
                     ? "The state was not finite. The last good one is back, and the simulation is paused."
                     : "The state is not finite, and there is no good one to go back to. Reset it to go on.");
  const bool set_from_outside = solver_.time_s() != time_s_;
  if (!has_snapshot_ || snapshot_is_stale_ || set_from_outside || is_calm(before) ||
      steps_since_snapshot_ >= lasting_steps)
    save();

  const double first_step_s = step_s_;
  const std::int64_t span = steps_since_snapshot_ + count;  // in first steps, from the snapshot
  std::int64_t halves = 1;
  auto lost_s = lost_after_s(count, count);
  int same = 0;
  for (int halving = 0; lost_s && same < same_times && halving < max_halvings_; ++halving) {
    solver_.restore_snapshot();
    step_s_ /= 2.0;
    halves *= 2;
    ++recoveries_;
    report.recovered = true;
    // Looked at after every `count` steps, so that a hopeless step is soon given up.
    const double before_s = *lost_s;
    lost_s = lost_after_s(span * halves, count);
    same = lost_s && std::abs(*lost_s - before_s) <= same_within * before_s ? same + 1 : 0;
  }
  std::ostringstream text;
  if (lost_s) {
    text << "The simulation could not be kept finite, not even with a step of " << step_s_
         << " s. The last good state is back and the simulation is paused. Reduce "
         << (same == same_times ? "the gravity or the pull; a smaller step does not help."
                                : "the stiffness or the damping.");
    step_s_ = first_step_s;
    const bool recovered = report.recovered;
    report = pause(text.str());
    report.recovered = recovered;
    return report;
  }
  steps_since_snapshot_ = span * halves;
  time_s_ = solver_.time_s();
  report.steps_done =
      static_cast<int>(std::min<std::int64_t>(count * halves, std::numeric_limits<int>::max()));
  if (report.recovered) {
    text << "The simulation became unstable. The last good state was restored and the step was reduced from "
         << first_step_s << " s to " << step_s_ << " s.";
    report.message = text.str();
  }
  return report;
}

}  // namespace palpate::simulation
