#pragma once

#include "palpate/imaging/adaptive.hpp"

#include <Eigen/Core>

#include <array>
#include <vector>

namespace palpate::imaging::adaptive {

/// Half of a kernel's taps; the other half follows from its symmetry.
using Tap = std::array<int, 3>;
/// Rows: taps. Columns: filters.
using Weights = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>;
using Six = Eigen::Matrix<double, 1, 6>;
/// Odd length, symmetric, sums to one; {1} leaves things as they are.
using BlurKernel = std::vector<double>;
using Blur = std::array<BlurKernel, 3>;  ///< along i, j, k

inline int radius_of(const BlurKernel& kernel) { return static_cast<int>(kernel.size() / 2); }

/// The six directions through opposite corners of an icosahedron.
const std::array<Eigen::Vector3d, 6>& directions();
/// The dual tensor of direction k, 5/4 n nT - 1/4 I, as xx yy zz xy xz yz.
std::array<double, 6> dual_tensor(const Eigen::Vector3d& direction);

/// One level of the highpass network: the level before, blurred further, and
/// the six responses that 3x3x3 taps make of it. The centre weighs minus the sum
/// of the rest, so that a constant gives zero to the last bit but rounding.
struct Level {
  Blur blur;
  Weights weights;
};

/// Every kernel of one pass.
struct Design {
  std::array<bool, 3> flat{};  ///< axes of one voxel: no kernel extends there
  double scale_mm = 0.0;       ///< s, the lowpass filter's standard deviation
  // Quadrature filters: a blur, then 7x7x7 taps `step` voxels apart.
  Blur quadrature_blur;
  std::array<int, 3> step{1, 1, 1};
  std::vector<Tap> quadrature_taps;  ///< in steps
  Weights even, odd;
  Six even_centre = Six::Zero();
  Blur tensor_blur;
  // Highpass filters: u_i u_j H(rho) as xx yy zz xy xz yz.
  std::vector<Tap> highpass_taps;
  std::vector<Level> levels;
  /// Divides |T| so that an ideal step of height 1 gives 1 before T is smoothed.
  double step_response = 1.0;
  AdaptiveFit fit;

  /// Voxels that one pass looks away from the one it computes.
  std::array<int, 3> margin() const;
  /// That the tensor's smoothing needs on every side, and the taps before it.
  std::array<int, 3> tensor_margin() const;
  std::array<int, 3> quadrature_margin() const;
  /// That level n needs on every side of the result, its taps included.
  std::array<int, 3> level_margin(std::size_t level) const;
};

/// Everything but the weights, which take a tenth of a second to fit: enough for the margins.
Design layout(const core::ImageGeometry& geometry, const AdaptiveParameters& parameters);
Design design(const core::ImageGeometry& geometry, const AdaptiveParameters& parameters);

}  // namespace palpate::imaging::adaptive
