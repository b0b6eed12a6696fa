#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::imaging {

/// What a DICOM file says beside its voxels. Nothing of the scan's own header
/// is carried over: no name, date, place or UID of it, so a volume written
/// from an identified scan names nobody unless the caller does.
struct DicomNotes {
  std::string patient_name;  ///< "ANONYMOUS" where empty
  std::string patient_id;
  std::string derivation;         ///< what was done to the voxels, in words; empty where nothing was
  std::string content_date_time;  ///< "20240131120000"; now where empty
  /// Whether the geometry lies in the patient. Where not, the file has a
  /// volume frame of reference only, and no reader can take its axes for the
  /// patient's.
  bool patient_axes = true;
};

struct WriteOptions {
  std::string pixel_type = "float32";  ///< or "uint8": rounded and clamped
  bool compress = true;                ///< not for DICOM
  /// One a frame, from the first one on, rising; takes the place of
  /// frame_spacing_s. Only DICOM holds times that are not evenly spaced; the
  /// others get the mean step.
  std::vector<double> frame_times_s;
  DicomNotes dicom;
};
/// By the ending: .mha, .mhd, .nrrd, .nii, .nii.gz, .dcm. Several frames make
/// a 4-D file (the frame time is the fourth spacing, in s). Written beside its
/// target, read back, and renamed over it. Throws Error(usage) for another
/// ending, Error(output) naming the reason (no such folder, disk full, no
/// permission), Error(cancelled); nothing is left then.
/// .dcm is one Enhanced US Volume (PS3.3 A.59): greys that are whole numbers
/// in [0, 65535] come back exactly, others to 1/65535 of the range of all
/// frames through the Real World Value Mapping. Axes that are not at right
/// angles are refused there.
void write(const std::filesystem::path& path, const std::vector<core::Volume>& frames,
           double frame_spacing_s = 0.0, const WriteOptions& options = {},
           const core::Progress& progress = {});

/// The volume as a DICOM series, one file a slice, into a folder that is made
/// (an empty one is accepted). For synthetic volumes: the patient is
/// PHANTOM^LEFT VENTRICLE, the UIDs follow from the content. Whole numbers in
/// [0, 65535] come back exactly, others to 1/65535 of the volume's range.
/// MR Image Storage with modality US; src/writer_dicom.cpp says why.
/// Throws Error(output), Error(cancelled).
void write_dicom_series(const std::filesystem::path& folder, const core::Volume& volume,
                        const core::Progress& progress = {});

}  // namespace palpate::imaging
