#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace palpate::imaging::reading {

/// What a NIfTI-1 or NIfTI-2 header says, in the words of the standard.
struct NiftiHeader {
  int version = 1;
  bool big_endian = false;
  bool single_file = true;  ///< the voxels are in the same file
  std::array<long long, 8> dim{};
  std::array<double, 8> pixdim{};
  int datatype = 0, bitpix = 0;
  double vox_offset = 0.0;  ///< in bytes
  double scl_slope = 0.0, scl_inter = 0.0;
  int qform_code = 0, sform_code = 0;
  std::array<double, 3> quatern{};
  Eigen::Vector3d qoffset = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 4> srow = Eigen::Matrix<double, 3, 4>::Zero();
  int xyzt_units = 0, intent_code = 0;
};

/// Of the first bytes of a file, 540 or as many as there are. Throws
/// Error(input): "truncated", "unsupported" (Analyze), "bad-header".
NiftiHeader nifti_header_of(const std::string& bytes, const std::filesystem::path& path);

/// From voxel to millimetres right, anterior, superior by the quaternion.
Eigen::Matrix<double, 3, 4> qform_of(const NiftiHeader& header, const Eigen::Vector3d& spacing);

}  // namespace palpate::imaging::reading
