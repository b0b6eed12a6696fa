#pragma once

#include "cube.hpp"

// A cube that stands on its lowest layer and is pushed or dragged sideways by
// its highest one.
namespace palpate::evaluation {

/// Where a force left it.
struct Loaded {
  double deflection_mm = 0.0;  ///< of the highest layer along the force, on average
  double drift = 0.0;          ///< its change in the last fifth of the time, as a part of it
  std::vector<Eigen::Vector3f> positions_mm;
};

class Block {
 public:
  Block(const Setup& setup, const CubeModel& model, double stiffness_per_s2);

  /// From rest, under a static force along x on the highest layer, until it
  /// has had time to settle.
  Loaded push_sideways(double acceleration_mm_per_s2, const core::CancelToken& cancel);
  /// From rest, the highest layer is moved along x, held, let go and given
  /// time: what is left of its displacement, as a part of the drag.
  double residual_after(double drag_mm, const core::CancelToken& cancel);

  const std::shared_ptr<const model::Tissue>& tissue() const noexcept { return tissue_; }

 private:
  void run(double seconds, const core::CancelToken& cancel);
  Eigen::Vector3d top_displacement_mm() const;

  std::shared_ptr<const model::Tissue> tissue_;
  std::vector<std::uint32_t> top_;
  std::unique_ptr<simulation::Solver> solver_;
  double step_s_ = 0.0;
  double settling_s_ = 0.0;
};

/// How far each point is from where it was at rest.
std::vector<float> displacements_mm(const model::Tissue& tissue,
                                    const std::vector<Eigen::Vector3f>& positions_mm);

/// Two states beside each other along x, drawn as one.
Shape side_by_side(const std::string& name, const model::Tissue& left,
                   const std::vector<Eigen::Vector3f>& left_mm, const model::Tissue& right,
                   const std::vector<Eigen::Vector3f>& right_mm);

}  // namespace palpate::evaluation
