#pragma once

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/dicom_scans.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

// What the tests of DICOM geometry ask of a scan that was read.
namespace palpate::testing {

using Dims = std::array<int, 3>;
using Times = std::vector<double>;

inline constexpr Tag frame_time{0x0018, 0x1063}, frame_time_vector{0x0018, 0x1065}, cine_rate{0x0018, 0x0040};
inline constexpr Tag trigger_time{0x0018, 0x1060}, acquisition_time{0x0008, 0x0032},
    echo_time{0x0018, 0x0081}, temporal_position{0x0020, 0x0100};

inline bool warned(const core::VolumeInfo& info, const std::string& code) {
  return std::any_of(info.warnings.begin(), info.warnings.end(),
                     [&](const auto& warning) { return warning.code == code; });
}
inline std::string warning_text(const core::VolumeInfo& info, const std::string& code) {
  for (const auto& warning : info.warnings)
    if (warning.code == code) return warning.text;
  return "no such warning";
}
/// A step between voxel centres, in LPS mm.
inline Eigen::Vector3d step(const core::VolumeInfo& info, int axis) {
  return info.geometry.to_lps_mm(Eigen::Vector3d::Unit(axis)) -
         info.geometry.to_lps_mm(Eigen::Vector3d::Zero());
}
/// The code and text of the error, which names the path; "none" where it opens.
inline std::string refusal_of(const std::filesystem::path& path, const imaging::ReadOptions& options = {},
                              std::string* details = nullptr) {
  try {
    imaging::read(path, options);
  } catch (const core::Error& error) {
    EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos) << error.what();
    if (details != nullptr) *details = error.details();
    return error.code() + ": " + error.what();
  }
  return "none";
}

}  // namespace palpate::testing
