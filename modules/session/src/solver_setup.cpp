#include "solver_setup.hpp"

#include "palpate/session/run.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::session {

SolverOnDevice open_solver(const std::string& device_selector, std::shared_ptr<const model::Tissue> tissue,
                           const simulation::Parameters& parameters, const simulation::OpenclOptions& options,
                           const simulation::Material& material) {
  simulation::check(parameters);
  SolverOnDevice on;
  if (compute::is_reference_selector(device_selector)) {
    on.solver = simulation::make_reference_solver(std::move(tissue), parameters, material);
  } else {
    on.device = compute::open_device(device_selector);
    on.solver = simulation::make_opencl_solver(*on.device, std::move(tissue), parameters, options, material);
  }
  return on;
}

std::unique_ptr<simulation::Solver> make_solver(const std::string& device_selector,
                                                std::shared_ptr<const model::Tissue> tissue,
                                                const simulation::Parameters& parameters) {
  return open_solver(device_selector, std::move(tissue), parameters).solver;
}

SurfaceFollower::SurfaceFollower(const SolverOnDevice& on, const BoundSurface& surface,
                                 const Eigen::Vector3d& center_mm)
    : solver_(*on.solver), binding_(surface.binding), center_mm_(center_mm) {
  if (binding_ && on.device && solver_.positions_buffer() != nullptr)
    deformer_ = std::make_unique<surface::Deformer>(*on.device, *binding_, center_mm_);
}

void SurfaceFollower::deform(const std::vector<Eigen::Vector3f>& positions_mm,
                             surface::DeformedSurface& out) {
  if (deformer_) {
    deformer_->deform(*solver_.positions_buffer(), out);
    return;
  }
  surface::deform_reference(*binding_, center_mm_, positions_mm, vertices_, normals_);
  std::copy(vertices_.begin(), vertices_.end(), out.vertices());
  std::copy(normals_.begin(), normals_.end(), out.normals());
}

double max_displacement_mm(const model::Tissue& tissue, const std::vector<Eigen::Vector3f>& positions_mm) {
  const auto& rest_mm = tissue.points.positions_mm;
  float largest = 0.0F;
  for (std::size_t n = 0; n < rest_mm.size(); ++n)
    largest = std::max(largest, (positions_mm[n] - rest_mm[n]).squaredNorm());
  return std::sqrt(static_cast<double>(largest));
}

}  // namespace palpate::session
