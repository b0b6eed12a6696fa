#pragma once

#include "grey.hpp"
#include "parsed.hpp"

#include <itkImageIOBase.h>

#include <vector>

namespace palpate::imaging::reading {

/// What the format's own header says beyond what ITK makes of it.
struct Layout {
  bool k_is_time = false;              ///< the third axis counts frames: dims k = 1
  bool components_are_frames = false;  ///< a list axis that ITK took for the components
  bool colour = true;                  ///< three or four components are a colour
  std::vector<double> frame_times_s;   ///< where stated
  double frame_spacing_s = 0.0;        ///< else frame n is at n times this, where > 0
};

/// Reads through an ITK reader whose header was found sound: sizes, geometry,
/// voxels. `info` comes with format, provenances and warnings filled in.
Parsed read_through(itk::ImageIOBase& io, const std::filesystem::path& path, core::VolumeInfo info,
                    const Layout& layout, const Context& context);

/// Geometry out of loose numbers: unit columns, and a warning where the axes
/// are not at right angles. Throws Error(input, "bad-header").
core::ImageGeometry make_geometry(const std::filesystem::path& path, std::array<int, 3> dims,
                                  Eigen::Vector3d spacing_mm, const Eigen::Vector3d& origin_mm,
                                  Eigen::Matrix3d direction, core::VolumeInfo& info);

/// The user's spacing and orientation in place of the file's, and the warnings
/// about assumed or implausible ones. To be called last.
void settle_geometry(const ReadOptions& options, core::VolumeInfo& info);

/// ITK's own words without its pointers and file names.
std::string plain_words(const std::string& itk_text);

}  // namespace palpate::imaging::reading
