#pragma once

#include "../dicom_calibration.hpp"
#include "../dicom_file.hpp"
#include "../parsed.hpp"

#include "palpate/core/volume.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// A volume whose geometry stands in a vendor's own tags, while its voxels are
/// plain slices. Tags are matched by their private creator.
struct VendorGrid {
  std::string kind;  ///< "Philips QLAB Cartesian"
  std::array<int, 3> dims{1, 1, 1};
  int frames = 1;
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  std::array<core::Provenance, 3> spacing_provenance{core::Provenance::assumed, core::Provenance::assumed,
                                                     core::Provenance::assumed};
  std::optional<Eigen::Vector3d> origin_mm;  ///< by the vendor's convention, along i, j, k
  std::vector<std::string> orientations;     ///< in use for such files, the one to take first
  /// 8-bit slices one after another in the pixel value, more than its number of
  /// frames; else every frame of the file is a slice.
  bool raw_slices = false;
  CineTimes times;
  std::vector<core::Warning> warnings;
};

/// None where the file is of no such kind. Throws Error(input, "unsupported")
/// for one that is but lacks what it needs.
std::optional<VendorGrid> vendor_grid(const DicomFile& file);

/// "Philips Medical Systems EPIQ 7C": manufacturer and model, each word once.
std::string scanner_of(const DicomItem& dataset);

/// What of a file's private data cannot be shown beside a picture that can: a
/// sentence for the user, or empty.
std::string unread_volume(const DicomFile& file);

/// The honest end for a file whose voxels stand in private data only; returns
/// where there is none. Names file, SOP class, scanner and private creators.
void refuse_private_only(const DicomFile& file);

/// The warning of where the axes point and how to choose.
void say_orientation(const std::string& kind, const ReadOptions& options, core::VolumeInfo& info);

}  // namespace palpate::imaging::reading
