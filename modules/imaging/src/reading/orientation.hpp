#pragma once

#include "palpate/core/volume.hpp"
#include "palpate/imaging/reader.hpp"

#include <Eigen/Core>

#include <string>

namespace palpate::imaging::reading {

/// Which of the patient's directions i, j and k point to most nearly: "LPS", "RAS", ...
std::string orientation_of(const core::ImageGeometry& geometry);
/// The unit axes for such a word, in LPS. Throws Error(usage) where it names no orientation.
Eigen::Matrix3d axes_of(const std::string& orientation);
/// The user's orientation in place of the file's, and whether letters may be
/// shown. To be called once the file has said everything.
void settle_orientation(const ReadOptions& options, core::VolumeInfo& info);

}  // namespace palpate::imaging::reading
