#pragma once

#include "design.hpp"

#include "palpate/compute/device.hpp"
#include "palpate/core/progress.hpp"

#include <array>
#include <memory>
#include <optional>
#include <vector>

namespace palpate::imaging::adaptive {

/// What the remapping of the tensor's eigenvalues l1 >= l2 >= l3 takes:
///   x  = l1 / (contrast (|lowpass| + floor))
///   g1 = x^2 / (x^2 + 1),   g2 = g1 mu(l2 / l1),   g3 = g2 mu(l3 / l2)
///   mu(r) = r^2 / (r^2 + (1 - r)^2)
/// so that C = sum g_n e_n e_nT is a continuous function of T: where two
/// eigenvalues are one, so are their g.
struct Remap {
  double contrast = 0.0;  ///< of T per brightness
  double floor = 0.0;     ///< grey values; what stands for brightness in the dark
  /// The result is kept within these: the highpass filters overshoot beside
  /// what is bright and small, and no echo is darker than none.
  float low = 0.0F, high = 0.0F;
};

/// Runs one pass over one block. Equation, with hp_ij the highpass responses:
///   result = voxel + sum_ij (C_ij - delta_ij) hp_ij
/// which is lowpass + sum_k <C, M_k> highpass_k, written with the axes' six
/// products u_i u_j in place of the six (u.n_k)^2: both span the same filters,
/// and the lowpass is what the three hp_ii leave of a voxel, so C = I changes nothing.
class Engine {
 public:
  virtual ~Engine() = default;
  /// padded: the block with design().margin() on every side, i fastest.
  /// result: the block alone. Stops at the progress' token.
  virtual void run(const std::vector<float>& padded, const std::array<int, 3>& block,
                   std::vector<float>& result, const core::Progress& progress) = 0;
};

/// In double, on all cores; twin of kernels/adaptive_filter.cl.
std::unique_ptr<Engine> make_reference_engine(const Design& design, const Remap& remap);
/// lanes: voxels of a work-item, 1, 4, 8 or 16; 0 takes what suits the device.
std::unique_ptr<Engine> make_opencl_engine(const compute::Device& device, const Design& design,
                                           const Remap& remap, int lanes = 0);

/// Which engine, and the largest block with its margins that it is given.
struct Work {
  std::optional<compute::Device> device;  ///< none: the CPU twin
  int lanes = 0;
  double largest_block_voxels = 4.0e6;
};
core::Volume run(const core::Volume& volume, const AdaptiveParameters& parameters,
                 const core::IntensityRange& scan, const Work& work, const core::Progress& progress);

}  // namespace palpate::imaging::adaptive
