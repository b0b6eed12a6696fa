#include "lattice_health.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::simulation {

namespace {

constexpr std::size_t items = 256;

}  // namespace

LatticeHealth::LatticeHealth(compute::KernelLibrary& library, const LatticeLayout& layout,
                             const std::vector<std::string>& link_defines,
                             const Eigen::Vector3d& weight_of_sites_mm)
    : layout_(layout),
      weight_of_sites_mm_(weight_of_sites_mm),
      health_(library.build("lattice_points.cl", "health", {"LANES=" + std::to_string(layout.lanes)})),
      link_health_(library.build("lattice_health.cl", "link_health", link_defines)),
      partials_(compute::Buffer::allocate(library.device(), items * sizeof(Float4))),
      link_sums_(compute::Buffer::allocate(library.device(), 4 * items * layout.lanes * sizeof(float))) {}

Health LatticeHealth::of(const compute::Buffer& state, const compute::Buffer& rest_positions) {
  const std::size_t share = (layout_.segments + items - 1) / items;
  health_.set_all(state, rest_positions, partials_, static_cast<std::uint32_t>(layout_.segments),
                  static_cast<std::uint32_t>(share), static_cast<std::uint32_t>(items));
  health_.run(items, 1);
  Float4 worst{};
  partials_.visit([&](const void* data) {
    const auto* values = static_cast<const float*>(data);
    for (std::size_t n = 0; n < 4 * items; ++n) worst[n % 4] = std::max(worst[n % 4], values[n]);
  });
  return {worst[2] == 0.0F, std::sqrt(worst[0]), std::sqrt(worst[1])};
}

LinkHealth LatticeHealth::of_links(const compute::Buffer& state, const Links& links,
                                   const Parameters& parameters, double rest_scale,
                                   const Eigen::Vector3d& gravity_mm_per_s2) {
  const std::size_t share = (layout_.segments + items - 1) / items;
  link_health_.set_all(state, links.freedom, links.factors, links.rest, links.rows, links.overflow_begins,
                       links.overflow, link_sums_, partials_, static_cast<std::uint32_t>(layout_.segments),
                       static_cast<std::uint32_t>(share), static_cast<std::uint32_t>(items),
                       layout_.rest_quantum_mm, layout_.rest_offset_mm, static_cast<float>(rest_scale),
                       float4(gravity_mm_per_s2));
  for (unsigned axis = 0; axis < 3; ++axis) link_health_.set(16 + axis, float4(layout_.steps_mm[axis]));
  link_health_.run(items, 1);
  return sums(parameters);
}

LinkHealth LatticeHealth::sums(const Parameters& p) const {
  LinkHealth result;
  double weight = weight_of_sites_mm_.dot(p.gravity_mm_per_s2);
  double elastic = 0.0;
  float rate = 0.0F;
  link_sums_.visit([&](const void* data) {
    const auto* values = static_cast<const float*>(data);
    for (std::size_t n = 0; n < 4 * items * layout_.lanes; ++n) {
      const std::size_t which = n / layout_.lanes % 4;
      if (which == 0) result.kinetic += 0.5 * p.mass * static_cast<double>(values[n]);
      if (which == 1) weight += static_cast<double>(values[n]);
      if (which == 2) elastic += static_cast<double>(values[n]);
      if (which == 3) rate = std::max(rate, values[n]);
    }
  });
  partials_.visit([&](const void* data) {
    const auto* values = static_cast<const float*>(data);
    for (std::size_t n = 0; n < items; ++n) {
      elastic += static_cast<double>(values[4 * n]);
      rate = std::max(rate, values[4 * n + 1]);
    }
  });
  result.potential = 0.5 * p.stiffness_per_s2 * elastic - p.mass * weight;
  result.max_strain_rate_per_s = rate;
  return result;
}

}  // namespace palpate::simulation
