#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"
#include "palpate/model/tissue.hpp"

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>

namespace palpate::model {

enum class LinkRule {
  six,        ///< the axis neighbours that exist (thesis 3.1)
  nearest,    ///< mutual n-nearest: linked when each is among the other's n (thesis 3.1)
  lattice18,  ///< the neighbours one voxel away along one or two axes (the mapping paper)
  lattice26   ///< those along three axes too
};
enum class PointRule {
  lattice,    ///< a point a voxel, shifted by the noise (thesis 3.1)
  blue_noise  ///< points spread evenly without a lattice, as many on average; links by `nearest` only
};

/// Half-open voxel ranges; a scan's `--crop I0:I1,J0:J1,K0:K1`.
struct CropBox {
  std::array<int, 3> begin{0, 0, 0};
  std::array<int, 3> end{0, 0, 0};
};

/// The tissue step of a recipe.
struct TissueParameters {
  std::optional<double> threshold_low;  ///< Otsu's where absent
  double threshold_high = std::numeric_limits<double>::infinity();
  std::optional<CropBox> crop;  ///< clipped to the volume
  int stride = 1;               ///< every n-th voxel along each axis, from the crop's first
  double noise = 0.1;           ///< A: uniform in [-A, A] times the point spacing of each axis; 0..0.5
  std::uint64_t seed = 1;
  PointRule points = PointRule::lattice;
  LinkRule links = LinkRule::nearest;
  int max_links = 12;             ///< n; ignored for six. 1..64
  std::size_t min_component = 1;  ///< components with fewer points are dropped
  /// Tissue is where this label image, by its own geometry, is `mask_label` (or
  /// anything but 0), see MaskLookup; the threshold then counts only where it
  /// is given.
  std::shared_ptr<const core::Volume> mask;
  std::optional<int> mask_label;
};

/// Otsu's threshold over 256 bins of the finite range: the value at which the
/// between-class variance is largest. A constant volume gives that constant.
double otsu_threshold(const core::Volume& volume, const std::optional<CropBox>& crop = std::nullopt);

/// Points, links, rest lengths. The same parameters and volume give the same
/// tissue on every machine and with any number of threads: noise comes from a
/// counter-based generator keyed by seed and voxel. Ties between equal
/// distances are broken by voxel index. Uses all cores.
/// Throws Error(usage) for parameters out of range, Error(input, "no-tissue")
/// when no voxel lies in the range (naming the range of the volume),
/// Error(input, "mask-outside") and Error(input, "mask-empty") for a mask that
/// lies elsewhere or marks nothing here, Error(cancelled).
Tissue generate(const core::Volume& volume, const TissueParameters& parameters,
                const core::Progress& progress = {});

/// Only the second half of generate(): links among given points, by their
/// positions alone (voxels may be empty). Ties are broken by the point's
/// number. The spacing says how fine the search is and does not change the
/// result. generate() itself compares distances in the lattice, before they
/// are rounded to positions, so that equal steps of the lattice are ties.
LinkGraph link_nearest(const PointCloud& points, const Eigen::Vector3d& point_spacing_mm, int max_links,
                       const core::Progress& progress = {});

/// What generate() would make, without keeping it: `points` is exact. Links,
/// bytes and bounds are scaled up from the exact link lists of points sampled
/// all over the tissue; components are those of the touching voxels. Takes well
/// under a tenth of generate(), but as long as it where min_component > 1 and
/// links are `nearest`: which points stay is then known only from all links,
/// and components are exact too. Throws as generate() does.
struct TissueEstimate {
  TissueStatistics statistics;
  Tissue sample;        ///< the densest block, built, for a stable-step estimate
  bool sampled = true;  ///< false when the whole tissue was small enough to be built
};
TissueEstimate estimate(const core::Volume& volume, const TissueParameters& parameters,
                        const core::Progress& progress = {});

}  // namespace palpate::model
