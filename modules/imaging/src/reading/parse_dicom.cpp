// DICOM files to volumes: what is there, the grid that it makes, its pixels.
#include "dicom_assembly.hpp"
#include "dicom_calibration.hpp"
#include "dicom_file.hpp"
#include "dicom_frames.hpp"
#include "dicom_pixels.hpp"
#include "orientation.hpp"
#include "parsed.hpp"
#include "settle.hpp"
#include "text_header.hpp"
#include "vendor/kretz.hpp"
#include "vendor/vendor.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <sstream>
#include <string_view>
#include <tuple>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;

/// What is known of one file once it is closed again: a long series is not
/// kept in memory.
struct Part {
  std::filesystem::path path;
  DicomPixelForm form;
  FileFrames frames;
  Calibration calibration;
  CineTimes times;
};

void add_warnings(const std::vector<core::Warning>& more, core::VolumeInfo& info) {
  for (const auto& warning : more)
    if (std::none_of(info.warnings.begin(), info.warnings.end(), [&](const core::Warning& known) {
          return known.code == warning.code && known.text == warning.text;
        }))
      info.warnings.push_back(warning);
}

std::string date_of(const DicomItem& dataset) {
  for (const DicomTag tag : {DicomTag{0x0008, 0x0022}, DicomTag{0x0008, 0x002A}, DicomTag{0x0008, 0x0023},
                             DicomTag{0x0008, 0x0021}, DicomTag{0x0008, 0x0020}}) {
    const std::string digits = dataset.text(tag).substr(0, 8);
    // These two stand where a date must be and none is known.
    const bool filler = digits == "00000000" || digits == "19000101";
    if (digits.size() == 8 && whole_number(digits) && !filler)
      return digits.substr(0, 4) + "-" + digits.substr(4, 2) + "-" + digits.substr(6, 2);
  }
  return {};
}

core::VolumeInfo info_of(const DicomItem& dataset) {
  core::VolumeInfo info;
  info.format = "DICOM";
  info.modality = dataset.text({0x0008, 0x0060});
  info.sop_class = dataset.text({0x0008, 0x0016});
  info.series_uid = dataset.text({0x0020, 0x000E});
  info.description = dataset.text({0x0008, 0x103E});
  info.date = date_of(dataset);
  info.scanner = scanner_of(dataset);
  return info;
}

Part read_part(const DicomFile& file, const Context& context, core::VolumeInfo& info) {
  Part part;
  const DicomPixels pixels(file, context);
  part.path = file.path();
  part.form = pixels.form();
  if (context.headers_only) add_warnings(pixels.warnings(), info);
  part.frames = read_frames(file.dataset(), file.path(), part.form.columns, part.form.rows, part.form.frames,
                            orientation_given(context.options));
  part.calibration = calibrate(file.dataset());
  if (part.frames.role == FrameRole::time) part.times = cine_times(file.dataset(), part.form.frames);
  for (auto& record : part.frames.records)
    if (!record.pixel_mm) record.pixel_mm = part.calibration.pixel_mm;
  return part;
}

/// Slices whose planes the file does not give: times by their index, where all
/// hold equally many, and slices by their number in the stack or in the file's order.
void lay_slices(const FileFrames& file, Assembly& assembly, core::VolumeInfo& info) {
  const auto by_number = [&](std::size_t a, std::size_t b) {
    const auto& first = file.records[a].in_stack;
    const auto& second = file.records[b].in_stack;
    return first && second && *first < *second;
  };
  std::map<double, std::vector<std::size_t>> times;
  for (std::size_t n = 0; n < file.records.size(); ++n)
    times[file.records[n].clock.temporal_index.value_or(0.0)].push_back(n);
  const std::size_t slices = times.begin()->second.size();
  const bool whole =
      std::all_of(times.begin(), times.end(), [&](const auto& time) { return time.second.size() == slices; });
  if (!whole) {
    times.clear();
    for (std::size_t n = 0; n < file.records.size(); ++n) times[0.0].push_back(n);
  }
  int frame = 0;
  std::vector<double> offsets;
  for (auto& [index, records] : times) {
    std::stable_sort(records.begin(), records.end(), by_number);
    for (std::size_t k = 0; k < records.size(); ++k)
      assembly.placements.push_back({records[k], frame, static_cast<int>(k), 1.0F});
    if (const auto offset = file.records[records.front()].clock.offset_s) offsets.push_back(*offset);
    ++frame;
  }
  std::stable_sort(assembly.placements.begin(), assembly.placements.end(),
                   [](const Placement& a, const Placement& b) { return a.record < b.record; });
  assembly.frames = frame;
  assembly.dims[2] = static_cast<int>(times.begin()->second.size());
  const bool rising =
      std::adjacent_find(offsets.begin(), offsets.end(), std::greater_equal<>()) == offsets.end();
  if (frame > 1 && offsets.size() == times.size() && rising) {
    for (const double offset : offsets) info.frame_times_s.push_back(offset - offsets.front());
    info.time_provenance = Provenance::stated;
  }
  warn(info, "assumed-slices",
       "The file does not say how its frames lie to each other; they were taken for slices in their order.");
}

/// Frames of a file that says nothing of their places: times, or slices in their order.
Assembly assemble_unplaced(const Part& part, core::VolumeInfo& info) {
  const FileFrames& file = part.frames;
  const FrameRecord& first = file.records.front();
  Assembly assembly;
  assembly.dims = {first.columns, first.rows, 1};
  if (first.pixel_mm)
    assembly.spacing_mm.head<2>() = Eigen::Vector2d((*first.pixel_mm)[0], (*first.pixel_mm)[1]);
  if (first.plane) {
    assembly.origin_mm = first.plane->position;
    assembly.direction << first.plane->row, first.plane->column, first.plane->normal();
    info.origin_provenance = info.direction_provenance = Provenance::stated;
  }
  const auto count = static_cast<int>(file.records.size());
  const bool slices = file.role == FrameRole::unplaced_slices;
  if (slices) {
    lay_slices(file, assembly, info);
  } else {
    for (int n = 0; n < count; ++n) assembly.placements.push_back({static_cast<std::size_t>(n), n, 0, 1.0F});
    assembly.frames = count;
    info.frame_times_s = part.times.frame_times_s;
    info.time_provenance = part.times.provenance;
    add_warnings(part.times.warnings, info);
  }
  if (file.between_mm && (slices || count == 1)) {
    assembly.spacing_mm[2] = *file.between_mm;
    info.spacing_provenance[2] = Provenance::stated;
  }
  return assembly;
}

/// What all files together say of their frames.
struct Scan {
  std::filesystem::path shown;  ///< the file, or the folder of a series
  std::vector<Part> parts;
  std::vector<FrameRecord> records;
  Assembly assembly;
};

/// Decodes frames of the scan's files, the last file still open.
class Decoder {
 public:
  Decoder(const Scan& scan, const Context& context) : scan_(scan), context_(context) {}
  void decode(const FrameRecord& record, float* grey) {
    if (!pixels_ || record.file != open_) {
      pixels_.reset();
      file_ = std::make_unique<DicomFile>(scan_.parts[record.file].path);
      pixels_ = std::make_unique<DicomPixels>(*file_, context_);
      open_ = record.file;
    }
    pixels_->decode(record.file_frame, grey);
  }
  const std::vector<core::Warning>& warnings() const { return pixels_->warnings(); }

 private:
  const Scan& scan_;
  const Context& context_;
  std::unique_ptr<DicomFile> file_;
  std::unique_ptr<DicomPixels> pixels_;
  std::size_t open_ = 0;
};

/// Compares frames by a number made of their pixels, each decoded once, and
/// pixel by pixel only where those agree.
class PixelComparison {
 public:
  PixelComparison(const Scan& scan, const Context& context) : scan_(scan), context_(context) {}
  bool same(const FrameRecord& a, const FrameRecord& b) {
    return digest_of(a) == digest_of(b) && decoded(a) == decoded(b);
  }

 private:
  std::vector<float> decoded(const FrameRecord& record) const {
    std::vector<float> grey(static_cast<std::size_t>(record.rows) * static_cast<std::size_t>(record.columns));
    Decoder(scan_, context_).decode(record, grey.data());
    return grey;
  }
  std::size_t digest_of(const FrameRecord& record) {
    const auto [known, added] = digests_.try_emplace({record.file, record.file_frame}, 0);
    if (added) {
      const std::vector<float> grey = decoded(record);
      const std::string_view bytes(reinterpret_cast<const char*>(grey.data()), grey.size() * sizeof(float));
      known->second = std::hash<std::string_view>{}(bytes);
    }
    return known->second;
  }
  const Scan& scan_;
  const Context& context_;
  std::map<std::pair<std::size_t, int>, std::size_t> digests_;
};

void say_repairs(const Scan& scan, core::VolumeInfo& info) {
  double worst = 0.0;
  for (const auto& part : scan.parts) worst = std::max(worst, part.frames.repaired_by.value_or(0.0));
  if (worst == 0.0) return;
  std::ostringstream text;
  text << "The file's axes are not exactly unit vectors at right angles (off by up to " << worst
       << "); the nearest that are were taken.";
  warn(info, "repaired-direction", text.str());
}

/// The probe's own system stands for the patient's until somebody says otherwise.
void offer_orientations(const Context& context, core::VolumeInfo& info) {
  info.orientation_choices = {orientation_of(info.geometry)};
  for (const char* word : {"LPS", "RAS", "LPI", "RPI"})
    if (info.orientation_choices.front() != word) info.orientation_choices.emplace_back(word);
  say_orientation("The volume is in the probe's axes: the file", context.options, info);
}

void assemble(Scan& scan, const Context& context, core::VolumeInfo& info) {
  const Part& first = scan.parts.front();
  const bool series = scan.parts.size() > 1;
  for (std::size_t n = 0; n < scan.parts.size(); ++n) {
    for (FrameRecord record : scan.parts[n].frames.records) {
      record.file = n;
      if (series && (scan.parts[n].frames.records.size() != 1 || !record.plane))
        fail("no-volume", scan.shown,
             "does not say where each picture lies (" + record.name +
                 "); its files are no volume. Open one of the files.");
      scan.records.push_back(std::move(record));
    }
    add_warnings(scan.parts[n].frames.warnings, info);
  }
  add_warnings(first.calibration.warnings, info);
  if (series || first.frames.role == FrameRole::placed) {
    if (first.frames.between_mm) info.spacing_provenance[2] = Provenance::stated;
    keep_one_data_type(scan.records, info);
    PixelComparison comparison(scan, context);
    const auto compare = [&](const FrameRecord& a, const FrameRecord& b) { return comparison.same(a, b); };
    const SamePixels same = series ? SamePixels(compare) : SamePixels{};
    scan.assembly = assemble_placed(scan.records, scan.shown, !series, same, info);
    if (scan.assembly.dims[2] == 1 && first.frames.between_mm)
      scan.assembly.spacing_mm[2] = *first.frames.between_mm;
  } else {
    scan.assembly = assemble_unplaced(first, info);
  }
  // A size that a frame's own macro states, or that of the header.
  const bool own_size = scan.records.front().pixel_mm != first.calibration.pixel_mm;
  const auto in_plane = !scan.records.front().pixel_mm ? Provenance::assumed
                        : own_size                     ? Provenance::stated
                                                       : first.calibration.provenance;
  info.spacing_provenance[0] = info.spacing_provenance[1] = in_plane;
  say_repairs(scan, info);
  info.frames = scan.assembly.frames;
  info.geometry = make_geometry(first.path, scan.assembly.dims, scan.assembly.spacing_mm,
                                scan.assembly.origin_mm, scan.assembly.direction, info);
  if (first.frames.transducer_axes) offer_orientations(context, info);
}

/// Decodes the frames that are wanted, each record once, into their slices.
void load(const Scan& scan, const Parsed& parsed, const Context& context, core::VolumeInfo& info) {
  const Assembly& assembly = scan.assembly;
  const std::size_t plane =
      static_cast<std::size_t>(assembly.dims[0]) * static_cast<std::size_t>(assembly.dims[1]);
  const int last = parsed.first_frame + parsed.kept_frames;
  Decoder decoder(scan, context);
  std::vector<float> grey(plane);
  std::size_t decoded = scan.records.size();  // none yet
  std::vector<Placement> wanted;
  for (const auto& placement : assembly.placements)
    if (placement.frame >= parsed.first_frame && placement.frame < last) wanted.push_back(placement);
  for (std::size_t n = 0; n < wanted.size(); ++n) {
    const Placement& placement = wanted[n];
    context.progress.report(0.2 + 0.8 * static_cast<double>(n) / static_cast<double>(wanted.size()),
                            "Decoding pixels");
    if (placement.record != decoded) {
      decoder.decode(scan.records[placement.record], grey.data());
      add_warnings(decoder.warnings(), info);
      decoded = placement.record;
    }
    const auto slice = static_cast<std::size_t>(placement.frame - parsed.first_frame) *
                           static_cast<std::size_t>(assembly.dims[2]) +
                       static_cast<std::size_t>(placement.k);
    float* out = parsed.voxels.get() + slice * plane;
    if (placement.weight == 1.0F)
      std::copy(grey.begin(), grey.end(), out);
    else
      std::transform(grey.begin(), grey.end(), out, out,
                     [&](float value, float sum) { return sum + placement.weight * value; });
  }
}

Parsed finish(const Scan& scan, const Context& context, core::VolumeInfo info) {
  const DicomPixelForm& form = scan.parts.front().form;
  info.components = form.components;
  info.pixel_type = form.pixel_type;
  if (form.components > 1) warn_of_colour(info);
  if (form.photometric == "MONOCHROME1")
    warn(info, "inverted-display",
         "The file asks to be shown with low values bright (MONOCHROME1); the values are kept as stored.");
  Parsed parsed;
  std::tie(parsed.first_frame, parsed.kept_frames) = frames_to_keep(context.options, info.frames);
  if (!context.headers_only) {
    const std::size_t count = info.geometry.voxel_count() * static_cast<std::size_t>(parsed.kept_frames);
    const double one_frame = static_cast<double>(form.rows) * form.columns * sizeof(float);
    check_memory(scan.shown, 4.0 * one_frame, static_cast<double>(count), context);
    parsed.voxels = context.allocate(count);
    std::fill_n(parsed.voxels.get(), count, 0.0F);  // slices between two are summed up
    load(scan, parsed, context, info);
    make_finite(scan.shown, parsed.voxels.get(), count, info);
  }
  settle_geometry(context.options, info);
  parsed.info = std::move(info);
  return parsed;
}

/// Bytes of whole slices, in their order, whatever the number of frames says.
void load_raw_slices(const DicomFile& file, const VendorGrid& grid, const Parsed& parsed,
                     const Context& context, core::VolumeInfo& info) {
  const auto plane = static_cast<std::size_t>(grid.dims[0]) * static_cast<std::size_t>(grid.dims[1]);
  const auto slices = static_cast<std::size_t>(grid.dims[2]);
  const DicomPixelPlace::Piece& value = file.pixels().value;
  const std::uint64_t whole =
      static_cast<std::uint64_t>(plane) * slices * static_cast<std::uint64_t>(grid.frames);
  if (value.present < whole) {
    if (!context.options.allow_truncated)
      fail("truncated", file.path(),
           "holds " + std::to_string(value.present) + " bytes of voxels where its header speaks of " +
               std::to_string(whole) + ". It was cut off: copy or export it again.");
    warn(info, "truncated", "The file was cut off; the voxels that are missing are black.");
  }
  if (context.headers_only) return;
  const std::size_t first = static_cast<std::size_t>(parsed.first_frame) * slices;
  const std::size_t count = static_cast<std::size_t>(parsed.kept_frames) * slices;
  for (std::size_t n = 0; n < count; ++n) {
    context.progress.report(0.2 + 0.8 * static_cast<double>(n) / static_cast<double>(count),
                            "Reading voxels");
    const std::uint64_t from = static_cast<std::uint64_t>(first + n) * plane;
    const std::uint64_t there =
        from < value.present ? std::min<std::uint64_t>(plane, value.present - from) : 0;
    const auto bytes = file.read(value.offset + from, static_cast<std::size_t>(there));
    float* out = parsed.voxels.get() + n * plane;
    std::fill(std::copy(bytes.begin(), bytes.end(), out), out + plane, 0.0F);
  }
}

Parsed parse_raw_slices(const DicomFile& file, const VendorGrid& grid, const Context& context,
                        core::VolumeInfo info) {
  Parsed parsed;
  info.pixel_type = "uint8";
  std::tie(parsed.first_frame, parsed.kept_frames) = frames_to_keep(context.options, info.frames);
  const std::size_t count = info.geometry.voxel_count() * static_cast<std::size_t>(parsed.kept_frames);
  if (!context.headers_only) {
    check_memory(file.path(), 0.0, static_cast<double>(count), context);
    if (file.pixels().value.present == 0)
      fail("no-image", file.path(), "has a header but no voxels. Export it again.");
    parsed.voxels = context.allocate(count);
  }
  load_raw_slices(file, grid, parsed, context, info);
  settle_geometry(context.options, info);
  parsed.info = std::move(info);
  return parsed;
}

Parsed parse_vendor(const DicomFile& file, const VendorGrid& grid, const Context& context,
                    core::VolumeInfo info) {
  info.frames = grid.frames;
  info.spacing_provenance = grid.spacing_provenance;
  info.direction_provenance = Provenance::assumed;
  info.orientation_choices = grid.orientations;
  info.frame_times_s = grid.times.frame_times_s;
  info.time_provenance = grid.times.provenance;
  add_warnings(grid.times.warnings, info);
  add_warnings(grid.warnings, info);
  const Eigen::Matrix3d axes = axes_of(grid.orientations.front());
  if (grid.origin_mm) info.origin_provenance = Provenance::derived;
  const Eigen::Vector3d origin =
      grid.origin_mm ? Eigen::Vector3d(axes * *grid.origin_mm) : Eigen::Vector3d::Zero();
  info.geometry = make_geometry(file.path(), grid.dims, grid.spacing_mm, origin, axes, info);
  say_orientation("A " + grid.kind + " file", context.options, info);
  if (grid.raw_slices) return parse_raw_slices(file, grid, context, std::move(info));
  Scan scan;
  scan.shown = file.path();
  core::VolumeInfo unused;
  scan.parts.push_back(read_part(file, context, unused));
  scan.records = scan.parts.front().frames.records;
  scan.assembly.dims = grid.dims;
  scan.assembly.frames = grid.frames;
  for (std::size_t n = 0; n < scan.records.size(); ++n)
    scan.assembly.placements.push_back(
        {n, static_cast<int>(n) / grid.dims[2], static_cast<int>(n) % grid.dims[2], 1.0F});
  return finish(scan, context, std::move(info));
}

Parsed parse_one(const std::filesystem::path& path, const Context& context) {
  const DicomFile file(path);
  core::VolumeInfo info = info_of(file.dataset());
  if (holds_kretz(file)) return parse_kretz_in(file, std::move(info), context);
  refuse_private_only(file);
  if (const auto grid = vendor_grid(file)) return parse_vendor(file, *grid, context, std::move(info));
  Scan scan;
  scan.shown = path;
  scan.parts.push_back(read_part(file, context, info));
  assemble(scan, context, info);
  if (info.modality == "US" || info.modality == "IVUS")
    if (const std::string unread = unread_volume(file); !unread.empty()) warn(info, "private-volume", unread);
  return finish(scan, context, std::move(info));
}

Parsed parse_series(const std::vector<std::filesystem::path>& paths, const Context& context) {
  Scan scan;
  scan.shown = paths.front().parent_path();
  core::VolumeInfo info;
  for (std::size_t n = 0; n < paths.size(); ++n) {
    context.progress.report(0.2 * static_cast<double>(n) / static_cast<double>(paths.size()),
                            "Reading headers");
    const DicomFile file(paths[n]);
    if (n == 0) info = info_of(file.dataset());
    scan.parts.push_back(read_part(file, context, info));
  }
  assemble(scan, context, info);
  return finish(scan, context, std::move(info));
}

}  // namespace

Parsed parse_dicom(const std::vector<std::filesystem::path>& paths, const Context& context) {
  return paths.size() == 1 ? parse_one(paths.front(), context) : parse_series(paths, context);
}

DicomGlance glance(const std::filesystem::path& path) {
  DicomGlance result;
  if (!may_be_dicom(path)) return result;
  try {
    const DicomFile file(path);
    const DicomItem dataset = file.dataset();
    const auto count = [&](DicomTag tag) {
      return static_cast<long long>(std::clamp(dataset.number(tag).value_or(0.0), 0.0, 1e9));
    };
    const long long rows = count({0x0028, 0x0010});
    const long long columns = count({0x0028, 0x0011});
    const bool counted = dataset.has({0x0028, 0x0008});
    const long long frames = counted ? count({0x0028, 0x0008}) : 1;
    result.dicom = true;
    result.image = rows > 0 && columns > 0;
    std::optional<double> repaired_by;
    const auto plane = plane_of(path, dataset.numbers({0x0020, 0x0032}), dataset.numbers({0x0020, 0x0037}),
                                true, repaired_by);
    result.slice = result.image && frames == 1 && plane.has_value();
    if (plane)
      for (std::size_t n = 0; n < 3; ++n) {
        result.axes[n] = plane->row[static_cast<Eigen::Index>(n)];
        result.axes[n + 3] = plane->column[static_cast<Eigen::Index>(n)];
      }
    result.localizer = dataset.text({0x0008, 0x0008}).find("LOCALIZER") != std::string::npos;
    result.series_uid = dataset.text({0x0020, 0x000E});
    result.instance_uid = dataset.text({0x0008, 0x0018});
    result.modality = dataset.text({0x0008, 0x0060});
    result.size = std::to_string(columns) + " x " + std::to_string(rows) +
                  (frames > 1 ? " x " + std::to_string(frames) + " frames" : "");
  } catch (const core::Error& error) {
    result.dicom = error.code() != "unsupported";
  }
  return result;
}

}  // namespace palpate::imaging::reading
