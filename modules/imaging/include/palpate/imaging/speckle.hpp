#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

#include <array>

namespace palpate::imaging {

/// How grainy a scan is, measured without labels.
///
/// Where: the scan is cut into blocks (8 voxels a side; 16 in a picture, 64 in
/// a line; whole ones only). Otsu's threshold separates bright from dark; a
/// block shows tissue where its mean is at least half that threshold and at
/// most 2 % of its voxels stand at the scan's smallest or largest value (where
/// that leaves none, this last condition is dropped). Each is halved along its
/// axes; the share of its variance that lies between the parts' means says how
/// uneven it is. The quarter of the tissue blocks that is most even is taken:
/// that choice does not favour blocks of little speckle.
///
/// What: `mean` and `deviation` are the medians over those blocks of their
/// mean and standard deviation, `snr` = mean / deviation, `looks` = snr^2, the
/// equivalent number of looks. Fully developed speckle has an snr of 1.91 as
/// an envelope (Rayleigh) and 1 as an intensity (exponential); log compression,
/// averaging and filters raise it. Brightness counts from the scan's smallest
/// value where that is negative, else from 0.
///
/// `bright` and `dark` are the means above and below the threshold, `contrast`
/// = (bright - dark) / (bright + dark), `cnr` = (bright - dark) /
/// sqrt(variance above + variance below).
struct SpeckleStatistics {
  std::array<int, 3> block_voxels{0, 0, 0};
  int tissue_blocks = 0;
  int blocks = 0;  ///< that were measured; 0 where the scan has none, the rest of the first group is then 0
  double mean = 0.0, deviation = 0.0, snr = 0.0, looks = 0.0;
  double threshold = 0.0;
  double bright = 0.0, dark = 0.0, contrast = 0.0, cnr = 0.0;
};

SpeckleStatistics measure_speckle(const core::Volume& volume, const core::Progress& progress = {});
/// Of `filtered` at the places that `original` gives: the same blocks, and what
/// is bright and dark there. So the two can be compared.
/// Throws Error(internal) where the sizes differ.
SpeckleStatistics measure_speckle(const core::Volume& filtered, const core::Volume& original,
                                  const core::Progress& progress = {});

}  // namespace palpate::imaging
