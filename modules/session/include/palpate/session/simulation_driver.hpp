#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/latest_value.hpp"
#include "palpate/session/run.hpp"

namespace palpate::session {

/// One moment of the simulation, as the window shows it. A value that shares
/// its arrays; never written again.
struct Frame {
  double time_s = 0.0;
  std::shared_ptr<const std::vector<Eigen::Vector3f>> positions_mm;  ///< relative to centre
  std::shared_ptr<const surface::DeformedSurface> surface;           ///< null where unmapped
  std::vector<std::uint32_t> held_points;
  std::optional<Eigen::Vector3d> grab_origin_mm;
  double grab_radius_mm = 0.0;
  bool playing = false;
  double step_s = 0.0;         ///< that is taken
  int substeps = 1;            ///< parts that a named step above the largest stable one is taken in
  double stable_step_s = 0.0;  ///< shorter while the tissue is stretched
  std::size_t worst_point = 0;
  bool stable_step_is_estimate = false;  ///< of the converged eigenvalue; else of the per-point bound
  double ms_per_step = 0.0;       ///< measured over the last frames
  double realtime_factor = 0.0;   ///< simulated over wall seconds while playing
  double max_displacement_mm = 0.0;
  int recoveries = 0;
  bool diverged = false;
  bool can_undo = false, can_redo = false;
  std::string device;
  std::string layout, layout_reason;  ///< as simulation::Solver has them
};

struct DriverSetup {
  BuiltTissue tissue;
  BoundSurface surface;
  SimulationSettings settings;
  std::string device;  ///< selector; "reference" for the CPU reference
  std::optional<simulation::State> start;  ///< at rest where absent
};
/// What the driver says besides frames.
struct DriverEvent {
  /// refused: a command's parameter was out of range; all goes on as before.
  enum class Kind { ready, recovered, diverged, failed, refused } kind = Kind::ready;
  std::string text;     ///< for people
  std::string code;     ///< of the Error where failed ("no-device", "kernel-build", ...)
  std::string details;  ///< a log, or empty
};

/// Runs one simulation in its own thread, in real time where the device can:
/// it takes the steps that fit the frame's time, deforms the surface and
/// publishes the newest frame. Sleeps on a condition variable while paused.
/// Calls return at once; they are commands in a queue. The callbacks come from
/// the simulation thread: only post them on. Nothing throws across the thread.
class SimulationDriver {
 public:
  using Notify = std::function<void()>;  ///< a new frame can be taken
  using Tell = std::function<void(const DriverEvent&)>;
  SimulationDriver(DriverSetup setup, Notify notify, Tell tell);
  /// Ends the thread in the time of one batch of steps.
  ~SimulationDriver();

  void play();
  void pause();
  void step_once();
  void reset();  ///< to rest, time 0, nothing held; can be undone
  void set_parameters(const simulation::Parameters& parameters);
  void set_step_s(std::optional<double> step_s);  ///< automatic where absent
  /// All of them at once; parameters and step stay where one is refused. What needs another solver (layout, scaling) makes one
  /// and carries the state over; the run goes on from where it was.
  void set_settings(const SimulationSettings& settings);

  /// Also while paused: the points are held and shown, a drag is remembered,
  /// and the tissue follows it with the next play() or step_once().
  void grab(const interaction::Ray& ray, const interaction::PickReach& reach, double radius_mm,
            interaction::SelectionKind kind);
  void drag(const interaction::Ray& ray);
  void release();
  void undo();  ///< back to before the last drag or reset
  void redo();

  std::optional<Frame> take_frame();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::session
