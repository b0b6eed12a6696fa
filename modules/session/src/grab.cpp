#include "palpate/session/run.hpp"

#include <optional>
#include <utility>

namespace palpate::session {

struct Grab::Impl {
  simulation::Solver& solver;
  const model::Tissue& tissue;
  const model::Adjacency& adjacency;
  std::optional<interaction::MoveTool> tool;
  std::vector<simulation::HeldPoint> held;
  interaction::Selection none;
  // Where the origin was when its velocity was last set.
  Eigen::Vector3d start_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_mm_per_s = Eigen::Vector3d::Zero();
  double start_s = 0.0;

  Eigen::Vector3d origin_mm() const { return start_mm + velocity_mm_per_s * (solver.time_s() - start_s); }
  void set_velocity(const Eigen::Vector3d& velocity) {
    start_mm = origin_mm();
    start_s = solver.time_s();
    velocity_mm_per_s = velocity;
    solver.set_grab_velocity(velocity);
  }
};

Grab::Grab(simulation::Solver& solver, const model::Tissue& tissue, const model::Adjacency& adjacency)
    : impl_(new Impl{solver, tissue, adjacency, {}, {}, {}}) {}

bool Grab::begin(const interaction::Ray& ray, const interaction::PickReach& reach, double radius_mm,
                 interaction::SelectionKind kind) {
  release();
  const auto state = impl_->solver.state();
  const interaction::PointsNow now{state.positions_mm, impl_->tissue.points.center_mm};
  const auto hit = interaction::pick(ray, reach, now);
  if (!hit) return false;
  auto selection = interaction::select(*hit, radius_mm, kind, now, impl_->adjacency);
  if (selection.points.empty()) return false;
  for (std::size_t n = 0; n < selection.points.size(); ++n)
    impl_->held.push_back({selection.points[n], selection.alphas[n]});
  impl_->start_mm = selection.origin_mm;
  impl_->start_s = impl_->solver.time_s();
  impl_->velocity_mm_per_s.setZero();
  impl_->tool.emplace(std::move(selection));
  impl_->solver.set_grab_velocity(Eigen::Vector3d::Zero());
  impl_->solver.hold(impl_->held);
  return true;
}

void Grab::drag_to(const interaction::Ray& ray, double duration_s) {
  if (!active() || !(duration_s > 0.0)) return;
  const Eigen::Vector3d target_mm = impl_->tool->drag_to(ray);
  impl_->set_velocity((target_mm - impl_->origin_mm()) / duration_s);
}

void Grab::rest() {
  if (active() && !impl_->velocity_mm_per_s.isZero(0.0)) impl_->set_velocity(Eigen::Vector3d::Zero());
}

void Grab::release() {
  if (!active()) return;
  impl_->set_velocity(Eigen::Vector3d::Zero());
  impl_->solver.hold({});
  impl_->held.clear();
  impl_->tool.reset();
}

bool Grab::active() const noexcept { return impl_->tool.has_value(); }

bool Grab::moving() const noexcept { return active() && !impl_->velocity_mm_per_s.isZero(0.0); }

const interaction::Selection& Grab::selection() const {
  return impl_->tool ? impl_->tool->selection() : impl_->none;
}

Eigen::Vector3d Grab::origin_mm() const { return impl_->origin_mm(); }

}  // namespace palpate::session
