#pragma once

#include "palpate/core/volume.hpp"
#include "palpate/imaging/reader.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <filesystem>

namespace palpate::imaging::reading {

/// Makes a usable geometry of what a file says. Axes that are nearly at right
/// angles are taken to the nearest that are ("repaired-direction"); slices that
/// are slanted against their own plane stay slanted ("sheared-axes"), as the
/// scanner placed them; both warnings show the numbers. Throws Error(input,
/// "bad-header") for anything else, the numbers shown.
core::ImageGeometry make_geometry(const std::filesystem::path& path, std::array<int, 3> dims,
                                  Eigen::Vector3d spacing_mm, const Eigen::Vector3d& origin_mm,
                                  Eigen::Matrix3d direction, core::VolumeInfo& info);

/// Replaces voxels that are no number by the smallest that is one, and says so
/// in the warnings; also warns where whole numbers do not fit 24 bits. Throws
/// where no voxel is finite.
void make_finite(const std::filesystem::path& path, float* voxels, std::size_t count, core::VolumeInfo& info);

/// The user's spacing and orientation in place of the file's, and the warnings
/// about assumed or implausible ones. To be called last.
void settle_geometry(const ReadOptions& options, core::VolumeInfo& info);

/// Times of evenly spaced frames, and a warning where one lasts longer than any
/// recording's. Nothing for a single frame or an unusable step.
void set_even_times(double step_s, core::VolumeInfo& info);
/// Whether the user says where the axes point, so that the file need not.
bool orientation_given(const ReadOptions& options);

/// That colour became grey, and how.
void warn_of_colour(core::VolumeInfo& info);

}  // namespace palpate::imaging::reading
