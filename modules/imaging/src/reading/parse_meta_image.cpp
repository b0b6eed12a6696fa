#include "meta_header.hpp"
#include "orientation.hpp"
#include "settle.hpp"
#include "text_header.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::imaging::reading {
namespace {

namespace fs = std::filesystem;
using core::Provenance;

/// What the header says of the axes, before it is made to fit together.
struct Place {
  Eigen::Vector3d spacing = Eigen::Vector3d::Ones();
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();
  double fourth_spacing = 0.0;
};

void take_spacing(const MetaHeader& header, const fs::path& path, std::size_t axes, bool tracked,
                  Place& place, core::VolumeInfo& info) {
  // The size of an element is that of what was measured; the spacing is where the next one is.
  const std::string key = header.first_of({"ElementSpacing", "ElementSize"});
  const auto spacing = numbers_of(header, path, key, axes);
  if (std::any_of(spacing.begin(), spacing.end(), [](double value) { return !(value > 0.0); }))
    fail("bad-header", path,
         "says " + key + " = " + header.at(key).substr(0, 60) + "; positive numbers are needed.");
  const std::size_t in_space = std::min<std::size_t>(axes, tracked && axes == 3 ? 2 : 3);
  // Tracked sequences write 1 1 1, their image being in pixels: that is no statement.
  const bool ones =
      tracked && std::all_of(spacing.begin(), spacing.end(), [](double value) { return value == 1.0; });
  info.spacing_provenance.fill(Provenance::assumed);
  if (spacing.empty() || ones) return;
  const std::string unit = header.at("DistanceUnits");
  const auto factor = unit.empty() || unit == "?" ? std::optional<double>(1.0) : millimetres_in(unit);
  if (!factor)
    warn(info, "unknown-unit",
         "Its unit of length, \"" + unit.substr(0, 20) + "\", is not known; mm was taken.");
  for (std::size_t axis = 0; axis < in_space; ++axis) {
    place.spacing[static_cast<Eigen::Index>(axis)] = spacing[axis] * factor.value_or(1.0);
    info.spacing_provenance[axis] = factor == 1.0 ? Provenance::stated : Provenance::derived;
  }
  if (axes == 4 && spacing.size() >= 4) place.fourth_spacing = spacing[3];
}

/// The letters of AnatomicalOrientation are read in two ways: where an axis
/// comes from, as ITK writes them, and where it points to, as the format's
/// description has it. Only the matrix is clear.
void take_letters(const MetaHeader& header, bool matrix, Place& place, core::VolumeInfo& info) {
  const std::string letters = header.at("AnatomicalOrientation");
  std::string opposite;
  for (const char letter : letters) {
    static const std::string pairs = "LRPASI";
    const auto at = pairs.find(letter);
    if (at == std::string::npos) return;
    opposite.push_back(pairs[at ^ 1U]);
  }
  Eigen::Matrix3d comes_from;
  Eigen::Matrix3d points_to;
  try {
    points_to = axes_of(letters);
    comes_from = axes_of(opposite);
  } catch (const core::Error&) {
    return;  // "???" and the like say nothing
  }
  if (!matrix) {
    place.direction = comes_from;
    info.direction_provenance = Provenance::derived;
    info.orientation_choices = {opposite, letters};
    warn(info, "orientation-ambiguous",
         "The axes are only named (AnatomicalOrientation = " + letters +
             "), which programs read in two ways; " + opposite + " was taken.");
    return;
  }
  const auto fits = [&](const Eigen::Matrix3d& axes) {
    for (int axis = 0; axis < 3; ++axis)
      if (axes.col(axis).dot(place.direction.col(axis)) <= 0.0) return false;
    return true;
  };
  if (!fits(comes_from) && !fits(points_to))
    warn(info, "orientation-contradiction",
         "TransformMatrix and AnatomicalOrientation = " + letters + " do not agree; the matrix was taken.");
}

void take_origin_and_axes(const MetaHeader& header, const fs::path& path, std::size_t axes, bool tracked,
                          Place& place, core::VolumeInfo& info) {
  const std::string offset_key = header.first_of({"Offset", "Origin", "Position"});
  const std::string matrix_key = header.first_of({"TransformMatrix", "Rotation", "Orientation"});
  const auto offset = numbers_of(header, path, offset_key, axes);
  const auto matrix = numbers_of(header, path, matrix_key, axes * axes);
  const std::size_t in_space = std::min<std::size_t>(axes, 3);
  const double factor = millimetres_in(header.at("DistanceUnits")).value_or(1.0);
  for (std::size_t axis = 0; axis < in_space && !offset.empty(); ++axis)
    place.origin[static_cast<Eigen::Index>(axis)] = offset[axis] * factor;
  // Each row of the matrix is an axis.
  for (std::size_t axis = 0; axis < in_space && !matrix.empty(); ++axis)
    for (std::size_t lps = 0; lps < in_space; ++lps)
      place.direction(static_cast<Eigen::Index>(lps), static_cast<Eigen::Index>(axis)) =
          matrix[axis * axes + lps];
  // A tracked picture lies in its own pixels; where it was in space is said frame by frame.
  const bool in_pixels = tracked && info.spacing_provenance[0] == Provenance::assumed;
  if (!offset.empty() && !in_pixels)
    info.origin_provenance = factor == 1.0 ? Provenance::stated : Provenance::derived;
  if (!matrix.empty() && !in_pixels) info.direction_provenance = Provenance::stated;
  if (!in_pixels && in_space == 3) take_letters(header, !matrix.empty(), place, info);
}

void take_times(const MetaHeader& header, bool tracked, double fourth_spacing, core::VolumeInfo& info) {
  if (tracked) info.frame_times_s = tracked_times(header, info.frames);
  if (!info.frame_times_s.empty()) {
    info.time_provenance = Provenance::stated;
    if (!std::is_sorted(info.frame_times_s.begin(), info.frame_times_s.end()))
      warn(info, "unordered-times", "The times of the frames do not rise; they are as the file says.");
  } else if (fourth_spacing != 1.0) {
    // One is what writers put where no time is known.
    set_even_times(fourth_spacing, info);
  }
}

}  // namespace

Parsed parse_meta_image(const fs::path& path, const Context& context) {
  const MetaHeader header = read_meta_header(path);
  const std::size_t axes = words_of(header.at("DimSize")).size();
  const bool tracked = is_tracked(header);
  RawImage image = raw_image_of(header, path, tracked && axes == 3);
  const auto slope = number(header.at("ElementToIntensityFunctionSlope"));
  const auto intercept = number(header.at("ElementToIntensityFunctionOffset"));
  if (slope && std::isfinite(*slope) && *slope != 0.0) image.slope = *slope;
  if (intercept && std::isfinite(*intercept)) image.intercept = *intercept;

  core::VolumeInfo info;
  info.format = "MetaImage";
  info.frames = frames_of(path, image);
  Place place;
  take_spacing(header, path, axes, tracked, place, info);
  take_origin_and_axes(header, path, axes, tracked, place, info);
  take_times(header, tracked, place.fourth_spacing, info);
  if (orientation_given(context.options)) place.direction = axes_of(context.options.orientation);
  info.geometry = make_geometry(path, dims_of(image), place.spacing, place.origin, place.direction, info);
  return read_raw(path, image, std::move(info), context);
}

}  // namespace palpate::imaging::reading
