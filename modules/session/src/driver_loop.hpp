#pragma once

#include "history.hpp"
#include "limit_worker.hpp"
#include "pool.hpp"
#include "solver_setup.hpp"
#include "step_plan.hpp"

#include "palpate/session/simulation_driver.hpp"

#include <chrono>
#include <functional>
#include <optional>
#include <variant>
#include <vector>

namespace palpate::session {

/// What the driver's queue holds.
namespace command {
struct Play {};
struct Pause {};
struct StepOnce {};
struct Reset {};
struct SetParameters {
  simulation::Parameters parameters;
};
struct SetStep {
  std::optional<double> step_s;
};
struct SetSettings {
  SimulationSettings settings;
};
struct GrabAt {
  interaction::Ray ray;
  interaction::PickReach reach;
  double radius_mm;
  interaction::SelectionKind kind;
};
struct DragTo {
  interaction::Ray ray;
};
struct Release {};
struct Undo {};
struct Redo {};
/// From the loop's own worker: a limit that was found meanwhile.
struct Limited {
  std::optional<simulation::StableStep> found;
  bool is_of_rest;      ///< the estimate; else the bound at the places of then
  std::uint64_t epoch;  ///< of what it was found for
};
}  // namespace command
using Command =
    std::variant<command::Play, command::Pause, command::StepOnce, command::Reset, command::SetParameters,
                 command::SetStep, command::SetSettings, command::GrabAt, command::DragTo, command::Release,
                 command::Undo, command::Redo, command::Limited>;

/// The simulation of a SimulationDriver, without its thread: owns the device,
/// the solver and the history. Everything happens in the caller's thread; time
/// comes from outside, so that pacing can be tested without waiting.
class DriverLoop {
 public:
  using Clock = std::chrono::steady_clock;
  using Publish = std::function<void(Frame)>;
  using Tell = std::function<void(const DriverEvent&)>;
  /// Puts a command at the end of the queue; from any thread.
  using Post = std::function<void(Command)>;

  /// Opens the device and builds the kernels; stops between the parts with
  /// Error(cancelled) once `stop` was asked, as each advance does.
  DriverLoop(const DriverSetup& setup, Publish publish, Tell tell, Post post, core::CancelToken stop);

  void apply(const Command& command);
  /// Called while playing: takes the steps that are due at `now`, a batch at
  /// most. Gives when to be called next.
  Clock::time_point advance(Clock::time_point now);
  bool playing() const noexcept { return playing_; }
  /// Publishes a frame if something changed since the last one.
  void publish_if_changed();

 private:
  void on(const command::Play&);
  void on(const command::Pause&);
  void on(const command::StepOnce&);
  void on(const command::Reset&);
  void on(const command::SetParameters& command);
  void on(const command::SetStep& command);
  void on(const command::SetSettings& command);
  void on(const command::GrabAt& command);
  void on(const command::DragTo& command);
  void on(const command::Release&);
  void on(const command::Undo&);
  void on(const command::Redo&);
  void on(const command::Limited& command);

  void take_steps(int count);
  void steer_grab(double batch_s);
  void let_go();
  void restore(const simulation::State& state);
  void attach(SolverOnDevice on);
  void apply_material(const SimulationSettings& settings);
  void update_limit();
  void use_step();
  void follow_limit();
  void look_for_work();
  void find_estimate();
  void find_stretched();
  void find_stretched_now();
  bool is_stretched() const;
  void pause();
  int steps_due(double owed_s) const;
  std::shared_ptr<std::vector<Eigen::Vector3f>> positions_now();
  void publish();

  DriverSetup setup_;
  Publish publish_;
  Tell tell_;
  Post post_;
  core::CancelToken stop_;
  model::Adjacency adjacency_;
  StableLimit limit_;
  int substeps_ = 1;
  // The pools outlive what wraps their memory on the device.
  Pool<surface::DeformedSurface> surfaces_;
  Pool<std::vector<Eigen::Vector3f>> positions_;
  SolverOnDevice on_;
  std::optional<SurfaceFollower> follower_;
  std::optional<simulation::Guard> guard_;
  std::optional<Grab> grab_;
  std::optional<interaction::Ray> drag_ray_;
  std::optional<simulation::State> before_drag_;
  double grab_radius_mm_ = 0.0;
  History history_;
  bool playing_ = false;
  bool changed_ = true;
  // Limits that are found beside.
  std::uint64_t epoch_ = 0;  ///< of what the limit depends on
  bool wants_estimate_ = false;
  double looked_at_mm_ = 0.0;  ///< the displacement at the last look at the stretch
  Clock::time_point look_next_;
  std::shared_ptr<const std::vector<Eigen::Vector3f>> shown_mm_;
  double shown_displacement_mm_ = 0.0;
  // Pacing.
  Clock::time_point last_;
  double owed_s_ = 0.0;           ///< simulated time that wall time has earned
  double wall_per_step_s_ = 0.0;  ///< smoothed
  double realtime_factor_ = 0.0;  ///< smoothed
  LimitWorker worker_;            // last: its thread posts to the above
};

}  // namespace palpate::session
