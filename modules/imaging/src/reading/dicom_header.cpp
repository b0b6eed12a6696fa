#include "dicom_header.hpp"

#include "text_header.hpp"

#include <Eigen/Geometry>
#include <gdcmReader.h>
#include <gdcmSequenceOfItems.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <set>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;
using gdcm::Tag;

/// The values of a data set; an absent or odd one is none.
class Tags {
 public:
  explicit Tags(const gdcm::DataSet& set) : set_(&set) {}

  bool has(Tag tag) const { return set_->FindDataElement(tag); }
  std::string bytes(Tag tag) const {
    if (!has(tag)) return {};
    const gdcm::ByteValue* value = set_->GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetPointer() == nullptr) return {};
    return {value->GetPointer(), value->GetLength()};
  }
  std::string text(Tag tag) const {
    std::string all = bytes(tag);
    while (!all.empty() && (all.back() == '\0' || all.back() == ' ')) all.pop_back();
    return trimmed(all);
  }
  /// Numbers as text, parted by backslashes; empty where one of them is none.
  std::vector<double> numbers(Tag tag) const {
    std::vector<double> values;
    const std::string all = text(tag);
    for (std::size_t from = 0; from <= all.size() && !all.empty();) {
      const std::size_t to = std::min(all.find('\\', from), all.size());
      const auto value = number(trimmed(all.substr(from, to - from)));
      if (!value || !std::isfinite(*value)) return {};
      values.push_back(*value);
      from = to + 1;
    }
    return values;
  }
  template <typename T>
  std::vector<T> binary(Tag tag) const {
    const std::string all = bytes(tag);
    std::vector<T> values(all.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), all.data(), values.size() * sizeof(T));
    return values;
  }
  int short_number(Tag tag) const {
    const auto values = binary<std::uint16_t>(tag);
    return values.empty() ? 0 : values.front();
  }
  std::vector<Tags> items(Tag tag) const {
    std::vector<Tags> all;
    if (!has(tag)) return all;
    const auto sequence = set_->GetDataElement(tag).GetValueAsSQ();
    if (sequence == nullptr) return all;
    for (gdcm::SequenceOfItems::SizeType n = 1; n <= sequence->GetNumberOfItems(); ++n)
      all.emplace_back(sequence->GetItem(n).GetNestedDataSet());
    // The items live as long as the sequence that this may just have made.
    for (auto& item : all) item.owner_ = sequence;
    return all;
  }

 private:
  const gdcm::DataSet* set_;
  gdcm::SmartPointer<gdcm::SequenceOfItems> owner_;
};

/// The first item of a macro in the frame's own groups, the shared ones or the whole file.
struct Groups {
  std::vector<Tags> places;  ///< in the order of looking
  std::optional<Tags> find(Tag sequence) const {
    for (const auto& place : places) {
      const auto items = place.items(sequence);
      if (!items.empty()) return items.front();
    }
    return std::nullopt;
  }
};

bool set_orientation(const std::vector<double>& numbers, DicomPlane& plane) {
  if (numbers.size() != 6) return false;
  plane.row = Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  plane.column = Eigen::Vector3d(numbers[3], numbers[4], numbers[5]);
  constexpr double header_digits = 1e-2;  // of a cosine written with few digits
  if (std::abs(plane.row.norm() - 1.0) > header_digits ||
      std::abs(plane.column.norm() - 1.0) > header_digits ||
      std::abs(plane.row.dot(plane.column)) > header_digits)
    return false;
  plane.row.normalize();
  plane.column = (plane.column - plane.row * plane.row.dot(plane.column)).normalized();
  return true;
}

bool set_position(const std::vector<double>& numbers, DicomPlane& plane) {
  if (numbers.size() != 3) return false;
  plane.position = Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  return true;
}

void take_spacing(const std::vector<double>& rows_columns, Provenance provenance, DicomHeader& header) {
  if (header.spacing_mm[0] || rows_columns.size() != 2 || !(rows_columns[0] > 0.0) ||
      !(rows_columns[1] > 0.0))
    return;
  header.spacing_mm[0] = rows_columns[1];  // the second number is the distance of columns
  header.spacing_mm[1] = rows_columns[0];
  header.spacing_provenance = provenance;
}

/// Ultrasound calibration: the tissue regions' pixel size in cm, where all agree.
void take_regions(const Tags& tags, DicomHeader& header) {
  constexpr int centimetres = 3;
  constexpr int tissue_2d = 1;
  std::optional<std::array<double, 2>> found;
  for (const auto& region : tags.items(Tag(0x0018, 0x6011))) {
    if (region.short_number(Tag(0x0018, 0x6024)) != centimetres ||
        region.short_number(Tag(0x0018, 0x6026)) != centimetres)
      continue;
    if (region.has(Tag(0x0018, 0x6012)) && region.short_number(Tag(0x0018, 0x6012)) != tissue_2d) continue;
    const auto x = region.binary<double>(Tag(0x0018, 0x602C));
    const auto y = region.binary<double>(Tag(0x0018, 0x602E));
    if (x.empty() || y.empty() || !std::isfinite(x[0]) || !std::isfinite(y[0]) || x[0] == 0.0 || y[0] == 0.0)
      continue;
    const std::array<double, 2> delta{std::abs(x[0]) * 10.0, std::abs(y[0]) * 10.0};
    constexpr double same = 1e-4;  // relative: two scales are given in many digits or are not the same
    if (found &&
        (std::abs((*found)[0] / delta[0] - 1.0) > same || std::abs((*found)[1] / delta[1] - 1.0) > same)) {
      header.warnings.push_back(
          {"several-regions",
           "The picture holds regions of different scale; no size of a pixel holds for all of it."});
      return;
    }
    if (!found) found = delta;
  }
  if (found) take_spacing({(*found)[1], (*found)[0]}, Provenance::stated, header);
}

/// Multi-frame functional groups: every frame's place and time.
void take_groups(const Tags& tags, DicomHeader& header) {
  const auto frames = tags.items(Tag(0x5200, 0x9230));
  const auto shared = tags.items(Tag(0x5200, 0x9229));
  if (frames.empty() && shared.empty()) return;
  std::vector<DicomPlane> planes;
  for (int frame = 0; frame < header.frames; ++frame) {
    Groups groups;
    if (static_cast<std::size_t>(frame) < frames.size())
      groups.places.push_back(frames[static_cast<std::size_t>(frame)]);
    if (!shared.empty()) groups.places.push_back(shared.front());
    if (const auto measures = groups.find(Tag(0x0028, 0x9110))) {
      take_spacing(measures->numbers(Tag(0x0028, 0x0030)), Provenance::stated, header);
      const auto between = measures->numbers(Tag(0x0018, 0x0088));
      if (!header.spacing_mm[2] && !between.empty() && between[0] > 0.0) header.spacing_mm[2] = between[0];
    }
    DicomPlane plane;
    bool placed = false;
    if (const auto position = groups.find(Tag(0x0020, 0x9113)))
      placed = set_position(position->numbers(Tag(0x0020, 0x0032)), plane);
    if (const auto orientation = groups.find(Tag(0x0020, 0x9116)); placed)
      placed = orientation && set_orientation(orientation->numbers(Tag(0x0020, 0x0037)), plane);
    const auto volume_position = groups.find(Tag(0x0020, 0x930E));
    const auto volume_orientation = groups.find(Tag(0x0020, 0x930F));
    if (!placed && volume_position && volume_orientation) {
      placed = set_position(volume_position->binary<double>(Tag(0x0020, 0x9301)), plane) &&
               set_orientation(volume_orientation->binary<double>(Tag(0x0020, 0x9302)), plane);
      header.transducer_axes = placed;
    }
    if (const auto time = groups.find(Tag(0x0020, 0x9310))) {
      const auto offset = time->binary<double>(Tag(0x0020, 0x930D));
      if (!offset.empty() && std::isfinite(offset[0])) plane.time_s = offset[0];
    }
    if (!placed) return;
    planes.push_back(plane);
  }
  header.planes = std::move(planes);
  header.meaning = FrameMeaning::placed;
}

void take_frame_times(const Tags& tags, DicomHeader& header) {
  const auto steps_ms = tags.numbers(Tag(0x0018, 0x1065));
  const auto step_ms = tags.numbers(Tag(0x0018, 0x1063));
  auto rate_hz = tags.numbers(Tag(0x0018, 0x0040));
  if (rate_hz.empty()) rate_hz = tags.numbers(Tag(0x0008, 0x2144));
  header.time_provenance = Provenance::stated;
  double time_s = 0.0;
  for (int frame = 0; frame < header.frames; ++frame) {
    if (static_cast<int>(steps_ms.size()) == header.frames) {
      time_s += frame == 0 ? 0.0 : steps_ms[static_cast<std::size_t>(frame)] / 1000.0;
    } else if (!step_ms.empty() && step_ms[0] > 0.0) {
      time_s = frame * step_ms[0] / 1000.0;
    } else if (!rate_hz.empty() && rate_hz[0] > 0.0) {
      time_s = frame / rate_hz[0];
      header.time_provenance = Provenance::derived;
    } else {
      header.time_provenance = Provenance::absent;
      return;
    }
    header.frame_times_s.push_back(time_s);
  }
}

/// What the frames of one file are to each other.
void settle_frames(const Tags& tags, DicomHeader& header) {
  DicomPlane plane;
  const bool placed = set_position(tags.numbers(Tag(0x0020, 0x0032)), plane) &&
                      set_orientation(tags.numbers(Tag(0x0020, 0x0037)), plane);
  take_groups(tags, header);
  if (header.meaning == FrameMeaning::placed) return;
  if (placed) header.planes.assign(1, plane);
  if (header.frames == 1) return;
  const auto offsets = tags.numbers(Tag(0x3004, 0x000C));
  if (placed && static_cast<int>(offsets.size()) == header.frames) {
    const Eigen::Vector3d normal = plane.row.cross(plane.column);
    // The offsets begin with 0, or are the patient's z of an axial grid.
    const double first = offsets[0];
    header.planes.clear();
    for (const double offset : offsets) {
      header.planes.push_back(plane);
      header.planes.back().position += normal * (offset - first);
    }
    header.meaning = FrameMeaning::placed;
    return;
  }
  static const std::set<std::string> slices{"1.2.840.10008.5.1.4.1.1.2.1",   "1.2.840.10008.5.1.4.1.1.4.1",
                                            "1.2.840.10008.5.1.4.1.1.128.1", "1.2.840.10008.5.1.4.1.1.66.4",
                                            "1.2.840.10008.5.1.4.1.1.481.2", "1.2.840.10008.5.1.4.1.1.6.2"};
  const bool timed = tags.has(Tag(0x0018, 0x1063)) || tags.has(Tag(0x0018, 0x1065));
  header.meaning =
      slices.count(header.sop_class) != 0 && !timed ? FrameMeaning::unplaced_slices : FrameMeaning::time;
}

/// How many bytes of the pixel element are in the file; none where there is no
/// such element. `value` is where its value begins.
std::optional<std::uint64_t> pixel_bytes_in(const std::filesystem::path& path, std::size_t value,
                                            bool big_endian) {
  const std::uint64_t size = std::filesystem::file_size(path);
  if (value == static_cast<std::size_t>(-1) || value < 12 || value > size) return std::nullopt;
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(value - 12));
  std::string before(12, '\0');
  file.read(before.data(), static_cast<std::streamsize>(before.size()));
  const std::string tag =
      big_endian ? std::string("\x7F\xE0\x00\x10", 4) : std::string("\xE0\x7F\x10\x00", 4);
  // With a value representation the length has 32 bits behind two spare bytes; without, it follows the tag.
  if (before.compare(0, 4, tag) != 0 && before.compare(4, 4, tag) != 0) return std::nullopt;
  std::uint64_t length = 0;
  for (std::size_t n = 0; n < 4; ++n) {
    const auto byte = static_cast<unsigned char>(before[8 + n]);
    length |= static_cast<std::uint64_t>(byte) << (8 * (big_endian ? 3 - n : n));
  }
  return std::min(length, size - value);
}

void take_pixel_form(const Tags& tags, DicomHeader& header) {
  header.rows = tags.short_number(Tag(0x0028, 0x0010));
  header.columns = tags.short_number(Tag(0x0028, 0x0011));
  header.samples = std::max(1, tags.short_number(Tag(0x0028, 0x0002)));
  header.bits = tags.short_number(Tag(0x0028, 0x0100));
  header.is_signed = tags.short_number(Tag(0x0028, 0x0103)) == 1;
  header.inverted = tags.text(Tag(0x0028, 0x0004)) == "MONOCHROME1";
  const std::string frames = tags.text(Tag(0x0028, 0x0008));
  if (frames.empty()) return;
  const auto count = whole_number(frames);
  if (!count || *count < 1 || *count > 1000000)
    fail(
        "bad-header", header.path,
        "says \"" + frames.substr(0, 20) + "\" where its number of frames should be. Export the scan again.");
  header.frames = static_cast<int>(*count);
}

}  // namespace

DicomHeader read_dicom_header(const std::filesystem::path& path) {
  DicomHeader header;
  header.path = path;
  const Tag pixel_tag(0x7FE0, 0x0010);
  gdcm::Reader reader;
  reader.SetFileName(path.c_str());
  if (!may_be_dicom(path) || !reader.ReadUpToTag(pixel_tag, {pixel_tag}))
    fail("unsupported", path, "is no DICOM file that can be read. Export it again, or as MetaImage or NRRD.");
  const Tags tags(reader.GetFile().GetDataSet());
  const gdcm::TransferSyntax& syntax = reader.GetFile().GetHeader().GetDataSetTransferSyntax();
  header.transfer_syntax = syntax.GetString() == nullptr ? "" : syntax.GetString();
  header.native = !syntax.IsEncapsulated() && syntax != gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian;
  header.big_endian = syntax == gdcm::TransferSyntax::ExplicitVRBigEndian;
  header.sop_class = tags.text(Tag(0x0008, 0x0016));
  header.modality = tags.text(Tag(0x0008, 0x0060));
  header.series_uid = tags.text(Tag(0x0020, 0x000E));
  header.instance_uid = tags.text(Tag(0x0008, 0x0018));
  const auto instance = whole_number(tags.text(Tag(0x0020, 0x0013)));
  if (instance && std::abs(*instance) < 1000000000) header.instance = static_cast<int>(*instance);
  take_pixel_form(tags, header);
  const std::size_t value = reader.GetStreamCurrentPosition();
  const bool deflated = syntax == gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian;
  const auto there = deflated ? std::nullopt : pixel_bytes_in(path, value, header.big_endian);
  header.has_pixels = deflated ? value != static_cast<std::size_t>(-1) : there.has_value();
  if (header.native) header.pixel_bytes = there;

  take_spacing(tags.numbers(Tag(0x0028, 0x0030)), Provenance::stated, header);
  settle_frames(tags, header);
  if (header.meaning == FrameMeaning::time && header.frames > 1) take_frame_times(tags, header);
  take_regions(tags, header);
  take_spacing(tags.numbers(Tag(0x0018, 0x2010)), Provenance::stated, header);
  // At the detector, not in the patient: the magnification is not known.
  take_spacing(tags.numbers(Tag(0x0018, 0x1164)), Provenance::derived, header);
  const auto between = tags.numbers(Tag(0x0018, 0x0088));
  if (!header.spacing_mm[2] && !between.empty() && between[0] > 0.0) header.spacing_mm[2] = between[0];
  return header;
}

DicomGlance glance(const std::filesystem::path& path) {
  DicomGlance result;
  if (!may_be_dicom(path)) return result;
  try {
    const DicomHeader header = read_dicom_header(path);
    result.dicom = true;
    result.image = header.rows > 0 && header.columns > 0;
    result.slice = result.image && header.frames == 1 && header.planes.size() == 1;
    result.series_uid = header.series_uid;
    result.instance_uid = header.instance_uid;
    result.modality = header.modality;
    result.size = std::to_string(header.columns) + " x " + std::to_string(header.rows) +
                  (header.frames > 1 ? " x " + std::to_string(header.frames) + " frames" : "");
  } catch (const core::Error& error) {
    result.dicom = error.code() != "unsupported";
  }
  return result;
}

}  // namespace palpate::imaging::reading
