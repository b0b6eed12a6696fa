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
/// target and renamed over it. Throws Error(usage) for another ending,
/// Error(output) naming the reason (no such folder, disk full, no permission).
void write(const std::filesystem::path& path, const std::vector<core::Volume>& frames,
           double frame_spacing_s = 0.0, const WriteOptions& options = {}, const core::Progress& progress = {});

/// The volume as a DICOM series, one file a slice, into a folder that is made.
void write_dicom_series(const std::filesystem::path& folder, const core::Volume& volume,
                        const core::Progress& progress = {});

}  // namespace palpate::imaging
