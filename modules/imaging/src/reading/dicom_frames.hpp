#pragma once

#include "dicom_file.hpp"

#include "palpate/core/volume.hpp"

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// Where one frame lies: the centre of its first pixel and its unit axes, mm.
struct FramePlane {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d row = Eigen::Vector3d::UnitX();     ///< of rising column number
  Eigen::Vector3d column = Eigen::Vector3d::UnitY();  ///< of rising row number
  Eigen::Vector3d normal() const;
};

/// What a file says of when a frame was taken, and of what else may tell
/// frames of one place apart.
struct FrameClock {
  std::optional<double> temporal_index;
  std::optional<double> offset_s;    ///< from the start, as the file states it
  std::optional<double> trigger_s;   ///< after the R peak
  std::optional<double> acquired_s;  ///< by the clock on the wall
  std::optional<double> content_s;   ///< when the picture was made, by the clock
  std::optional<double> acquisition, instance;
  std::map<std::string, double> contrasts;  ///< "echo time", "b-value", ...: no times
  std::string image_type;
};

/// One frame of one file, without its pixels.
struct FrameRecord {
  std::size_t file = 0;
  int file_frame = 0;
  std::string name;  ///< of the file, for messages
  int columns = 0, rows = 0;
  std::optional<std::array<double, 2>> pixel_mm;  ///< along i and j
  std::optional<FramePlane> plane;
  std::optional<double> in_stack;  ///< its number among the slices of one time
  std::string part;                ///< "stack 2", "segment 1": never of one volume with another
  std::string data_type;           ///< "TISSUE_INTENSITY", ... of ultrasound volumes
  FrameClock clock;
};

/// What the frames of a file with several are to each other.
enum class FrameRole { time, placed, unplaced_slices };

/// All that one file says of its frames.
struct FileFrames {
  std::vector<FrameRecord> records;  ///< in the file's order
  FrameRole role = FrameRole::time;
  bool transducer_axes = false;       ///< planes are in the probe's system, not the patient's
  std::optional<double> between_mm;   ///< stated distance of the slices' centres
  std::optional<double> repaired_by;  ///< how far axes were from right angles and unit length
  std::vector<core::Warning> warnings;
};

/// The plane of six cosines and three millimetres. None where they are absent
/// or all zero; `repaired_by` grows to how far the axes were off where that
/// can be mended. Where it cannot, none if `lenient`; else throws Error(input,
/// "bad-header") with the numbers.
std::optional<FramePlane> plane_of(const std::filesystem::path& path, const std::vector<double>& position,
                                   const std::vector<double>& orientation, bool lenient,
                                   std::optional<double>& repaired_by);

/// Reads classic headers and functional groups alike. `frames` is their number;
/// `lenient` where the user says how the axes lie.
FileFrames read_frames(const DicomItem& dataset, const std::filesystem::path& path, int columns, int rows,
                       int frames, bool lenient);

}  // namespace palpate::imaging::reading
