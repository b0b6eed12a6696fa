#include "settle.hpp"

#include "orientation.hpp"
#include "parsed.hpp"
#include "text_header.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace palpate::imaging::reading {
namespace {

constexpr double header_digits = 1e-3;   // headers carry as few as four digits of a cosine
constexpr double repairable_skew = 0.1;  // cosine of the angle between two axes: 6 degrees off
constexpr double least_volume = 1e-3;    // of the box that three unit vectors span: they lie in one plane

/// Row by row, as a header would give it.
std::string text_of(const Eigen::Matrix3d& matrix) {
  std::ostringstream text;
  text.precision(6);
  for (int row = 0; row < 3; ++row)
    text << (row == 0 ? "" : "; ") << matrix(row, 0) << " " << matrix(row, 1) << " " << matrix(row, 2);
  return text.str();
}

void make_unit_columns(const std::filesystem::path& path, Eigen::Matrix3d& direction,
                       core::VolumeInfo& info) {
  const Eigen::Matrix3d said = direction;
  bool scaled = false;
  for (int axis = 0; axis < 3; ++axis) {
    const double length = direction.col(axis).norm();
    if (!std::isfinite(length) || length < std::numeric_limits<double>::min())
      fail("bad-header", path,
           "has an unusable direction matrix (" + text_of(said) +
               "). Nothing was guessed: say where its axes point with --orientation, for instance LPS.");
    scaled = scaled || std::abs(length - 1.0) > header_digits;
    direction.col(axis) = (direction.col(axis) / length).array() + 0.0;  // no negative zeros
  }
  if (scaled)
    warn(info, "repaired-direction",
         "The directions in the file are no unit vectors (" + text_of(said) + "); they were scaled to (" +
             text_of(direction) + "), the spacing was kept.");
}

/// The nearest matrix of axes at right angles, which may be left-handed as the file's.
Eigen::Matrix3d nearest_orthogonal(const Eigen::Matrix3d& direction) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> parts(direction, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return parts.matrixU() * parts.matrixV().transpose();
}

}  // namespace

core::ImageGeometry make_geometry(const std::filesystem::path& path, std::array<int, 3> dims,
                                  Eigen::Vector3d spacing_mm, const Eigen::Vector3d& origin_mm,
                                  Eigen::Matrix3d direction, core::VolumeInfo& info) {
  make_unit_columns(path, direction, info);
  const Eigen::Matrix3d said = direction;
  const Eigen::Matrix3d skew = (direction.transpose() * direction - Eigen::Matrix3d::Identity()).cwiseAbs();
  const bool told = std::any_of(info.warnings.begin(), info.warnings.end(),
                                [](const core::Warning& warning) { return warning.code == "gantry-tilt"; });
  const bool slanted = skew(0, 1) <= header_digits;
  if (std::abs(direction.determinant()) < least_volume)
    fail("bad-header", path,
         "has axes that lie in one plane (direction matrix " + text_of(said) +
             "). Nothing was guessed: say where its axes point with --orientation, for instance LPS.");
  if (!told && skew.maxCoeff() > header_digits) {
    if (slanted) {
      warn(info, "sheared-axes",
           "The slices are slanted against their own plane (direction matrix " + text_of(said) +
               "); the voxels are placed as the file says.");
    } else if (skew.maxCoeff() <= repairable_skew) {
      direction = nearest_orthogonal(direction).array() + 0.0;
      warn(info, "repaired-direction",
           "The image axes are not at right angles (direction matrix " + text_of(said) +
               "); the nearest that are were taken (" + text_of(direction) + ").");
    } else {
      fail(
          "bad-header", path,
          "has axes that are not at right angles (direction matrix " + text_of(said) +
              "), which no scanner writes. Nothing was guessed: say where its axes point with --orientation, "
              "for instance LPS, or export the scan without a transform.");
    }
  }
  try {
    return core::ImageGeometry(dims, spacing_mm, origin_mm, direction);
  } catch (const core::Error& error) {
    fail("bad-header", path, error.what());
  }
}

void make_finite(const std::filesystem::path& path, float* voxels, std::size_t count,
                 core::VolumeInfo& info) {
  float low = std::numeric_limits<float>::infinity();
  float largest = 0.0F;
  std::size_t wrong = 0;
  for (std::size_t n = 0; n < count; ++n) {
    if (!std::isfinite(voxels[n])) {
      ++wrong;
      continue;
    }
    low = std::min(low, voxels[n]);
    largest = std::max(largest, std::abs(voxels[n]));
  }
  if (wrong == count) fail("no-image", path, "holds no voxel that is a number. Export the scan again.");
  constexpr float whole_numbers_up_to = 16777216.0F;  // 2^24, the last that a float counts to by ones
  if (largest > whole_numbers_up_to && info.pixel_type.find("int") != std::string::npos)
    warn(info, "rounded-values", "Some values are over 16777216 and were rounded to 24 bits.");
  if (wrong == 0) return;
  for (std::size_t n = 0; n < count; ++n)
    if (!std::isfinite(voxels[n])) voxels[n] = low;
  warn(info, "non-finite-voxels",
       std::to_string(wrong) + " of " + std::to_string(count) +
           " voxels are no finite numbers; they were set to the smallest value that is one.");
}

void settle_geometry(const ReadOptions& options, core::VolumeInfo& info) {
  settle_orientation(options, info);
  const core::ImageGeometry& read = info.geometry;
  if (options.spacing_mm) {
    const auto& user = *options.spacing_mm;
    const core::ImageGeometry stated(read.dims(), Eigen::Vector3d(user[0], user[1], user[2]),
                                     read.origin_mm(), read.direction());
    info.geometry = stated;
    info.spacing_provenance.fill(core::Provenance::user);
    return;
  }
  bool assumed = false;
  double largest = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto provenance = info.spacing_provenance[axis];
    const bool made_up = provenance == core::Provenance::assumed || provenance == core::Provenance::absent;
    // The spacing across a single slice matters to nobody.
    if (made_up && (axis < 2 || read.dims()[2] > 1)) assumed = true;
    if (read.dims()[axis] > 1)
      largest = std::max(largest, read.dims()[axis] * read.spacing_mm()[static_cast<Eigen::Index>(axis)]);
  }
  if (assumed) {
    warn(info, "assumed-spacing",
         "The file does not say how large a voxel is; 1 mm was assumed. Lengths are in voxels until a "
         "spacing is "
         "given.");
  } else if (largest > 0.0 && (largest < 5.0 || largest > 3000.0)) {
    std::ostringstream text;
    text << "The image is " << largest
         << " mm long by its header, which no patient is; the unit may not be mm.";
    warn(info, "implausible-spacing", text.str());
  }
}

bool orientation_given(const ReadOptions& options) {
  return !options.orientation.empty() && lower_case(options.orientation) != "file";
}

void set_even_times(double step_s, core::VolumeInfo& info) {
  if (info.frames < 2 || !std::isfinite(step_s) || !(step_s > 0.0)) return;
  for (int frame = 0; frame < info.frames; ++frame) info.frame_times_s.push_back(frame * step_s);
  info.time_provenance = core::Provenance::stated;
  constexpr double longest_s = 10.0;
  if (step_s > longest_s) {
    std::ostringstream text;
    text << "By its header a frame lasts " << step_s << " s; the file may mean milliseconds.";
    warn(info, "implausible-time", text.str());
  }
}

void warn_of_colour(core::VolumeInfo& info) {
  warn(info, "colour-to-grey", "Colour was turned to grey by Rec. 601 luma: 0.299 R + 0.587 G + 0.114 B.");
}

}  // namespace palpate::imaging::reading
