#pragma once

#include "palpate/compute/buffer.hpp"
#include "palpate/compute/device.hpp"

#include <cstddef>
#include <string>
#include <vector>

namespace palpate::simulation {

/// Positions and velocities on the device, a float4 a point each.
struct DevicePhase {
  compute::Buffer x;  ///< w: the material's factor
  compute::Buffer v;
  DevicePhase(const compute::Device& device, std::size_t bytes)
      : x(compute::Buffer::allocate(device, bytes)), v(compute::Buffer::allocate(device, bytes)) {}
  void copy_from(const DevicePhase& other) {
    x.copy_from(other.x, x.bytes());
    v.copy_from(other.v, v.bytes());
  }
  std::size_t bytes() const noexcept { return x.bytes() + v.bytes(); }
};

/// The arrays of the explicit layout, as kernels/explicit.cl describes them,
/// for it and for schemes that work on them.
struct ExplicitArrays {
  ExplicitArrays(const compute::Device& device, std::size_t points, std::size_t points_an_item);

  std::size_t point_count;
  std::size_t points_per_item;
  std::size_t stride;  ///< points in all arrays: point_count, filled up to whole blocks of columns
  std::size_t links_per_point = 1;
  /// SCALED_STIFFNESS and so on, as the material says.
  std::vector<std::string> scaling_defines;
  DevicePhase y;           ///< the state
  DevicePhase s2, s3, s4;  ///< of the stages of a step; free between steps
  compute::Buffer partners;
  compute::Buffer rest_lengths;
  compute::Buffer freedom;  ///< factor of a point's derivative: 1 - selectance, 0 for an anchor
};

}  // namespace palpate::simulation
