#pragma once

#include "device_solver.hpp"
#include "lattice_layout.hpp"

#include "palpate/compute/kernel_library.hpp"

#include <cstddef>
#include <string>
#include <vector>

namespace palpate::simulation {

/// What a lattice's state is like: kernels/lattice_points.cl (health) and lattice_health.cl.
class LatticeHealth {
 public:
  /// link_defines: of the kernel that looks at the links. weight_of_sites_mm:
  /// sum of the points' mass factors and sites, LPS.
  LatticeHealth(compute::KernelLibrary& library, const LatticeLayout& layout,
                const std::vector<std::string>& link_defines, const Eigen::Vector3d& weight_of_sites_mm);
  std::size_t bytes() const noexcept { return partials_.bytes() + link_sums_.bytes(); }

  Health of(const compute::Buffer& state, const compute::Buffer& rest_positions);

  struct Links {
    const compute::Buffer& freedom;
    const compute::Buffer& factors;  ///< anything where the material is alike everywhere
    const compute::Buffer& rest;
    const compute::Buffer& rows;
    const compute::Buffer& overflow_begins;
    const compute::Buffer& overflow;
  };
  /// gravity in the lattice's frame.
  LinkHealth of_links(const compute::Buffer& state, const Links& links, const Parameters& parameters,
                      double rest_scale, const Eigen::Vector3d& gravity_mm_per_s2);

 private:
  LinkHealth sums(const Parameters& parameters) const;

  const LatticeLayout& layout_;
  Eigen::Vector3d weight_of_sites_mm_;
  compute::Kernel health_;
  compute::Kernel link_health_;
  compute::Buffer partials_;
  compute::Buffer link_sums_;
};

}  // namespace palpate::simulation
