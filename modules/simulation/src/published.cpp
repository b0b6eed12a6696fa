#include "palpate/simulation/published.hpp"

#include "held.hpp"

#include "palpate/compute/kernel_library.hpp"
#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace palpate::simulation {

namespace {

using compute::Buffer;

// The struct `Point` of kernels/published.cl, byte by byte.
constexpr std::size_t velocity_at = 16;
constexpr std::size_t links_at = 40;
constexpr std::size_t link_bytes = 8;
constexpr std::size_t alignment = 16;
constexpr std::size_t motion_bytes = 32;
constexpr std::uint32_t no_point = 0xffffffffU;
constexpr std::size_t group = 64;

void put(std::vector<std::byte>& bytes, std::size_t at, const void* value, std::size_t size) {
  std::memcpy(bytes.data() + at, value, size);
}

}  // namespace

struct PublishedSimulation::Impl {
  compute::Device device;
  std::size_t count = 0;
  std::size_t point_bytes = 0;
  std::vector<std::byte> host;  ///< the points as they were made; a new state is put into them
  Buffer points;
  std::array<Buffer, 4> k;
  std::array<compute::Kernel, 4> evaluate;
  compute::Kernel integrate;
  double time_s = 0.0;
};

PublishedSimulation::PublishedSimulation(const compute::Device& device, const model::Tissue& tissue,
                                         const Parameters& parameters)
    : impl_(new Impl{device, 0, 0, {}, {}, {}, {}, {}, 0.0}) {
  check(parameters);
  if (parameters.integrator != Integrator::rk4 || !parameters.gravity_mm_per_s2.isZero(0.0) ||
      parameters.mass != 1.0 || parameters.beat_amplitude != 0.0)
    core::throw_usage("The published kernels know RK4 alone, without gravity, other masses or a beat.");
  Impl& self = *impl_;
  self.count = tissue.points.size();
  std::vector<std::uint32_t> used(self.count, 0);
  for (const auto& pair : tissue.links.pairs)
    for (const std::uint32_t end : pair) ++used[end];
  const std::size_t links =
      self.count == 0 ? 1 : std::max<std::size_t>(1, *std::max_element(used.begin(), used.end()));
  const std::size_t bare = links_at + link_bytes * links;
  self.point_bytes = (bare + alignment - 1) / alignment * alignment;

  self.host.assign(self.count * self.point_bytes, std::byte{0});
  for (std::size_t point = 0; point < self.count; ++point) {
    const std::size_t at = point * self.point_bytes;
    put(self.host, at, tissue.points.positions_mm[point].data(), 3 * sizeof(float));
    for (std::size_t slot = 0; slot < links; ++slot)
      put(self.host, at + links_at + slot * link_bytes, &no_point, sizeof(no_point));
  }
  std::fill(used.begin(), used.end(), 0);
  for (std::size_t link = 0; link < tissue.links.size(); ++link) {
    const auto [a, b] = tissue.links.pairs[link];
    for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
      const std::size_t at = from * self.point_bytes + links_at + used[from]++ * link_bytes;
      put(self.host, at, &to, sizeof(to));
      put(self.host, at + sizeof(to), &tissue.links.rest_lengths_mm[link], sizeof(float));
    }
  }
  self.points = Buffer::copy_of(device, self.host.data(), self.host.size());
  for (auto& buffer : self.k) buffer = Buffer::allocate(device, self.count * motion_bytes);

  compute::KernelLibrary library(device);
  const std::vector<std::string> defines{"LINKS_PER_POINT=" + std::to_string(links),
                                         "PADDING=" + std::to_string(self.point_bytes - bare),
                                         "-cl-fast-relaxed-math"};
  const auto size = static_cast<std::uint32_t>(self.count);
  const Buffer none;
  for (std::size_t n = 0; n < 4; ++n) {
    self.evaluate[n] = library.build("published.cl", "evaluate", defines);
    self.evaluate[n].set_all(self.points, n == 0 ? none : self.k[n - 1], self.k[n], size,
                             static_cast<float>(parameters.stiffness_per_s2),
                             static_cast<float>(parameters.damping_per_s),
                             static_cast<float>(parameters.drag_per_s));
  }
  self.integrate = library.build("published.cl", "integrate", defines);
  self.integrate.set_all(self.points, self.k[0], self.k[1], self.k[2], self.k[3], size);
}

PublishedSimulation::~PublishedSimulation() = default;
PublishedSimulation::PublishedSimulation(PublishedSimulation&&) noexcept = default;
PublishedSimulation& PublishedSimulation::operator=(PublishedSimulation&&) noexcept = default;

void PublishedSimulation::step(int count, double step_s) {
  Impl& self = *impl_;
  const auto h = static_cast<float>(step_s);
  const std::array<float, 4> fractions{0.0F, h / 2.0F, h / 2.0F, h};
  for (std::size_t n = 0; n < 4; ++n) self.evaluate[n].set(7, fractions[n]);
  self.integrate.set(6, h / 6.0F);
  for (int n = 0; n < count; ++n) {
    for (auto& kernel : self.evaluate) kernel.run(self.count, group);
    self.integrate.run(self.count, group);
  }
  self.device.flush();
  self.time_s += count * step_s;
}

State PublishedSimulation::state() const {
  const Impl& self = *impl_;
  State state;
  state.time_s = self.time_s;
  state.positions_mm.resize(self.count);
  state.velocities_mm_per_s.resize(self.count);
  self.points.visit([&](const void* data) {
    const auto* bytes = static_cast<const std::byte*>(data);
    for (std::size_t n = 0; n < self.count; ++n, bytes += self.point_bytes) {
      std::memcpy(state.positions_mm[n].data(), bytes, 3 * sizeof(float));
      std::memcpy(state.velocities_mm_per_s[n].data(), bytes + velocity_at, 3 * sizeof(float));
    }
  });
  return state;
}

void PublishedSimulation::set_state(const State& state) {
  Impl& self = *impl_;
  check_size(state, self.count);
  for (std::size_t n = 0; n < self.count; ++n) {
    put(self.host, n * self.point_bytes, state.positions_mm[n].data(), 3 * sizeof(float));
    put(self.host, n * self.point_bytes + velocity_at, state.velocities_mm_per_s[n].data(),
        3 * sizeof(float));
  }
  self.points.write(self.host.data(), self.host.size());
  self.time_s = state.time_s;
}

std::size_t PublishedSimulation::bytes() const {
  std::size_t sum = impl_->points.bytes();
  for (const auto& buffer : impl_->k) sum += buffer.bytes();
  return sum;
}

}  // namespace palpate::simulation
