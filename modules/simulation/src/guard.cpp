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
/// An alarm of the links is seen at looks only, and so at less certain times.
constexpr int same_alarms = 2;
constexpr double same_alarm_within = 0.3;
/// Evaluations of the forces between two looks at the links, each of which
/// costs about as much as one or two of them: a few per cent.
constexpr int evaluations_per_look = 40;
/// Energy above its least, in parts of the kinetic one. A scheme that keeps its
/// energy only on average (symplectic Euler near its limit) stays under 0.2.
constexpr double risen = 0.5;
constexpr double still_quiet = 0.1;
constexpr int risen_looks_are_lost = 2;
/// Change of a link's length in one step, and how long it may last.
constexpr double strained = 0.5;
constexpr int strained_looks_are_lost = 4;
/// After a false alarm strain is looked for no longer, until it was calm for once or for this long.
constexpr int looks_of_rest = 100;

bool same(const Parameters& a, const Parameters& b) {
  return a.stiffness_per_s2 == b.stiffness_per_s2 && a.damping_per_s == b.damping_per_s &&
         a.drag_per_s == b.drag_per_s && a.gravity_mm_per_s2 == b.gravity_mm_per_s2 && a.mass == b.mass &&
         a.integrator == b.integrator && a.beat_period_s == b.beat_period_s &&
         a.beat_amplitude == b.beat_amplitude;
}
}  // namespace

Guard::Guard(Solver& solver, double step_s, int max_halvings, core::CancelToken cancel)
    : solver_(solver),
      step_s_(step_s),
      max_halvings_(max_halvings),
      cancel_(std::move(cancel)),
      // A single point has no extent; a millimetre then stands for it.
      lost_beyond_mm_(lost_beyond_extents * std::max(solver.extent_mm(), 1.0)),
      time_s_(solver.time_s()),
      parameters_(solver.parameters()) {
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
  input_ = true;
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

std::optional<Guard::Lost> Guard::lost_after(std::int64_t steps, int look) {
  const int most = std::min(look, steps_between_looks());
  for (std::int64_t done = 0; done < steps;) {
    cancel_.check();
    const int count = static_cast<int>(std::min<std::int64_t>(steps - done, most));
    solver_.step(count, step_s_);
    done += count;
    steps_since_look_ += count;
    const double after_s = static_cast<double>(done) * step_s_;
    if (is_lost(solver_.health())) return Lost{after_s, Loss::not_finite};
    if (!watches_links_ || steps_since_look_ < steps_between_looks()) continue;
    if (const Loss how = look_at_links(); how != Loss::none) return Lost{after_s, how};
  }
  return std::nullopt;
}

// ---- the watch over the links

int Guard::steps_between_looks() const {
  const Integrator integrator = solver_.parameters().integrator;
  const int evaluations = integrator == Integrator::velocity_verlet                                   ? 2
                          : integrator == Integrator::rk4 || integrator == Integrator::implicit_euler ? 4
                                                                                                      : 1;
  return evaluations_per_look / evaluations;
}

/// Strains of 3e-4 of every link, and the rounding of float places in a field of gravity.
double Guard::energy_floor() const {
  const Parameters& p = solver_.parameters();
  const auto links = static_cast<double>(solver_.link_alive().size());
  const double springs =
      links > 0.0 ? 0.5 * p.stiffness_per_s2 * links * std::pow(solver_.link_length_mm(), 2) : 0.0;
  const double fall = p.mass * p.gravity_mm_per_s2.norm() * std::max(1.0, links) * solver_.extent_mm();
  return 1e-7 * springs + 1e-6 * fall;
}

void Guard::take_energy() {
  const LinkHealth links = solver_.link_health();
  least_energy_ = links.kinetic + links.potential;
  is_quiet_ = true;
  risen_looks_ = strained_looks_ = steps_since_look_ = 0;
}

void Guard::see_input() {
  const Parameters& now = solver_.parameters();
  input_ = input_ || solver_.time_s() != time_s_ || !same(now, parameters_) || now.beat_amplitude > 0.0;
  parameters_ = now;
  if (input_)
    least_energy_.reset();
  else if (!least_energy_)
    take_energy();
}

Guard::Loss Guard::look_at_links() {
  steps_since_look_ = 0;
  const LinkHealth links = solver_.link_health();
  const double energy = links.kinetic + links.potential;
  // A hand tears links as fast as it likes; what a step too long does with that leaves the box soon enough.
  if (disturbed_) {
    strained_looks_ = 0;
    return Loss::none;
  }
  const bool is_strained = static_cast<double>(links.max_strain_rate_per_s) * step_s_ > strained;
  if (!is_strained) strained_looks_ = 0;
  if (is_strained && strained_looks_++ == 0) strained_energy_ = energy;
  // A pull without damping goes on so for long, but its energy does not grow.
  if (strained_looks_ >= strained_looks_are_lost && energy - strained_energy_ > risen * links.kinetic)
    return Loss::strain;
  if (!least_energy_) return Loss::none;  // something acts from outside
  const double rise = energy - *least_energy_;
  const double floor = energy_floor();
  least_energy_ = std::min(*least_energy_, energy);
  is_quiet_ = !(rise > still_quiet * links.kinetic + 0.1 * floor);
  risen_looks_ = rise > risen * links.kinetic + floor ? risen_looks_ + 1 : 0;
  return risen_looks_ >= risen_looks_are_lost ? Loss::energy : Loss::none;
}

// ---- batches

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
  see_input();
  if (!has_snapshot_ || snapshot_is_stale_ || set_from_outside || (is_calm(before) && is_quiet_) ||
      (steps_since_snapshot_ >= lasting_steps && risen_looks_ == 0))
    save();

  const double first_step_s = step_s_;
  const std::int64_t span = steps_since_snapshot_ + count;  // in first steps, from the snapshot
  if (auto lost = lost_after(count, count)) {
    const Loss how = lost->how;
    lost->after_s += static_cast<double>(steps_since_snapshot_) * step_s_;
    if (!recover(*lost, span, count, report)) return report;
    std::ostringstream text;
    text << "The simulation became unstable"
         << (how == Loss::strain   ? " (links changed their length by more than half in one step)"
             : how == Loss::energy ? " (energy rose though nothing acted on the tissue)"
                                   : "")
         << ". The last good state was restored and the step was reduced from " << first_step_s << " s to "
         << step_s_ << " s.";
    if (report.recovered) report.message = text.str();
  }
  const auto halves = static_cast<std::int64_t>(std::llround(first_step_s / step_s_));
  steps_since_snapshot_ = report.recovered ? span * halves : span;
  time_s_ = solver_.time_s();
  input_ = disturbed_ = false;
  report.steps_done =
      static_cast<int>(std::min<std::int64_t>(count * halves, std::numeric_limits<int>::max()));
  return report;
}

bool Guard::recover(Lost& lost, std::int64_t span, int look, GuardReport& report) {
  const double first_step_s = step_s_;
  const int first_recoveries = recoveries_;
  std::int64_t halves = 1;
  int same_time = 0;
  std::optional<Lost> again = lost;
  for (int halving = 0; again && same_time < same_times && halving < max_halvings_; ++halving) {
    solver_.restore_snapshot();
    step_s_ /= 2.0;
    halves *= 2;
    ++recoveries_;
    report.recovered = true;
    if (least_energy_) take_energy();
    // Looked at after every `look` steps, so that a hopeless step is soon given up.
    const double before_s = again->after_s;
    again = lost_after(span * halves, look);
    const double within = again && again->how != Loss::not_finite ? same_alarm_within : same_within;
    same_time = again && std::abs(again->after_s - before_s) <= within * before_s ? same_time + 1 : 0;
    if (again && again->how != Loss::not_finite && same_time >= same_alarms) break;
  }
  if (again && again->how != Loss::not_finite) {
    // What smaller steps see too is the tissue's own: the run is good.
    solver_.restore_snapshot();
    step_s_ = first_step_s;
    watches_links_ = false;
    again = lost_after(span, look);
    watches_links_ = true;
    if (!again) {
      recoveries_ = first_recoveries;
      report.recovered = false;
      take_energy();
      strained_looks_ = -looks_of_rest;
      return true;
    }
  }
  if (!again) return true;
  std::ostringstream text;
  text << "The simulation could not be kept finite, not even with a step of " << step_s_
       << " s. The last good state is back and the simulation is paused. Reduce "
       << (same_time == same_times ? "the gravity or the pull; a smaller step does not help."
                                   : "the stiffness or the damping.");
  step_s_ = first_step_s;
  const bool recovered = report.recovered;
  report = pause(text.str());
  report.recovered = recovered;
  return false;
}

}  // namespace palpate::simulation
