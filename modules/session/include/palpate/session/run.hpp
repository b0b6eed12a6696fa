#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/progress.hpp"
#include "palpate/interaction/gesture.hpp"
#include "palpate/session/pipeline.hpp"
#include "palpate/simulation/guard.hpp"
#include "palpate/simulation/solver.hpp"

namespace palpate::session {

/// device selector as in compute::open_device; "reference" gives the Eigen one.
std::unique_ptr<simulation::Solver> make_solver(const std::string& device_selector,
                                                std::shared_ptr<const model::Tissue> tissue,
                                                const simulation::Parameters& parameters);

/// Makes the solver follow a drag: selection, targets, velocities.
class Grab {
 public:
  explicit Grab(simulation::Solver& solver, const model::Tissue& tissue, const model::Adjacency& adjacency);
  /// False where nothing was hit.
  bool begin(const interaction::Ray& ray, const interaction::PickReach& reach, double radius_mm,
             interaction::SelectionKind kind);
  /// The origin shall be on the new ray after `duration_s` of simulated time.
  void drag_to(const interaction::Ray& ray, double duration_s);
  void rest();     ///< stays where it is: velocity zero
  void release();
  bool active() const noexcept;
  bool moving() const noexcept;  ///< its velocity is not zero
  const interaction::Selection& selection() const;
  Eigen::Vector3d origin_mm() const;  ///< now

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

struct RunRequest {
  double seconds = 0.0;            ///< or
  std::optional<long> steps;
  std::optional<interaction::Gesture> gesture;
  std::string device;
};
struct RunResult {
  simulation::State state;
  std::shared_ptr<const surface::DeformedSurface> surface;  ///< null where unmapped
  simulation::Energy energy;
  long steps = 0;
  double step_s = 0.0;         ///< at the end
  int substeps = 1;            ///< parts that a named step above the largest stable one was taken in
  double stable_step_s = 0.0;  ///< at rest
  bool stable_step_is_estimate = false;  ///< of the converged eigenvalue; else of the per-point bound
  std::size_t worst_point = 0;           ///< that limits the step
  double seconds = 0.0;        ///< simulated
  double wall_s = 0.0;         ///< of the stepping alone
  double max_displacement_mm = 0.0;
  int recoveries = 0;
  bool diverged = false;
  std::string message;         ///< of a recovery or the divergence
  std::vector<core::Warning> warnings;  ///< a gesture's step that met no tissue
  std::string integrator, layout, device, driver;
  std::string layout_reason;  ///< for people
};
/// A whole headless run. A named step above the largest stable one is taken in
/// parts (`substeps`, with a warning of that name), `steps` and `step_s` being those
/// taken; `request.steps` counts named ones. Stretched tissue is stiffer: the step is
/// shortened while it lasts. Same recipe, gesture, device: the same result.
/// Throws Error(device), Error(cancelled), Error(usage); a divergence is a result.
RunResult run(const BuiltTissue& tissue, const BoundSurface& surface, const SimulationSettings& settings,
              const RunRequest& request, const core::Progress& progress = {});

}  // namespace palpate::session
