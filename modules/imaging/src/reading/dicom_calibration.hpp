#pragma once

#include "dicom_file.hpp"

#include "palpate/core/volume.hpp"

#include <array>
#include <optional>
#include <vector>

namespace palpate::imaging::reading {

/// Whether a voxel can be that large: from a nanometre to a metre. Anything
/// else is no size, and no NaN is.
bool is_voxel_size(double mm);

/// What a header says of the size of a pixel, and how far it may be believed.
///
/// The calibration of ultrasound regions is that of the tissue that is drawn
/// there, and the only one that PS3.3 gives to ultrasound (C.8.5.5), so it wins
/// over Pixel Spacing where both are there; a warning tells of a difference.
/// Regions of different scale leave no size that holds for the whole picture,
/// whatever else is stated. Imager Pixel Spacing and Nominal Scanned Pixel
/// Spacing are sizes at the detector and on the film: derived, not stated.
struct Calibration {
  std::optional<std::array<double, 2>> pixel_mm;  ///< along i and j
  core::Provenance provenance = core::Provenance::assumed;
  std::vector<core::Warning> warnings;
};
Calibration calibrate(const DicomItem& dataset);

/// When the frames of a cine are, in seconds from the first (PS3.3 C.7.6.5).
struct CineTimes {
  std::vector<double> frame_times_s;  ///< one a frame, or none
  core::Provenance provenance = core::Provenance::absent;
  std::vector<core::Warning> warnings;
};
CineTimes cine_times(const DicomItem& dataset, int frames);

}  // namespace palpate::imaging::reading
