#pragma once

#include "dicom_frames.hpp"

#include "palpate/core/volume.hpp"

#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// Where one frame goes: into slice k of a frame of the result, with a weight
/// that is 1 but for slices between two that the file has.
struct Placement {
  std::size_t record = 0;
  int frame = 0, k = 0;
  float weight = 1.0F;
};

/// The grid that the frames of one scan make.
struct Assembly {
  std::vector<Placement> placements;  ///< in the order of their records
  std::array<int, 3> dims{1, 1, 1};
  int frames = 1;
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();
};

/// Whether two frames hold the same pixels; asked for as few as can be.
using SamePixels = std::function<bool(const FrameRecord&, const FrameRecord&)>;

/// The frames in the order of their places and times: `at[frame][k]` is the
/// index of a record.
struct Numbered {
  std::vector<std::vector<std::size_t>> at;
  std::vector<double> along_mm;  ///< of every k, along the first record's normal
};

/// Sorts frames that lie in one direction along their normal, and frames of
/// one place by what tells them apart: time, or echoes and the like. Leaves
/// out copies and times that lack slices, with warnings; says the times in
/// `info`. Throws Error(input, "no-volume") where nothing tells them apart.
Numbered number_frames(const std::vector<FrameRecord>& records, const std::filesystem::path& shown,
                       const SamePixels& same_pixels, core::VolumeInfo& info);

/// The grid of frames that all have planes. `in_file_order`: slices of a single
/// file that only run backwards keep their order. Says spacing, origin,
/// direction, times and warnings in `info`; the spacing along i and j is that
/// of the records. Throws Error(input, "no-volume") naming what is there where
/// the frames are no single volume.
Assembly assemble_placed(std::vector<FrameRecord> records, const std::filesystem::path& shown,
                         bool in_file_order, const SamePixels& same_pixels, core::VolumeInfo& info);

/// Keeps the frames of one data type of an ultrasound volume, tissue where
/// there is some, and says what was left out.
void keep_one_data_type(std::vector<FrameRecord>& records, core::VolumeInfo& info);

}  // namespace palpate::imaging::reading
