// The grid that slices make: its third axis, tilt, gaps.
#include "dicom_assembly.hpp"

#include "parsed.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;

std::string listed(const std::vector<double>& numbers, const std::string& unit) {
  std::ostringstream text;
  constexpr std::size_t most = 12;
  for (std::size_t n = 0; n < numbers.size() && n < most; ++n)
    text << (n == 0 ? "" : ", ") << std::round(numbers[n] * 1e4) / 1e4;
  if (numbers.size() > most) text << ", ...";
  text << " " << unit;
  return text.str();
}

/// Frames that may be of one volume: alike in size, pixel, direction and part.
struct Kind {
  const FrameRecord* first = nullptr;
  std::size_t count = 0;
};

bool alike(const FrameRecord& a, const FrameRecord& b) {
  if (a.columns != b.columns || a.rows != b.rows || a.part != b.part) return false;
  constexpr double same_pixel = 1e-3;  // relative, of sizes written with few digits
  if (a.pixel_mm && b.pixel_mm)
    for (std::size_t axis = 0; axis < 2; ++axis)
      if (std::abs((*a.pixel_mm)[axis] / (*b.pixel_mm)[axis] - 1.0) > same_pixel) return false;
  constexpr double same_direction = 0.9998;  // a cosine: within about one degree
  return a.plane->row.dot(b.plane->row) > same_direction &&
         a.plane->column.dot(b.plane->column) > same_direction;
}

std::string described(const Kind& kind) {
  static const char* const directions[] = {"sagittal", "coronal", "axial"};
  const FrameRecord& record = *kind.first;
  Eigen::Index axis = 0;
  const double straight = record.plane->normal().cwiseAbs().maxCoeff(&axis);
  constexpr double nearly = 0.9;  // a cosine: within 26 degrees
  std::ostringstream text;
  text << kind.count << " " << (straight > nearly ? directions[axis] : "oblique") << " of " << record.columns
       << " x " << record.rows;
  if (record.pixel_mm)
    text << " pixels of " << (*record.pixel_mm)[0] << " x " << (*record.pixel_mm)[1] << " mm";
  if (!record.part.empty()) text << " (" << record.part.substr(record.part.find_first_not_of(' ')) << ")";
  return text.str();
}

/// Refuses frames of more than one kind, naming what there is.
void require_one_kind(const std::vector<FrameRecord>& records, const std::filesystem::path& shown) {
  std::vector<Kind> kinds;
  for (const auto& record : records) {
    const auto found = std::find_if(kinds.begin(), kinds.end(),
                                    [&](const Kind& kind) { return alike(*kind.first, record); });
    if (found == kinds.end())
      kinds.push_back({&record, 1});
    else
      ++found->count;
  }
  if (kinds.size() == 1) return;
  const FrameRecord& first = *kinds.front().first;
  const auto all = [&](const auto& same) {
    return std::all_of(kinds.begin(), kinds.end(), [&](const Kind& kind) { return same(*kind.first); });
  };
  std::string reason = "of different sizes";
  if (all([&](const FrameRecord& r) { return r.columns == first.columns && r.rows == first.rows; })) {
    const bool parts = !all([&](const FrameRecord& r) { return r.part == first.part; });
    const bool straight = all([&](const FrameRecord& r) {
      return r.plane->normal().dot(first.plane->normal()) > 0.999 &&
             r.plane->row.dot(first.plane->row) > 0.999;
    });
    reason = parts      ? "that belong to several volumes"
             : straight ? "with pixels of different sizes"
                        : "that lie in different directions, as those of a localizer do";
  }
  std::string text = "has slices " + reason + "; they are no single volume. It holds ";
  constexpr std::size_t most_named = 8;
  for (std::size_t n = 0; n < kinds.size() && n < most_named; ++n)
    text += (n == 0 ? "" : "; ") + described(kinds[n]);
  if (kinds.size() > most_named) text += "; and " + std::to_string(kinds.size() - most_named) + " kinds more";
  fail("no-volume", shown, text + ". Open one slice, or choose another series.");
}

/// The line that the slices' first pixels lie on: step for each millimetre
/// along the normal, by least squares.
struct Column {
  Eigen::Vector3d start = Eigen::Vector3d::Zero();  ///< at along = 0
  Eigen::Vector3d per_mm = Eigen::Vector3d::Zero();
  double worst_mm = 0.0;  ///< of a slice beside the line
};

Column fit_column(const std::vector<Eigen::Vector3d>& places, const std::vector<double>& along_mm) {
  Column column;
  const auto count = static_cast<double>(places.size());
  Eigen::Vector3d mean_place = Eigen::Vector3d::Zero();
  double mean_along = 0.0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    mean_place += places[k] / count;
    mean_along += along_mm[k] / count;
  }
  double spread = 0.0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    column.per_mm += (places[k] - mean_place) * (along_mm[k] - mean_along);
    spread += (along_mm[k] - mean_along) * (along_mm[k] - mean_along);
  }
  column.per_mm /= spread;
  column.start = mean_place - column.per_mm * mean_along;
  for (std::size_t k = 0; k < places.size(); ++k)
    column.worst_mm =
        std::max(column.worst_mm, (column.start + column.per_mm * along_mm[k] - places[k]).norm());
  return column;
}

/// Evenly spaced places along the normal, and how each is made of the file's.
struct Spread {
  double step_mm = 0.0;
  std::vector<std::vector<std::pair<std::size_t, float>>> made_of;  ///< of each k: place and weight
};

Spread spread_evenly(const std::vector<double>& along_mm, const std::filesystem::path& shown,
                     core::VolumeInfo& info) {
  Spread spread;
  const std::size_t count = along_mm.size();
  const double length = along_mm.back() - along_mm.front();
  std::vector<double> gaps;
  for (std::size_t k = 1; k < count; ++k) gaps.push_back(along_mm[k] - along_mm[k - 1]);
  const double smallest = *std::min_element(gaps.begin(), gaps.end());
  const auto widest = std::max_element(gaps.begin(), gaps.end());
  const double mean = length / static_cast<double>(count - 1);
  double worst = 0.0;
  for (std::size_t k = 0; k < count; ++k)
    worst = std::max(worst, std::abs(along_mm.front() + mean * static_cast<double>(k) - along_mm[k]));
  // A tenth of a step is what positions rounded to a tenth of a millimetre show
  // with the thinnest usual slices; less is no reason to make up slices.
  constexpr double even_enough = 0.1;
  constexpr double worth_saying = 0.02;
  if (worst <= even_enough * mean) {
    if (worst > worth_saying * mean && worst > 0.02) {
      std::ostringstream text;
      text << "The slices are " << smallest << " to " << *widest << " mm apart; they are shown evenly "
           << mean << " mm apart, which puts some up to " << worst << " mm beside their place.";
      warn(info, "uneven-slices", text.str());
    }
    spread.step_mm = mean;
    for (std::size_t k = 0; k < count; ++k) spread.made_of.push_back({{k, 1.0F}});
    return spread;
  }
  // Between two slices at most two are made up: what lies further from a real
  // slice than one step is the reader's invention, not the patient's.
  constexpr double widest_bridge = 3.25;  // three steps, and a quarter for rounding
  if (*widest > widest_bridge * smallest) {
    const auto at = static_cast<std::size_t>(widest - gaps.begin());
    std::ostringstream text;
    text << "lacks slices: " << *widest << " mm lie between slice " << at + 1 << " and slice " << at + 2
         << " of " << count << " where others are " << smallest
         << " mm apart, too far to fill the gap. Copy or export the whole series again.";
    fail("no-volume", shown, text.str(), "Gaps: " + listed(gaps, "mm"));
  }
  const auto steps = static_cast<std::size_t>(std::round(length / smallest));
  spread.step_mm = length / static_cast<double>(steps);
  std::vector<std::size_t> made_up;
  std::size_t below = 0;
  for (std::size_t k = 0; k <= steps; ++k) {
    const double at = along_mm.front() + spread.step_mm * static_cast<double>(k);
    while (below + 2 < count && along_mm[below + 1] <= at) ++below;
    const double part = std::clamp((at - along_mm[below]) / gaps[below], 0.0, 1.0);
    constexpr double on_a_slice = 0.01;  // of a gap: no need to mix in the other
    if (part < on_a_slice) {
      spread.made_of.push_back({{below, 1.0F}});
    } else if (part > 1.0 - on_a_slice) {
      spread.made_of.push_back({{below + 1, 1.0F}});
    } else {
      const auto weight = static_cast<float>(part);
      spread.made_of.push_back({{below, 1.0F - weight}, {below + 1, weight}});
      made_up.push_back(k);
    }
  }
  std::ostringstream text;
  text << "The slices are not evenly spaced (gaps of " << listed(gaps, "mm")
       << "); the volume was resampled to " << spread.step_mm << " mm, which makes " << spread.made_of.size()
       << " slices, " << made_up.size() << " of them interpolated between their neighbours:";
  constexpr std::size_t most_named = 12;
  for (std::size_t n = 0; n < made_up.size() && n < most_named; ++n)
    text << (n == 0 ? " " : ", ") << made_up[n];
  text << (made_up.size() > most_named ? ", ..." : "") << " (counted from 0).";
  warn(info, "uneven-slices", text.str());
  return spread;
}

/// Slices that do not lie behind one another are no volume.
void check_column(const Column& column, double tilt_degrees, double pixel_mm,
                  const std::filesystem::path& shown) {
  constexpr double steepest_degrees = 45.0;  // gantries tilt up to 30
  if (tilt_degrees > steepest_degrees || column.worst_mm > 0.5 * pixel_mm + 0.1) {
    std::ostringstream text;
    text << "has slices that lie beside one another and not on one line (";
    if (tilt_degrees > steepest_degrees)
      text << "shifted by " << tilt_degrees << " degrees";
    else
      text << "up to " << column.worst_mm << " mm off it";
    text << "); they are no volume. Open one slice, or choose another series.";
    fail("no-volume", shown, text.str());
  }
}

void lay_third_axis(const std::vector<FrameRecord>& records, const Numbered& numbered, bool backwards,
                    const std::filesystem::path& shown, Assembly& assembly, core::VolumeInfo& info) {
  const FramePlane& plane = *records[numbered.at.front().front()].plane;
  const Eigen::Vector3d normal = plane.normal();
  std::vector<Eigen::Vector3d> places;
  for (const std::size_t n : numbered.at.front()) places.push_back(records[n].plane->position);
  const Column column = fit_column(places, numbered.along_mm);
  const double tilt_degrees =
      std::acos(std::min(1.0, 1.0 / column.per_mm.norm())) * 180.0 / 3.14159265358979323846;
  const auto& pixel = records.front().pixel_mm;
  check_column(column, tilt_degrees, pixel ? std::max((*pixel)[0], (*pixel)[1]) : 1.0, shown);
  Spread spread = spread_evenly(numbered.along_mm, shown, info);
  constexpr double rounding_degrees = 0.1;  // of positions written with a few digits
  const bool tilted = tilt_degrees > rounding_degrees;
  Eigen::Vector3d step =
      tilted ? Eigen::Vector3d(column.per_mm * spread.step_mm) : Eigen::Vector3d(normal * spread.step_mm);
  if (tilted) {
    std::ostringstream text;
    text << "The slices are shifted against each other by " << tilt_degrees
         << " degrees (a tilted gantry): the step from slice to slice is "
         << (step.array() + 0.0).matrix().transpose() << " mm. The voxels are placed on that slanted axis.";
    warn(info, "gantry-tilt", text.str());
  }
  assembly.origin_mm = places.front();
  const auto last = static_cast<int>(spread.made_of.size()) - 1;
  if (backwards) {
    assembly.origin_mm = places.back();
    step = -step;
  }
  assembly.dims[2] = last + 1;
  assembly.direction.col(2) = step.normalized();
  assembly.spacing_mm[2] = step.norm();
  info.spacing_provenance[2] = Provenance::derived;
  for (std::size_t frame = 0; frame < numbered.at.size(); ++frame)
    for (int k = 0; k <= last; ++k)
      for (const auto& [place, weight] : spread.made_of[static_cast<std::size_t>(k)])
        assembly.placements.push_back(
            {numbered.at[frame][place], static_cast<int>(frame), backwards ? last - k : k, weight});
}

}  // namespace

Assembly assemble_placed(std::vector<FrameRecord> records, const std::filesystem::path& shown,
                         bool in_file_order, const SamePixels& same_pixels, core::VolumeInfo& info) {
  require_one_kind(records, shown);
  Assembly assembly;
  const FrameRecord& first = records.front();
  assembly.dims = {first.columns, first.rows, 1};
  if (first.pixel_mm) {
    assembly.spacing_mm[0] = (*first.pixel_mm)[0];
    assembly.spacing_mm[1] = (*first.pixel_mm)[1];
  }
  const Numbered numbered = number_frames(records, shown, same_pixels, info);
  const auto& slices = numbered.at.front();
  const FramePlane& plane = *records[slices.front()].plane;
  assembly.frames = static_cast<int>(numbered.at.size());
  assembly.origin_mm = plane.position;
  assembly.direction << plane.row, plane.column, plane.normal();
  info.origin_provenance = info.direction_provenance = Provenance::stated;
  if (slices.size() == 1) {
    for (std::size_t frame = 0; frame < numbered.at.size(); ++frame)
      assembly.placements.push_back({numbered.at[frame].front(), static_cast<int>(frame), 0, 1.0F});
  } else {
    // A single file's slices keep its order where that only runs backwards.
    const bool backwards = in_file_order && std::is_sorted(slices.begin(), slices.end(), [&](auto a, auto b) {
                             return records[a].file_frame > records[b].file_frame;
                           });
    lay_third_axis(records, numbered, backwards, shown, assembly, info);
  }
  std::stable_sort(assembly.placements.begin(), assembly.placements.end(),
                   [](const Placement& a, const Placement& b) { return a.record < b.record; });
  return assembly;
}

void keep_one_data_type(std::vector<FrameRecord>& records, core::VolumeInfo& info) {
  std::vector<std::string> types;
  for (const auto& record : records)
    if (std::find(types.begin(), types.end(), record.data_type) == types.end())
      types.push_back(record.data_type);
  if (types.size() < 2) return;
  const std::string tissue = "TISSUE_INTENSITY";
  const std::string kept =
      std::find(types.begin(), types.end(), tissue) != types.end() ? tissue : types.front();
  std::string others;
  for (const auto& type : types)
    if (type != kept) others += (others.empty() ? "" : ", ") + (type.empty() ? "unnamed" : type);
  records.erase(std::remove_if(records.begin(), records.end(),
                               [&](const FrameRecord& record) { return record.data_type != kept; }),
                records.end());
  warn(info, "data-types",
       "The file holds several kinds of data at the same places; " + (kept.empty() ? "the unnamed" : kept) +
           " is shown, " + others + " was left out.");
}

}  // namespace palpate::imaging::reading
