#include "device_solver.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <utility>

namespace palpate::simulation {

Float4 float4(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()), 0.0F};
}

unsigned checked_points_per_item(unsigned wanted) {
  if (wanted == 1 || wanted == 4 || wanted == 8 || wanted == 16) return wanted;
  throw core::Error(core::ErrorKind::internal, "points-per-item",
                    "A work-item takes 1, 4, 8 or 16 points, not " + std::to_string(wanted) + ".");
}

std::vector<std::string> scaling_defines_of(const Material& material) {
  std::vector<std::string> defines;
  if (!material.is_scaled()) return defines;
  if (material.scales_stiffness) defines.emplace_back("SCALED_STIFFNESS");
  if (material.scales_damping) defines.emplace_back("SCALED_DAMPING");
  if (material.scales_drag) defines.emplace_back("SCALED_DRAG");
  if (material.scales_mass) defines.emplace_back("SCALED_MASS");
  return defines;
}

DeviceSolver::DeviceSolver(const compute::Device& device, std::shared_ptr<const model::Tissue> tissue_given,
                           const Parameters& parameters, const Material& material)
    : Solver(std::move(tissue_given), material),
      device_(device),
      count_(tissue().points.size()),
      parameters_(parameters) {
  check(parameters);
}

void DeviceSolver::start() {
  use(parameters_);
  update_lists();
}

void DeviceSolver::step(int count, double step_s) {
  begin_steps(step_s);
  const bool moves = grab_moves() && held_list_.count > 0;
  const Float4 velocity = float4(grab_velocity_);
  if (moves)
    for (int n = 0; n < count; ++n) {
      run_steps(1, step_s, time_s_ + n * step_s);
      move_points(held_list_, velocity, static_cast<float>(step_s));
    }
  else
    run_steps(count, step_s, time_s_);
  end_steps();
  device_.flush();
  time_s_ += count * step_s;
}

void DeviceSolver::run_steps(int count, double step_s, double time_s) {
  for (int n = 0; n < count; ++n) run_step(step_s, time_s + n * step_s);
}

void DeviceSolver::hold(const std::vector<HeldPoint>& held) {
  held_ = checked(held, count_);
  update_lists();
  still(held_list_);
}

void DeviceSolver::set_grab_velocity(const Eigen::Vector3d& mm_per_s) {
  const bool comes_to_rest = mm_per_s.isZero(0.0) && grab_moves();
  grab_velocity_ = mm_per_s;
  if (comes_to_rest) still(held_list_);
}

void DeviceSolver::set_parameters(const Parameters& parameters) {
  check(parameters);
  use(parameters);
  parameters_ = parameters;
}

void DeviceSolver::set_anchors(const std::vector<std::uint32_t>& points) {
  Solver::set_anchors(points);
  update_lists();
}

State DeviceSolver::state() const {
  State state;
  state.time_s = time_s_;
  read_state(state);
  return state;
}

void DeviceSolver::set_state(const State& state) {
  check_size(state, count_);
  write_state(state);
  still(anchor_list_);
  time_s_ = state.time_s;
}

void DeviceSolver::save_snapshot() {
  copy_state_to_snapshot();
  snapshot_time_s_ = time_s_;
  has_snapshot_ = true;
}

void DeviceSolver::restore_snapshot() {
  if (!has_snapshot_) throw core::Error(core::ErrorKind::internal, "no-snapshot", "No snapshot was saved.");
  copy_snapshot_to_state();
  still(anchor_list_);  // points may have become anchors since
  time_s_ = snapshot_time_s_;
}

std::vector<float> DeviceSolver::freedom() const {
  std::vector<float> freedom(count_, 1.0F);
  for (const auto& [point, selectance] : held_) freedom[point] = 1.0F - selectance;
  for (const std::uint32_t point : material().anchors) freedom[point] = 0.0F;
  return freedom;
}

void DeviceSolver::list(const std::vector<HeldPoint>& points, PointList& target) const {
  std::vector<std::uint32_t> places;
  std::vector<float> selectances;
  for (const auto& [point, selectance] : points) {
    places.push_back(place_of(point));
    selectances.push_back(selectance);
  }
  target = {};
  target.count = points.size();
  if (points.empty()) return;
  target.places = buffer_of(device_, places);
  target.selectances = buffer_of(device_, selectances);
}

void DeviceSolver::update_lists() {
  device_.finish();  // what is queued still reads the old lists
  write_freedom(freedom());
  std::vector<std::uint32_t> anchors = material().anchors;
  std::sort(anchors.begin(), anchors.end());
  anchors.erase(std::unique(anchors.begin(), anchors.end()), anchors.end());
  std::vector<HeldPoint> moved;
  for (const auto& entry : held_)
    if (!std::binary_search(anchors.begin(), anchors.end(), entry.point)) moved.push_back(entry);
  list(moved, held_list_);
  std::vector<HeldPoint> fixed;
  for (const std::uint32_t point : anchors) fixed.push_back({point, 1.0F});
  list(fixed, anchor_list_);
  still(anchor_list_);
}

/// Scales the velocities by (1 - alpha).
void DeviceSolver::still(const PointList& points) {
  if (points.count > 0) move_points(points, {}, 0.0F);
}

}  // namespace palpate::simulation
