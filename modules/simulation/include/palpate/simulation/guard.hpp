#pragma once

#include <string>

#include "palpate/simulation/solver.hpp"

namespace palpate::simulation {

/// What the guard has to say after a batch of steps.
struct GuardReport {
  int steps_done = 0;     ///< in this batch, of the current step size
  bool recovered = false; ///< a batch was rolled back and the step halved
  bool paused = false;    ///< it could not be brought back: diverged
  std::string message;    ///< for people, when recovered or paused
};

/// Watches a solver: before each batch a snapshot, after it the health. A
/// non-finite state, or one that left a box of 1000 times the tissue's size,
/// restores the snapshot, halves the step and counts a recovery; after
/// `max_halvings` without a good batch it gives up and leaves the last good state.
class Guard {
 public:
  Guard(Solver& solver, double step_s, int max_halvings = 12);
  /// Advances by `count` steps of the present step or, after a recovery, by
  /// as many halved steps as cover the same time.
  GuardReport advance(int count);
  double step_s() const noexcept { return step_s_; }
  void set_step_s(double step_s);
  int recoveries() const noexcept { return recoveries_; }
  bool diverged() const noexcept { return diverged_; }
  /// After a reset of the state.
  void clear();

 private:
  Solver& solver_;
  double step_s_;
  int max_halvings_;
  int recoveries_ = 0;
  bool diverged_ = false;
};

}  // namespace palpate::simulation
