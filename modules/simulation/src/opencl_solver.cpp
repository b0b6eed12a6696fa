#include "held.hpp"

#include "palpate/compute/kernel_library.hpp"
#include "palpate/core/error.hpp"
#include "palpate/simulation/solver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace palpate::simulation {

namespace {

using compute::Buffer;
using Float4 = std::array<float, 4>;

constexpr std::size_t health_group = 64;
constexpr std::size_t health_groups = 256;
// Work-items are heavy where they take many points; small groups spread them evenly.
constexpr std::size_t step_group = 32;

/// Positions and velocities on the device, a float4 a point each.
struct DevicePhase {
  Buffer x;
  Buffer v;
  DevicePhase(const compute::Device& device, std::size_t bytes)
      : x(Buffer::allocate(device, bytes)), v(Buffer::allocate(device, bytes)) {}
  void copy_from(const DevicePhase& other) {
    x.copy_from(other.x, x.bytes());
    v.copy_from(other.v, v.bytes());
  }
};

unsigned points_per_item(const compute::Device& device, const OpenclOptions& options) {
  const unsigned wanted = options.points_per_item;
  if (wanted == 0) {
    const unsigned width = device.info().float_vector_width;
    // Sixteen run out of registers: 20 % slower than eight where the width is sixteen.
    return width >= 8 ? 8 : width >= 4 ? 4 : 1;
  }
  if (wanted == 1 || wanted == 4 || wanted == 8 || wanted == 16) return wanted;
  throw core::Error(core::ErrorKind::internal, "points-per-item",
                    "A work-item takes 1, 4, 8 or 16 points, not " + std::to_string(wanted) + ".");
}

/// The links of a point in columns, [slot][point], for `stride` >= the points.
struct Columns {
  std::size_t links_per_point = 1;
  std::vector<std::uint32_t> partners;
  std::vector<float> rest_lengths_mm;
};

Columns columns_of(const model::LinkGraph& links, std::size_t stride) {
  std::vector<std::uint32_t> used(stride, 0);
  for (const auto& pair : links.pairs)
    for (const std::uint32_t end : pair) ++used[end];
  Columns columns;
  if (stride > 0) columns.links_per_point = std::max(1U, *std::max_element(used.begin(), used.end()));
  columns.partners.resize(columns.links_per_point * stride);
  columns.rest_lengths_mm.assign(columns.partners.size(), 0.0F);
  for (std::size_t n = 0; n < columns.partners.size(); ++n)
    columns.partners[n] = static_cast<std::uint32_t>(n % stride);  // itself: no force
  std::fill(used.begin(), used.end(), 0);
  for (std::size_t link = 0; link < links.size(); ++link) {
    const auto [a, b] = links.pairs[link];
    for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
      const std::size_t place = used[from]++ * stride + from;
      columns.partners[place] = to;
      columns.rest_lengths_mm[place] = links.rest_lengths_mm[link];
    }
  }
  return columns;
}

/// `count` of them, those after the last vector zero.
std::vector<Float4> float4s(const std::vector<Eigen::Vector3f>& vectors, std::size_t count) {
  std::vector<Float4> result;
  result.reserve(count);
  for (const auto& v : vectors) result.push_back({v.x(), v.y(), v.z(), 0.0F});
  result.resize(count, Float4{});
  return result;
}

Float4 float4(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()), 0.0F};
}

std::vector<Eigen::Vector3f> vectors_of(const Buffer& buffer, std::size_t count) {
  std::vector<Eigen::Vector3f> result(count);
  buffer.visit([&](const void* data) {
    const auto* values = static_cast<const float*>(data);
    for (std::size_t n = 0; n < count; ++n) result[n] = {values[4 * n], values[4 * n + 1], values[4 * n + 2]};
  });
  return result;
}

template <typename Value>
Buffer buffer_of(const compute::Device& device, const std::vector<Value>& values) {
  return Buffer::copy_of(device, values.data(), values.size() * sizeof(Value));
}

class OpenclSolver final : public Solver {
 public:
  OpenclSolver(const compute::Device& device, std::shared_ptr<const model::Tissue> tissue_given,
               const Parameters& parameters, const OpenclOptions& options, const Material& material)
      : Solver(std::move(tissue_given), material),
        device_(device),
        count_(tissue().points.size()),
        points_per_item_(points_per_item(device, options)),
        stride_((count_ + points_per_item_ - 1) / points_per_item_ * points_per_item_),
        y_(device, state_bytes()),
        s2_(device, state_bytes()),
        s3_(device, state_bytes()),
        s4_(device, state_bytes()),
        snapshot_(device, state_bytes()),
        freedom_(Buffer::allocate(device, stride_ * sizeof(float))),
        partials_(Buffer::allocate(device, health_groups * sizeof(Float4))) {
    check(parameters);
    if (parameters.integrator != Integrator::rk4)
      core::throw_usage("The integrator " + to_string(parameters.integrator) + " is not in this version.");
    const std::vector<Float4> rest = float4s(tissue().points.positions_mm, stride_);
    rest_ = buffer_of(device, rest);
    std::size_t links_per_point = 1;
    {
      const Columns columns = columns_of(tissue().links, stride_);
      links_per_point = columns.links_per_point;
      partners_ = buffer_of(device, columns.partners);
      rest_lengths_ = buffer_of(device, columns.rest_lengths_mm);
    }
    build(links_per_point);
    set_parameters(parameters);
    write_freedom();
    warm_up();
    write(y_.x, rest);
    y_.v.fill_zero();
  }

  void step(int count, double step_s) override {
    const auto h = static_cast<float>(step_s);
    set_step(h);
    const bool moves = grab_moves() && !held_.empty();
    if (moves) grab_.set(6, h);
    for (int n = 0; n < count; ++n) {
      for (auto& stage : stages_) stage.run(stride_ / points_per_item_, step_group);
      if (moves) grab_.run(held_.size());
    }
    device_.flush();
    time_s_ += count * step_s;
  }

  void hold(const std::vector<HeldPoint>& held) override {
    std::vector<HeldPoint> next = checked(held, count_);
    std::vector<std::uint32_t> points;
    std::vector<float> selectances;
    for (const auto& [point, selectance] : next) {
      points.push_back(point);
      selectances.push_back(selectance);
    }
    held_ = std::move(next);
    write_freedom();
    if (held_.empty()) return;
    held_points_ = buffer_of(device_, points);
    held_selectances_ = buffer_of(device_, selectances);
    move_held_with({}, 0.0F);
    set_grab_arguments();
  }

  void set_grab_velocity(const Eigen::Vector3d& mm_per_s) override {
    const bool comes_to_rest = mm_per_s.isZero(0.0) && grab_moves();
    grab_velocity_ = mm_per_s;
    if (held_.empty()) return;
    if (comes_to_rest) move_held_with({}, 0.0F);
    set_grab_arguments();
  }

  void set_parameters(const Parameters& parameters) override {
    check(parameters);
    if (parameters.integrator != Integrator::rk4)
      core::throw_usage("The integrator " + to_string(parameters.integrator) + " is not in this version.");
    parameters_ = parameters;
    set_parameter_arguments();
  }
  const Parameters& parameters() const override { return parameters_; }

  State state() const override { return {time_s_, vectors_of(y_.x, count_), vectors_of(y_.v, count_)}; }

  void set_state(const State& state) override {
    check_size(state, count_);
    write(y_.x, float4s(state.positions_mm, stride_));
    write(y_.v, float4s(state.velocities_mm_per_s, stride_));
    time_s_ = state.time_s;
  }

  void save_snapshot() override {
    snapshot_.copy_from(y_);
    snapshot_time_s_ = time_s_;
    has_snapshot_ = true;
  }
  void restore_snapshot() override {
    if (!has_snapshot_) throw core::Error(core::ErrorKind::internal, "no-snapshot", "No snapshot was saved.");
    y_.copy_from(snapshot_);
    time_s_ = snapshot_time_s_;
  }

  double time_s() const override { return time_s_; }

  Health health() override {
    health_.run(health_groups * health_group, health_group);
    Float4 worst{};
    partials_.visit([&](const void* data) {
      const auto* values = static_cast<const float*>(data);
      for (std::size_t n = 0; n < 4 * health_groups; ++n) worst[n % 4] = std::max(worst[n % 4], values[n]);
    });
    return {worst[2] == 0.0F, std::sqrt(worst[0]), std::sqrt(worst[1])};
  }

  const Buffer* positions_buffer() const override { return &y_.x; }
  std::string device_name() const override { return device_.info().name; }
  std::string driver() const override { return device_.info().driver; }
  std::string layout() const override { return "explicit"; }
  std::size_t bytes() const override {
    std::size_t sum = rest_.bytes() + partners_.bytes() + rest_lengths_.bytes() + freedom_.bytes() +
                      partials_.bytes() + held_points_.bytes() + held_selectances_.bytes();
    for (const auto* phase : {&y_, &s2_, &s3_, &s4_, &snapshot_}) sum += phase->x.bytes() + phase->v.bytes();
    return sum;
  }

 private:
  std::size_t state_bytes() const { return stride_ * sizeof(Float4); }

  void build(std::size_t links_per_point) {
    compute::KernelLibrary library(device_);
    const std::vector<std::string> defines{"LINKS_PER_POINT=" + std::to_string(links_per_point),
                                           "POINTS_PER_ITEM=" + std::to_string(points_per_item_),
                                           "-cl-fast-relaxed-math"};
    const std::array<const DevicePhase*, 4> sources{&y_, &s2_, &s3_, &s4_};
    const std::array<const DevicePhase*, 3> targets{&s2_, &s3_, &s4_};
    for (std::size_t n = 0; n < 3; ++n) {
      stages_[n] = library.build("explicit_rk4.cl", "stage", defines);
      stages_[n].set_all(sources[n]->x, sources[n]->v, y_.x, y_.v, targets[n]->x, targets[n]->v);
    }
    stages_[3] = library.build("explicit_rk4.cl", "finish", defines);
    stages_[3].set_all(s4_.x, s4_.v, s3_.x, s3_.v, s2_.x, s2_.v, y_.x, y_.v);
    for (std::size_t n = 0; n < 4; ++n) {
      const unsigned next = first_common(n);
      stages_[n].set(next, partners_);
      stages_[n].set(next + 1, rest_lengths_);
      stages_[n].set(next + 2, freedom_);
      stages_[n].set(next + 3, static_cast<std::uint32_t>(stride_));
    }
    grab_ = library.build("grab.cl", "grab");
    health_ = library.build("health.cl", "health", {"GROUP_SIZE=" + std::to_string(health_group)});
    health_.set_all(y_.x, y_.v, rest_, partials_, static_cast<std::uint32_t>(count_));
  }

  /// The argument from which on all four stage kernels are alike.
  static unsigned first_common(std::size_t stage) { return stage < 3 ? 6 : 8; }

  void set_parameter_arguments() {
    for (std::size_t n = 0; n < 4; ++n) {
      const unsigned next = first_common(n) + 4;
      stages_[n].set(next, static_cast<float>(parameters_.stiffness_per_s2));
      stages_[n].set(next + 1, static_cast<float>(parameters_.damping_per_s));
      stages_[n].set(next + 2, static_cast<float>(parameters_.drag_per_s));
      stages_[n].set(next + 3, float4(parameters_.gravity_mm_per_s2));
    }
  }

  void set_step(float h) {
    const std::array<float, 4> fractions{h / 2.0F, h / 2.0F, h, h / 6.0F};
    for (std::size_t n = 0; n < 4; ++n) stages_[n].set(first_common(n) + 8, fractions[n]);
  }

  bool grab_moves() const { return !grab_velocity_.isZero(0.0); }

  /// The points that only fill the last work-item up stay where they are.
  void write_freedom() {
    std::vector<float> freedom(count_, 1.0F);
    freedom.resize(stride_, 0.0F);
    for (const auto& [point, selectance] : held_) freedom[point] = 1.0F - selectance;
    freedom_.write(freedom.data(), freedom.size() * sizeof(float));
  }

  void set_grab_arguments() {
    grab_.set_all(y_.x, y_.v, held_points_, held_selectances_, static_cast<std::uint32_t>(held_.size()),
                  float4(grab_velocity_));
  }

  void move_held_with(const Float4& velocity, float h) {
    grab_.set_all(y_.x, y_.v, held_points_, held_selectances_, static_cast<std::uint32_t>(held_.size()),
                  velocity, h);
    grab_.run(held_.size());
  }

  /// Drivers finish the compiling of a kernel at its first launch; that wait
  /// belongs here, not into the first picture. What it writes is written over.
  void warm_up() {
    if (count_ == 0) return;
    y_.x.fill_zero();
    y_.v.fill_zero();
    set_step(0.0F);
    for (auto& stage : stages_) stage.run(stride_ / points_per_item_, step_group);
    grab_.set_all(y_.x, y_.v, freedom_, freedom_, std::uint32_t{0}, Float4{}, 0.0F);
    grab_.run(1);
    health_.run(health_groups * health_group, health_group);
    device_.finish();
  }

  static void write(Buffer& buffer, const std::vector<Float4>& values) {
    buffer.write(values.data(), values.size() * sizeof(Float4));
  }

  compute::Device device_;
  std::size_t count_;
  unsigned points_per_item_;
  std::size_t stride_;  ///< points in all arrays: count_, filled up to whole work-items
  Parameters parameters_;
  // y, the three stage states, and the snapshot. The last stage writes over y,
  // so that the positions stay in one buffer for whoever draws them.
  DevicePhase y_, s2_, s3_, s4_, snapshot_;
  Buffer rest_;
  Buffer freedom_;  ///< 1 - selectance
  Buffer partials_;
  Buffer partners_;
  Buffer rest_lengths_;
  Buffer held_points_;
  Buffer held_selectances_;
  std::array<compute::Kernel, 4> stages_;
  compute::Kernel grab_;
  compute::Kernel health_;
  std::vector<HeldPoint> held_;
  Eigen::Vector3d grab_velocity_ = Eigen::Vector3d::Zero();
  double time_s_ = 0.0;
  double snapshot_time_s_ = 0.0;
  bool has_snapshot_ = false;
};

}  // namespace

std::unique_ptr<Solver> make_opencl_solver(const compute::Device& device,
                                           std::shared_ptr<const model::Tissue> tissue,
                                           const Parameters& parameters, const OpenclOptions& options,
                                           const Material& material) {
  return std::make_unique<OpenclSolver>(device, std::move(tissue), parameters, options, material);
}

}  // namespace palpate::simulation
