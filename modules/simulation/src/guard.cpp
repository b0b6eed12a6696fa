#include "palpate/simulation/guard.hpp"

#include <algorithm>
#include <sstream>

namespace palpate::simulation {

namespace {
constexpr double lost_beyond_extents = 1000.0;
}

Guard::Guard(Solver& solver, double step_s, int max_halvings)
    : solver_(solver),
      step_s_(step_s),
      max_halvings_(max_halvings),
      // A single point has no extent; a millimetre then stands for it.
      lost_beyond_mm_(lost_beyond_extents * std::max(solver.extent_mm(), 1.0)) {
  if (lost()) return;
  solver_.save_snapshot();
  has_snapshot_ = true;
}

void Guard::set_step_s(double step_s) { step_s_ = step_s; }

void Guard::clear() {
  diverged_ = false;
  recoveries_ = 0;
}

bool Guard::lost() {
  const Health health = solver_.health();
  return !health.finite || !(static_cast<double>(health.max_displacement_mm) <= lost_beyond_mm_);
}

bool Guard::restore() {
  if (has_snapshot_) solver_.restore_snapshot();
  return has_snapshot_;
}

GuardReport Guard::advance(int count) {
  GuardReport report;
  if (diverged_ || count <= 0) {
    report.paused = diverged_;
    if (diverged_)
      report.message = "The simulation is paused: it could not be kept finite. Reset it to go on.";
    return report;
  }
  if (lost()) {
    diverged_ = report.paused = true;
    report.message =
        restore() ? "The state was not finite. The last good one is back, and the simulation is paused."
                  : "The state is not finite, and there is no good one to go back to. Reset it to go on.";
    return report;
  }
  solver_.save_snapshot();
  has_snapshot_ = true;

  const double first_step_s = step_s_;
  int batches = 1;  // of `count` steps; twice as many after each halving
  for (int halvings = 0; halvings <= max_halvings_; ++halvings) {
    // Looked at after every `count` steps, so that a hopeless step size is soon given up.
    bool good = true;
    for (int batch = 0; batch < batches && good; ++batch) {
      solver_.step(count, step_s_);
      good = !lost();
    }
    if (good) {
      report.steps_done = count * batches;
      if (report.recovered) {
        std::ostringstream text;
        text << "The simulation became unstable. The last good state was restored and the step was reduced "
                "from "
             << first_step_s << " s to " << step_s_ << " s.";
        report.message = text.str();
      }
      return report;
    }
    restore();
    if (halvings == max_halvings_) break;
    step_s_ /= 2.0;
    batches *= 2;
    ++recoveries_;
    report.recovered = true;
  }
  diverged_ = report.paused = true;
  std::ostringstream text;
  text << "The simulation could not be kept finite, not even with a step of " << step_s_
       << " s. The last good state is shown and the simulation is paused. Reduce the stiffness or the "
          "damping.";
  report.message = text.str();
  return report;
}

}  // namespace palpate::simulation
