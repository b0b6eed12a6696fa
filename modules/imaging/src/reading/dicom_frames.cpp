// Where and when each frame of a DICOM file is: PS3.3 C.7.6.2, C.7.6.16, C.8.24.6.
#include "dicom_frames.hpp"

#include "dicom_calibration.hpp"
#include "parsed.hpp"
#include "text_header.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <sstream>

namespace palpate::imaging::reading {
namespace {

constexpr DicomTag sop_class_tag{0x0008, 0x0016};

/// Seconds since some midnight of "20120215" and "155424.4575"; the date may lack.
std::optional<double> clock_seconds(const std::string& date, const std::string& time) {
  const auto digits = [](const std::string& text, std::size_t from, std::size_t count) {
    return text.size() >= from + count ? whole_number(text.substr(from, count)) : std::nullopt;
  };
  const auto hour = digits(time, 0, 2);
  if (!hour || *hour > 24) return std::nullopt;
  double seconds = 3600.0 * static_cast<double>(*hour);
  if (const auto minute = digits(time, 2, 2)) seconds += 60.0 * static_cast<double>(*minute);
  if (time.size() >= 6)
    if (const auto rest = number(time.substr(4, time.find_first_of("+-&", 4) - 4))) seconds += *rest;
  const auto year = digits(date, 0, 4);
  const auto month = digits(date, 4, 2);
  const auto day = digits(date, 6, 2);
  // Only differences count; a month of 31 days keeps their order.
  if (year && month && day) seconds += 86400.0 * static_cast<double>((*year * 12 + *month) * 31 + *day);
  return seconds;
}

std::optional<double> clock_of(const DicomItem& item, DicomTag both, DicomTag date, DicomTag time) {
  const std::string whole = item.text(both);
  if (whole.size() >= 10) return clock_seconds(whole.substr(0, 8), whole.substr(8));
  return clock_seconds(item.text(date), item.text(time));
}

void take(const DicomItem& item, DicomTag tag, double scale, std::optional<double>& value) {
  if (const auto found = item.number(tag)) value = *found * scale;
}

void take_contrast(const DicomItem& item, DicomTag tag, const std::string& name, FrameClock& clock) {
  if (const auto found = item.number(tag)) clock.contrasts[name] = *found;
}

/// The tags that classic images carry, also within converted ones.
void take_classic_clock(const DicomItem& item, FrameClock& clock) {
  constexpr double ms = 1e-3;
  take(item, {0x0020, 0x0100}, 1.0, clock.temporal_index);
  take(item, {0x0054, 0x1300}, ms, clock.offset_s);  // frame reference time, of PET
  take(item, {0x0018, 0x1060}, ms, clock.trigger_s);
  take(item, {0x0020, 0x0012}, 1.0, clock.acquisition);
  take(item, {0x0020, 0x0013}, 1.0, clock.instance);
  if (const auto time = clock_of(item, {0x0008, 0x002A}, {0x0008, 0x0022}, {0x0008, 0x0032}))
    clock.acquired_s = time;
  if (const auto time = clock_of(item, {0x0000, 0x0000}, {0x0008, 0x0023}, {0x0008, 0x0033}))
    clock.content_s = time;
  take_contrast(item, {0x0018, 0x0081}, "echo time", clock);
  take_contrast(item, {0x0018, 0x0082}, "inversion time", clock);
  take_contrast(item, {0x0018, 0x1314}, "flip angle", clock);
  take_contrast(item, {0x0018, 0x9087}, "b-value", clock);
  if (const std::string type = item.text({0x0008, 0x0008}); !type.empty()) clock.image_type = type;
}

/// The macros of one frame: its own first, then those that all share.
class Groups {
 public:
  Groups(const DicomItem* own, const DicomItem* shared) {
    if (own != nullptr) places_.push_back(*own);
    if (shared != nullptr) places_.push_back(*shared);
  }
  std::optional<DicomItem> find(DicomTag sequence) const {
    for (const auto& place : places_)
      if (const auto items = place.items(sequence); !items.empty()) return items.front();
    return std::nullopt;
  }

 private:
  std::vector<DicomItem> places_;
};

/// A dimension by which the file sorts its frames (0020,9222).
struct Dimension {
  DicomTag tag;
};
bool is(DicomTag a, DicomTag b) { return a.group == b.group && a.element == b.element; }

std::vector<Dimension> dimensions_of(const DicomItem& dataset) {
  std::vector<Dimension> all;
  for (const auto& item : dataset.items({0x0020, 0x9222})) {
    Dimension dimension;
    // Written "(0020,9057)".
    unsigned group = 0;
    unsigned element = 0;
    if (std::sscanf(item.text({0x0020, 0x9165}).c_str(), "(%x,%x)", &group, &element) == 2)
      dimension.tag = {static_cast<std::uint16_t>(group), static_cast<std::uint16_t>(element)};
    all.push_back(dimension);
  }
  return all;
}

void take_dimensions(const std::vector<Dimension>& dimensions, const DicomItem& content,
                     FrameRecord& record) {
  FrameClock& clock = record.clock;
  const auto values = content.numbers({0x0020, 0x9157});
  if (values.size() != dimensions.size()) return;
  for (std::size_t n = 0; n < values.size(); ++n) {
    const DicomTag tag = dimensions[n].tag;
    const bool place = is(tag, {0x0020, 0x9056}) || is(tag, {0x0020, 0x9057}) || is(tag, {0x0020, 0x0032}) ||
                       is(tag, {0x0020, 0x0037}) || is(tag, {0x0020, 0x9301}) || is(tag, {0x0020, 0x9302}) ||
                       is(tag, {0x0018, 0x9808}) || is(tag, {0x0062, 0x000B});
    const bool time = is(tag, {0x0020, 0x9128}) || is(tag, {0x0020, 0x930D}) || is(tag, {0x0020, 0x9153}) ||
                      is(tag, {0x0020, 0x9241}) || is(tag, {0x0018, 0x9074}) || is(tag, {0x0018, 0x9151});
    if (is(tag, {0x0020, 0x9057}) && !record.in_stack) record.in_stack = values[n];
    if (place || is(tag, {0, 0})) continue;
    if (time) {
      if (!clock.temporal_index) clock.temporal_index = values[n];
    } else {
      clock.contrasts.emplace("dimension " + std::to_string(n + 1), values[n]);
    }
  }
}

void take_group_clock(const Groups& groups, const std::vector<Dimension>& dimensions, FrameRecord& record) {
  FrameClock& clock = record.clock;
  constexpr double ms = 1e-3;
  for (const DicomTag converted : {DicomTag{0x0020, 0x9170}, DicomTag{0x0020, 0x9171}})
    if (const auto item = groups.find(converted)) take_classic_clock(*item, clock);
  if (const auto content = groups.find({0x0020, 0x9111})) {
    take(*content, {0x0020, 0x9128}, 1.0, clock.temporal_index);
    take(*content, {0x0020, 0x9156}, 1.0, clock.acquisition);
    for (const DicomTag tag : {DicomTag{0x0018, 0x9151}, DicomTag{0x0018, 0x9074}})
      if (const auto time = clock_of(*content, tag, {0, 0}, {0, 0})) clock.acquired_s = time;
    if (const std::string stack = content->text({0x0020, 0x9056}); !stack.empty())
      record.part += " stack " + stack;
    take(*content, {0x0020, 0x9057}, 1.0, record.in_stack);
    take_dimensions(dimensions, *content, record);
  }
  if (const auto item = groups.find({0x0020, 0x9310})) take(*item, {0x0020, 0x930D}, 1.0, clock.offset_s);
  if (const auto item = groups.find({0x0018, 0x9118})) take(*item, {0x0020, 0x9153}, ms, clock.trigger_s);
  if (const auto item = groups.find({0x0018, 0x9114}))
    take_contrast(*item, {0x0018, 0x9082}, "echo time", clock);
  if (const auto item = groups.find({0x0018, 0x9117}))
    take_contrast(*item, {0x0018, 0x9087}, "b-value", clock);
  if (const auto item = groups.find({0x0062, 0x000A}))
    if (const std::string segment = item->text({0x0062, 0x000B}); !segment.empty())
      record.part += " segment " + segment;
  auto type = groups.find({0x0018, 0x9807});
  if (const auto description = groups.find({0x0018, 0x9806}); !type && description) {
    const auto inside = description->items({0x0018, 0x9807});
    if (!inside.empty()) type = inside.front();
  }
  if (type) record.data_type = type->text({0x0018, 0x9808});
}

/// The four tags of a plane in functional groups.
struct PlaneTags {
  DicomTag position_sequence, position, orientation_sequence, orientation;
};
constexpr PlaneTags patient_plane{{0x0020, 0x9113}, {0x0020, 0x0032}, {0x0020, 0x9116}, {0x0020, 0x0037}};
constexpr PlaneTags volume_plane{{0x0020, 0x930E}, {0x0020, 0x9301}, {0x0020, 0x930F}, {0x0020, 0x9302}};

std::optional<FramePlane> plane_in(const Groups& groups, const PlaneTags& tags,
                                   const std::filesystem::path& path, bool lenient,
                                   std::optional<double>& repaired_by) {
  const auto place = groups.find(tags.position_sequence);
  const auto axes = groups.find(tags.orientation_sequence);
  if (!place || !axes) return std::nullopt;
  return plane_of(path, place->numbers(tags.position), axes->numbers(tags.orientation), lenient, repaired_by);
}

/// Whether positions in the patient may be believed: always but for ultrasound
/// volumes, which must say where they have them from (PS3.3 C.8.24.2).
bool patient_planes_hold(const DicomItem& dataset, FileFrames& file) {
  const bool volume_system = dataset.has({0x0020, 0x9312}) || dataset.has({0x0020, 0x9307}) ||
                             dataset.text(sop_class_tag) == "1.2.840.10008.5.1.4.1.1.6.2";
  if (!volume_system || dataset.text({0x0020, 0x9307}) == "PATIENT") return true;
  const std::string source = dataset.text({0x0020, 0x930C});
  if (source == "ESTIMATED")
    file.warnings.push_back(
        {"estimated-orientation",
         "How the volume lies in the patient was estimated at the scanner, not measured."});
  return !source.empty();
}

void take_groups(const DicomItem& dataset, const std::filesystem::path& path, bool lenient,
                 FileFrames& file) {
  const auto own = dataset.items({0x5200, 0x9230});
  const auto shared = dataset.items({0x5200, 0x9229});
  if (own.empty() && shared.empty()) return;
  const auto dimensions = dimensions_of(dataset);
  const bool patient = patient_planes_hold(dataset, file);
  std::size_t in_patient = 0;
  std::size_t in_volume = 0;
  std::vector<std::optional<FramePlane>> by_patient;
  std::vector<std::optional<FramePlane>> by_volume;
  for (std::size_t n = 0; n < file.records.size(); ++n) {
    FrameRecord& record = file.records[n];
    const Groups groups(n < own.size() ? &own[n] : nullptr, shared.empty() ? nullptr : &shared.front());
    if (const auto measures = groups.find({0x0028, 0x9110})) {
      const auto rows_columns = measures->numbers({0x0028, 0x0030});
      if (rows_columns.size() == 2 && is_voxel_size(rows_columns[0]) && is_voxel_size(rows_columns[1]))
        record.pixel_mm = {rows_columns[1], rows_columns[0]};
      const auto between = measures->number({0x0018, 0x0088});
      if (between && is_voxel_size(*between) && !file.between_mm) file.between_mm = between;
    }
    by_patient.push_back(patient ? plane_in(groups, patient_plane, path, lenient, file.repaired_by)
                                 : std::nullopt);
    by_volume.push_back(plane_in(groups, volume_plane, path, lenient, file.repaired_by));
    in_patient += by_patient.back() ? 1U : 0U;
    in_volume += by_volume.back() ? 1U : 0U;
    take_group_clock(groups, dimensions, record);
  }
  // One system for all frames, the patient's where it is whole.
  const bool use_patient = in_patient == file.records.size();
  if (!use_patient && in_volume != file.records.size()) return;
  for (std::size_t n = 0; n < file.records.size(); ++n)
    file.records[n].plane = use_patient ? by_patient[n] : by_volume[n];
  file.transducer_axes = !use_patient;
  file.role = FrameRole::placed;
}

/// Dose grids: offsets of the frames along the normal (PS3.3 C.8.8.3).
bool take_offsets(const DicomItem& dataset, const std::optional<FramePlane>& plane, FileFrames& file) {
  const auto offsets = dataset.numbers({0x3004, 0x000C});
  if (!plane || offsets.size() != file.records.size()) return false;
  for (std::size_t n = 0; n < offsets.size(); ++n) {
    FramePlane placed = *plane;
    // They begin with 0, or are the patient's z of an axial grid.
    placed.position += plane->normal() * (offsets[n] - offsets.front());
    file.records[n].plane = placed;
  }
  file.role = FrameRole::placed;
  return true;
}

/// Objects that are made of slices even where a file lost what says how they lie.
bool made_of_slices(const std::string& sop_class) {
  static const std::set<std::string> classes{
      "1.2.840.10008.5.1.4.1.1.2.1",  "1.2.840.10008.5.1.4.1.1.2.2",   "1.2.840.10008.5.1.4.1.1.4.1",
      "1.2.840.10008.5.1.4.1.1.4.4",  "1.2.840.10008.5.1.4.1.1.128.1", "1.2.840.10008.5.1.4.1.1.130",
      "1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.481.2", "1.2.840.10008.5.1.4.1.1.6.2"};
  return classes.count(sop_class) != 0;
}

}  // namespace

Eigen::Vector3d FramePlane::normal() const { return row.cross(column).normalized(); }

std::optional<FramePlane> plane_of(const std::filesystem::path& path, const std::vector<double>& position,
                                   const std::vector<double>& orientation, bool lenient,
                                   std::optional<double>& repaired_by) {
  if (position.size() != 3 || orientation.size() != 6) return std::nullopt;
  Eigen::Matrix<double, 3, 2> axes;
  axes << orientation[0], orientation[3], orientation[1], orientation[4], orientation[2], orientation[5];
  if (axes.cwiseAbs().maxCoeff() == 0.0) return std::nullopt;
  const double off = (axes.transpose() * axes - Eigen::Matrix2d::Identity()).cwiseAbs().maxCoeff();
  // Two per cent is a degree of skew or a cosine of two digits; more is no rounding.
  constexpr double mendable = 0.02;
  constexpr double written_digits = 2e-4;  // of a cosine with four digits
  if (!(off <= mendable) && lenient) return std::nullopt;
  if (!(off <= mendable)) {
    std::ostringstream text;
    text << "gives axes that are no unit vectors at right angles (" << axes.col(0).transpose() << " and "
         << axes.col(1).transpose() << "). Export the scan again.";
    fail("bad-header", path, text.str());
  }
  if (off > written_digits) repaired_by = std::max(repaired_by.value_or(0.0), off);
  // The nearest pair of unit vectors at right angles.
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(axes, Eigen::ComputeThinU | Eigen::ComputeThinV);
  axes = svd.matrixU() * svd.matrixV().transpose();
  FramePlane plane;
  plane.position = Eigen::Vector3d(position[0], position[1], position[2]);
  // Exact axes stay exact to the last digit: 0 and 1 have no rounding to lose.
  plane.row = off == 0.0 ? Eigen::Vector3d(orientation[0], orientation[1], orientation[2])
                         : Eigen::Vector3d(axes.col(0));
  plane.column = off == 0.0 ? Eigen::Vector3d(orientation[3], orientation[4], orientation[5])
                            : Eigen::Vector3d(axes.col(1));
  return plane;
}

FileFrames read_frames(const DicomItem& dataset, const std::filesystem::path& path, int columns, int rows,
                       int frames, bool lenient) {
  FileFrames file;
  FrameRecord common;
  common.name = path.filename().string();
  common.columns = columns;
  common.rows = rows;
  take_classic_clock(dataset, common.clock);
  if (common.clock.image_type.find("MOSAIC") != std::string::npos)
    file.warnings.push_back(
        {"mosaic",
         "Every picture is a mosaic of slices side by side; they are not taken apart, and "
         "no place in it but the first slice's is right."});
  const auto between = dataset.number({0x0018, 0x0088});
  if (between && is_voxel_size(*between)) file.between_mm = between;
  for (int frame = 0; frame < frames; ++frame) {
    file.records.push_back(common);
    file.records.back().file_frame = frame;
  }
  take_groups(dataset, path, lenient, file);
  if (file.role == FrameRole::placed) return file;
  const auto plane = plane_of(path, dataset.numbers({0x0020, 0x0032}), dataset.numbers({0x0020, 0x0037}),
                              lenient, file.repaired_by);
  for (auto& record : file.records) record.plane = plane;
  if (frames == 1 || take_offsets(dataset, plane, file)) return file;
  const bool timed = dataset.has({0x0018, 0x1063}) || dataset.has({0x0018, 0x1065});
  // Nuclear medicine counts its frames by a slice vector alone.
  const bool by_slice = dataset.text({0x0028, 0x0009}) == "(0054,0080)";
  if ((made_of_slices(dataset.text(sop_class_tag)) || by_slice) && !timed)
    file.role = FrameRole::unplaced_slices;
  return file;
}

}  // namespace palpate::imaging::reading
