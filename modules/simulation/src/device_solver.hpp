#pragma once

#include "held.hpp"

#include "palpate/compute/buffer.hpp"
#include "palpate/compute/device.hpp"
#include "palpate/simulation/solver.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace palpate::simulation {

using Float4 = std::array<float, 4>;
Float4 float4(const Eigen::Vector3d& v);

template <typename Value>
compute::Buffer buffer_of(const compute::Device& device, const std::vector<Value>& values) {
  return compute::Buffer::copy_of(device, values.data(), values.size() * sizeof(Value));
}

/// Throws Error(internal) for what is not 1, 4, 8 or 16.
unsigned checked_points_per_item(unsigned wanted);
/// What the kernels are told of a material that is not alike everywhere.
std::vector<std::string> scaling_defines_of(const Material& material);

/// Points that are moved by hand, on the device.
struct PointList {
  std::size_t count = 0;
  compute::Buffer places;       ///< uint, as place_of() numbers them
  compute::Buffer selectances;  ///< float
  std::size_t bytes() const noexcept { return places.bytes() + selectances.bytes(); }
};

/// What every OpenCL solver does alike, whatever its arrays look like: held
/// points, the grab's rules, anchors, time, snapshots, the loop over steps. A
/// layout fills the hooks in and calls start() at the end of its constructor.
class DeviceSolver : public Solver {
 public:
  void step(int count, double step_s) final;
  void hold(const std::vector<HeldPoint>& held) final;
  void set_grab_velocity(const Eigen::Vector3d& mm_per_s) final;
  void set_parameters(const Parameters& parameters) final;
  void set_anchors(const std::vector<std::uint32_t>& points) final;
  const Parameters& parameters() const final { return parameters_; }
  State state() const final;
  void set_state(const State& state) final;
  void save_snapshot() final;
  void restore_snapshot() final;
  double time_s() const final { return time_s_; }
  std::string device_name() const final { return device_.info().name; }
  std::string driver() const final { return device_.info().driver; }

 protected:
  /// Throws Error(usage) as check(Parameters) does.
  DeviceSolver(const compute::Device& device, std::shared_ptr<const model::Tissue> tissue,
               const Parameters& parameters, const Material& material);
  /// Calls use() and write_freedom(); the state is the layout's to write.
  void start();

  const compute::Device& device() const noexcept { return device_; }
  std::size_t point_count() const noexcept { return count_; }
  std::vector<float> freedom() const final;
  std::size_t list_bytes() const noexcept { return held_list_.bytes() + anchor_list_.bytes(); }

  // Hooks. Calls of one batch: begin_steps, then run_steps or, while a grab
  // moves, per step run_steps and move_points; end_steps.

  /// Takes new parameters for the steps to come.
  /// Throws Error(usage), and changes nothing, where the layout cannot.
  virtual void use(const Parameters& parameters) = 0;
  /// 1 - selectance of every point, 0 for an anchor: the factor of its derivative.
  virtual void write_freedom(const std::vector<float>& freedom) = 0;
  /// What all steps of a batch share.
  virtual void begin_steps(double step_s) = 0;
  /// Queues one step from time_s to time_s + step_s.
  virtual void run_step(double step_s, double time_s) = 0;
  /// Queues so many steps, with nothing between them.
  virtual void run_steps(int count, double step_s, double time_s);
  /// From here on the state is where the other hooks and positions_buffer() find it.
  virtual void end_steps() {}
  /// Queues x += alpha u h, v = (1 - alpha) v + alpha u (kernels/grab.cl) on
  /// the state that the last step left.
  virtual void move_points(const PointList& points, const Float4& velocity_mm_per_s, float h_s) = 0;
  /// Where the kernel that moves points finds a point.
  virtual std::uint32_t place_of(std::uint32_t point) const { return point; }
  /// Positions and velocities; time_s is not the layout's.
  virtual void read_state(State& state) const = 0;
  virtual void write_state(const State& state) = 0;
  virtual void copy_state_to_snapshot() = 0;
  virtual void copy_snapshot_to_state() = 0;

 private:
  void list(const std::vector<HeldPoint>& points, PointList& target) const;
  void update_lists();
  bool grab_moves() const { return !grab_velocity_.isZero(0.0); }
  void still(const PointList& points);

  compute::Device device_;
  std::size_t count_;
  Parameters parameters_;
  std::vector<HeldPoint> held_;
  PointList held_list_;    ///< held_ without the anchors
  PointList anchor_list_;  ///< with selectance 1
  Eigen::Vector3d grab_velocity_ = Eigen::Vector3d::Zero();
  double time_s_ = 0.0;
  double snapshot_time_s_ = 0.0;
  bool has_snapshot_ = false;
};

}  // namespace palpate::simulation
