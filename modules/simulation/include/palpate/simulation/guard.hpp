#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/simulation/solver.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace palpate::simulation {

/// What the guard has to say after a batch of steps.
struct GuardReport {
  int steps_done = 0;      ///< in this batch, of the current step size
  bool recovered = false;  ///< a batch was rolled back and the step halved
  bool paused = false;     ///< it could not be brought back: diverged
  std::string message;     ///< for people, when recovered or paused
};

/// Watches a solver: snapshots of calm states before a batch, the health after
/// it. A non-finite state, or one that left a box of 1000 times the tissue's
/// size, restores the snapshot, halves the step, counts a recovery and does
/// the time since the snapshot again; after `max_halvings` without success, or
/// once halving no longer changes when the state is lost, it gives up and
/// leaves the last good state. A run that blows up is finite for
/// a while, so a state in which a point passes more than half a link's length
/// in a step is not kept until it has lasted: the last good state is one that
/// people would call good. A state that is already lost when a batch begins
/// (it was set from outside) is replaced by the last good one and pauses the
/// run at once.
///
/// A step a little above the limit makes a jitter that neither grows out of the
/// box nor dies. So every ten steps or so it looks at the links too, and what it sees
/// there restores the snapshot in the same way: energy that stays above what it was,
/// by half of the kinetic energy, while nothing acts from outside; or a free link
/// that changes its length by more than half in one step, and goes on doing so while
/// the energy grows and no hand is at it. (A released pull does that too, but gains nothing.)
/// Should smaller steps see the same at the same time, it was no fault of the
/// step, and the run goes on with the step it had.
class Guard {
 public:
  static constexpr int usual_halvings = 12;
  /// Doing a time again may take thousands of steps: `cancel` stops between
  /// looks, with Error(cancelled).
  Guard(Solver& solver, double step_s, int max_halvings = usual_halvings, core::CancelToken cancel = {});
  /// Advances by `count` steps of the present step or, after a recovery, by
  /// as many halved steps as cover the same time. Does nothing while paused.
  GuardReport advance(int count);
  /// Something acts from outside in the next batch and may bring energy in: a
  /// grab moves or lets go, links were cut or healed, anchors changed. (New
  /// parameters and a beat are seen without this; after a state that was set
  /// call clear().)
  void disturbed() { input_ = disturbed_ = true; }
  double step_s() const noexcept { return step_s_; }
  void set_step_s(double step_s);
  int recoveries() const noexcept { return recoveries_; }
  bool diverged() const noexcept { return diverged_; }
  /// After a reset of the state: no longer paused, recoveries counted anew.
  void clear();

 private:
  enum class Loss { none, not_finite, strain, energy };
  struct Lost {
    double after_s = 0.0;
    Loss how = Loss::none;
  };

  bool is_lost(const Health& health) const;
  bool is_calm(const Health& health) const;
  /// Steps in looks of at most `look` steps. When and how the run was found
  /// lost; none where it was kept.
  std::optional<Lost> lost_after(std::int64_t steps, int look);
  Loss look_at_links();
  /// What rounding alone may do to the energy.
  double energy_floor() const;
  /// The energy is to be compared with what it is now.
  void take_energy();
  void see_input();
  int steps_between_looks() const;
  void save();
  GuardReport pause(const std::string& message);
  /// Restores, halves and does the time again until it is kept; false where it cannot be.
  bool recover(Lost& lost, std::int64_t span, int look, GuardReport& report);

  Solver& solver_;
  double step_s_;
  int max_halvings_;
  core::CancelToken cancel_;
  double lost_beyond_mm_;
  bool has_snapshot_ = false;
  bool snapshot_is_stale_ = false;  ///< the step or the state is another one since
  std::int64_t steps_since_snapshot_ = 0;
  double time_s_ = 0.0;  ///< of the solver at the end of the last batch
  int recoveries_ = 0;
  bool diverged_ = false;
  // The watch over the links.
  Parameters parameters_;               ///< that the energy is of
  bool input_ = false;                  ///< energy may come in from outside
  bool disturbed_ = false;              ///< by a hand or a cut, now: links may change as fast as they like
  bool watches_links_ = true;           ///< not while a time is done again whose alarm was false
  std::optional<double> least_energy_;  ///< since the last input
  bool is_quiet_ = true;                ///< no energy came up that may be the beginning of a blow-up
  int risen_looks_ = 0;
  int strained_looks_ = 0;
  double strained_energy_ = 0.0;
  int steps_since_look_ = 0;
};

}  // namespace palpate::simulation
