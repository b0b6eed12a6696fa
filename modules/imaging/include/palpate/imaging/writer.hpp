#pragma once

#include <filesystem>
#include <vector>

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

namespace palpate::imaging {

struct WriteOptions {
  std::string pixel_type = "float32";  ///< or "uint8": rounded and clamped
  bool compress = true;
};
/// By the ending: .mha, .mhd, .nrrd, .nii, .nii.gz. Several frames make a 4-D
/// file (the frame time is the fourth spacing, in s). Written beside its
/// target, read back, and renamed over it. Throws Error(usage) for another
/// ending, Error(output) naming the reason (no such folder, disk full, no
/// permission), Error(cancelled); nothing is left then.
void write(const std::filesystem::path& path, const std::vector<core::Volume>& frames,
           double frame_spacing_s = 0.0, const WriteOptions& options = {}, const core::Progress& progress = {});

/// The volume as a DICOM series, one file a slice, into a folder that is made
/// (an empty one is accepted). For synthetic volumes: the patient is
/// PHANTOM^LEFT VENTRICLE, the UIDs follow from the content. Whole numbers in
/// [0, 65535] come back exactly, others to 1/65535 of the volume's range.
/// MR Image Storage with modality US; src/writer_dicom.cpp says why.
/// Throws Error(output), Error(cancelled).
void write_dicom_series(const std::filesystem::path& folder, const core::Volume& volume,
                        const core::Progress& progress = {});

}  // namespace palpate::imaging
