#pragma once

#include "parsed.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// Where one frame lies: the centre of its first pixel and its unit axes, LPS mm.
struct DicomPlane {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d row = Eigen::Vector3d::UnitX();     ///< of rising column number
  Eigen::Vector3d column = Eigen::Vector3d::UnitY();  ///< of rising row number
  std::optional<double> time_s;
};

/// What the frames of a file with several are to each other.
enum class FrameMeaning { time, placed, unplaced_slices };

/// The tags of one DICOM file that matter here, read without its pixels.
struct DicomHeader {
  std::filesystem::path path;
  std::string sop_class, modality, series_uid, instance_uid, transfer_syntax;
  int rows = 0, columns = 0, frames = 1, samples = 1, bits = 0, instance = 0;
  bool is_signed = false, native = true, big_endian = false, has_pixels = false, inverted = false;
  std::array<std::optional<double>, 3> spacing_mm;                  ///< i, j, k
  core::Provenance spacing_provenance = core::Provenance::assumed;  ///< of i and j
  std::vector<DicomPlane> planes;  ///< one a frame, or none where the file does not say
  bool transducer_axes = false;    ///< planes are in the probe's system, not the patient's
  FrameMeaning meaning = FrameMeaning::time;
  std::vector<double> frame_times_s;
  core::Provenance time_provenance = core::Provenance::absent;
  std::vector<core::Warning> warnings;
  std::optional<std::uint64_t> pixel_bytes;  ///< really in the file, of native transfer syntaxes
};

/// Throws Error(input): "unsupported" where it is no DICOM, "bad-header".
DicomHeader read_dicom_header(const std::filesystem::path& path);

}  // namespace palpate::imaging::reading
