#pragma once

#include "palpate/simulation/solver.hpp"

#include <string>

namespace palpate::simulation {

/// What the guard has to say after a batch of steps.
struct GuardReport {
  int steps_done = 0;      ///< in this batch, of the current step size
  bool recovered = false;  ///< a batch was rolled back and the step halved
  bool paused = false;     ///< it could not be brought back: diverged
  std::string message;     ///< for people, when recovered or paused
};

/// Watches a solver: before each batch a snapshot, after it the health. A
/// non-finite state, or one that left a box of 1000 times the tissue's size,
/// restores the snapshot, halves the step and counts a recovery; after
/// `max_halvings` without a good batch it gives up and leaves the last good
/// state. A state that is already lost when a batch begins (it was set from
/// outside) is replaced by the last good one and pauses the run at once.
class Guard {
 public:
  Guard(Solver& solver, double step_s, int max_halvings = 12);
  /// Advances by `count` steps of the present step or, after a recovery, by
  /// as many halved steps as cover the same time. Does nothing while paused.
  GuardReport advance(int count);
  double step_s() const noexcept { return step_s_; }
  void set_step_s(double step_s);
  int recoveries() const noexcept { return recoveries_; }
  bool diverged() const noexcept { return diverged_; }
  /// After a reset of the state: no longer paused, recoveries counted anew.
  void clear();

 private:
  bool lost();
  /// Restores the last good state, or says false when there never was one.
  bool restore();

  Solver& solver_;
  double step_s_;
  int max_halvings_;
  double lost_beyond_mm_;
  int recoveries_ = 0;
  bool has_snapshot_ = false;
  bool diverged_ = false;
};

}  // namespace palpate::simulation
