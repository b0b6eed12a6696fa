#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

#include <array>
#include <string>

namespace palpate::imaging {

/// The adaptive filter of Granlund and Knutsson: it smooths along what it
/// finds (walls, layers, vessels) and not across, and everywhere else in all
/// directions. Local and linear in amplitude: twice the grey gives twice the
/// result; where 0 stands for "no echo" is part of the picture.
struct AdaptiveParameters {
  /// An edge is kept when its step is larger than about this share of the
  /// brightness around it; weaker ones are taken for speckle.
  double contrast_percent = 45.0;
  /// Standard deviation of the smoothing where there is no structure, in the
  /// smallest spacing of the volume; other axes follow in millimetres.
  double scale_voxels = 2.0;
  /// Over how many scales around a voxel its structure is judged; more is
  /// steadier, less follows finer bends.
  double neighbourhood_scales = 1.0;
  /// How often the filter runs over its own result.
  int passes = 2;
  bool operator==(const AdaptiveParameters& other) const {
    return contrast_percent == other.contrast_percent && scale_voxels == other.scale_voxels &&
           neighbourhood_scales == other.neighbourhood_scales && passes == other.passes;
  }
};
/// The ranges that the filter accepts.
struct AdaptiveLimits {
  double low, high;
};
inline constexpr AdaptiveLimits adaptive_contrast_percent{1.0, 200.0};
inline constexpr AdaptiveLimits adaptive_scale_voxels{1.0, 6.0};
inline constexpr AdaptiveLimits adaptive_neighbourhood_scales{0.5, 2.0};
inline constexpr AdaptiveLimits adaptive_passes{1, 4};

/// How far the kernels are from the ideal responses: the root of the missed
/// share of energy, weighted as the fit was, below 0.7 of the Nyquist frequency.
struct AdaptiveFit {
  double quadrature_even = 0.0, quadrature_odd = 0.0;
  double highpass = 0.0;
};
AdaptiveFit adaptive_fit(const core::ImageGeometry& geometry, const AdaptiveParameters& parameters);

/// How many voxels away along i, j and k the farthest lies that a voxel of the
/// result depends on, all passes together. 0 along an axis of one voxel.
std::array<int, 3> adaptive_reach(const core::ImageGeometry& geometry, const AdaptiveParameters& parameters);

/// The filtered volume; the geometry is kept. At the border the outermost
/// voxels are taken to go on; an axis of one voxel is left out. `scan` is the
/// range of the whole scan, of which `volume` may be a slab: the result keeps to it.
/// device: as compute::open_device takes it; "reference", or no device and none
/// asked for, is the CPU twin. Works in blocks of at most 4 million voxels with
/// their margins: up to 0.4 GB beside the volume and its result. Reports
/// progress and stops within half a second when cancelled. Throws Error(usage)
/// for parameters outside their ranges, Error(device), Error(cancelled).
core::Volume adaptive_filter(const core::Volume& volume, const AdaptiveParameters& parameters,
                             const core::IntensityRange& scan, const std::string& device = {},
                             const core::Progress& progress = {});

/// Whether the twin on the host works because there is no device and none was asked for.
bool adaptive_lacks_device(const std::string& selector);

}  // namespace palpate::imaging
