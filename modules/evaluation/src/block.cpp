#include "block.hpp"

#include "palpate/simulation/stability.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::evaluation {
namespace {

/// The slowest swing of a cube takes as long as a wave of shear needs to pass
/// it: its side over the root of k. Time and drag go by it, so that blocks of
/// every size and stiffness are given as many swings to settle in.
double time_scale(int side, double stiffness_per_s2) {
  return side / 10.0 * std::sqrt(10000.0 / stiffness_per_s2);
}

}  // namespace

Block::Block(const Setup& setup, const CubeModel& model, double stiffness_per_s2)
    : tissue_(make_cube(model)), top_(highest_layer(*tissue_)) {
  const double scale = time_scale(model.side, stiffness_per_s2);
  settling_s_ = (setup.quick ? 3.0 : 6.0) * scale;
  simulation::Parameters parameters;
  parameters.stiffness_per_s2 = stiffness_per_s2;
  parameters.drag_per_s = 4.0 / scale;
  simulation::Material material;
  material.anchors = lowest_layer(*tissue_);
  simulation::StabilityCase at;
  at.material = &material;
  // A pull stretches links and stiffens them: room is left for that.
  step_s_ = 0.8 * simulation::stable_step(*tissue_, parameters, at).step_s;
  solver_ = make_solver(setup, tissue_, parameters, material);
}

Loaded Block::push_sideways(double acceleration_mm_per_s2, const core::CancelToken& cancel) {
  reset(*solver_, *tissue_);
  push(*solver_, top_, {acceleration_mm_per_s2, 0.0, 0.0}, step_s_);
  run(0.8 * settling_s_, cancel);
  const double before = top_displacement_mm().x();
  run(0.2 * settling_s_, cancel);
  Loaded loaded;
  loaded.deflection_mm = top_displacement_mm().x();
  loaded.drift = std::abs(loaded.deflection_mm - before) / std::abs(loaded.deflection_mm);
  loaded.positions_mm = solver_->state().positions_mm;
  return loaded;
}

double Block::residual_after(double drag_mm, const core::CancelToken& cancel) {
  reset(*solver_, *tissue_);
  std::vector<simulation::HeldPoint> held;
  for (const std::uint32_t point : top_) held.push_back({point, 1.0F});
  solver_->hold(held);
  const double drag_s = settling_s_ / 10.0;
  const double steps = std::ceil(drag_s / step_s_);
  solver_->set_grab_velocity({drag_mm / (steps * step_s_), 0.0, 0.0});
  solver_->step(static_cast<int>(steps), step_s_);
  solver_->set_grab_velocity(Eigen::Vector3d::Zero());
  run(drag_s, cancel);
  solver_->hold({});
  run(settling_s_, cancel);
  return top_displacement_mm().norm() / drag_mm;
}

void Block::run(double seconds, const core::CancelToken& cancel) {
  int left = static_cast<int>(std::ceil(seconds / step_s_));
  while (left > 0) {
    cancel.check();
    const int now = std::min(left, 100);
    solver_->step(now, step_s_);
    solver_->health();  // waits, so that the queue does not grow
    left -= now;
  }
}

Eigen::Vector3d Block::top_displacement_mm() const {
  const auto state = solver_->state();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const std::uint32_t point : top_)
    sum += (state.positions_mm[point] - tissue_->points.positions_mm[point]).cast<double>();
  return sum / static_cast<double>(top_.size());
}

std::vector<float> displacements_mm(const model::Tissue& tissue,
                                    const std::vector<Eigen::Vector3f>& positions_mm) {
  std::vector<float> distances;
  distances.reserve(positions_mm.size());
  for (std::size_t n = 0; n < positions_mm.size(); ++n)
    distances.push_back((positions_mm[n] - tissue.points.positions_mm[n]).norm());
  return distances;
}

Shape side_by_side(const std::string& name, const model::Tissue& left,
                   const std::vector<Eigen::Vector3f>& left_mm, const model::Tissue& right,
                   const std::vector<Eigen::Vector3f>& right_mm) {
  float left_end = left_mm.front().x();
  float right_begin = right_mm.front().x();
  for (const auto& place : left_mm) left_end = std::max(left_end, place.x());
  for (const auto& place : right_mm) right_begin = std::min(right_begin, place.x());
  const float gap = static_cast<float>(left.geometry.dims()[0]) / 4.0F;
  const Eigen::Vector3f shift(left_end + gap - right_begin, 0.0F, 0.0F);
  auto both = std::make_shared<model::Tissue>(left);
  auto places = std::make_shared<std::vector<Eigen::Vector3f>>(left_mm);
  Shape shape{name, nullptr, nullptr, displacements_mm(left, left_mm)};
  const auto moved = displacements_mm(right, right_mm);
  shape.values.insert(shape.values.end(), moved.begin(), moved.end());
  const auto first = static_cast<std::uint32_t>(left.points.size());
  for (std::size_t n = 0; n < right.points.size(); ++n) {
    both->points.positions_mm.emplace_back(right.points.positions_mm[n] + shift);
    both->points.voxels.push_back(right.points.voxels[n]);
    both->points.intensities.push_back(right.points.intensities[n]);
    places->emplace_back(right_mm[n] + shift);
  }
  for (std::size_t n = 0; n < right.links.size(); ++n) {
    const auto [a, b] = right.links.pairs[n];
    both->links.pairs.push_back({a + first, b + first});
    both->links.rest_lengths_mm.push_back(right.links.rest_lengths_mm[n]);
  }
  both->on_lattice = false;
  shape.tissue = std::move(both);
  shape.positions_mm = std::move(places);
  return shape;
}

}  // namespace palpate::evaluation
