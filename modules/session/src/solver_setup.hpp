#pragma once

#include "palpate/compute/device.hpp"
#include "palpate/session/pipeline.hpp"
#include "palpate/simulation/solver.hpp"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate::session {

/// A solver and the device it runs on; none for the reference.
struct SolverOnDevice {
  std::optional<compute::Device> device;
  std::unique_ptr<simulation::Solver> solver;
};
SolverOnDevice open_solver(const std::string& device_selector, std::shared_ptr<const model::Tissue> tissue,
                           const simulation::Parameters& parameters,
                           const simulation::OpenclOptions& options = {},
                           const simulation::Material& material = {});

/// Deforms a bound surface by the state of a solver, on its device or, for the
/// reference solver, on the host.
class SurfaceFollower {
 public:
  /// Neither `on` nor the tissue behind it may end before this.
  SurfaceFollower(const SolverOnDevice& on, const BoundSurface& surface, const Eigen::Vector3d& center_mm);
  bool mapped() const noexcept { return binding_ != nullptr; }
  std::size_t vertex_count() const noexcept { return binding_ ? binding_->size() : 0; }
  /// positions_mm: those of the solver now; only the reference reads them.
  void deform(const std::vector<Eigen::Vector3f>& positions_mm, surface::DeformedSurface& out);

 private:
  const simulation::Solver& solver_;
  std::shared_ptr<const surface::SurfaceBinding> binding_;
  Eigen::Vector3d center_mm_;
  std::unique_ptr<surface::Deformer> deformer_;
  std::vector<float> vertices_;
  std::vector<float> normals_;
};

/// The farthest that a point is from its rest place.
double max_displacement_mm(const model::Tissue& tissue, const std::vector<Eigen::Vector3f>& positions_mm);

}  // namespace palpate::session
