#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "scan_options.hpp"
#include "values.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/speckle.hpp"
#include "palpate/imaging/writer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>

namespace palpate::cli {
namespace {

int print_list(const Call& call) {
  Json list = Json::array();
  std::string text;
  for (const auto& filter : imaging::filters()) {
    Json parameters = Json::array();
    Table table;
    for (const auto& parameter : filter.parameters) {
      Json one;
      one["name"] = parameter.name;
      one["text"] = parameter.text;
      one["default"] = parameter.standard;
      one["min"] = parameter.min;
      one["max"] = parameter.max;
      one["whole_number"] = parameter.whole_number;
      one["unit"] = parameter.unit;
      parameters.push_back(one);
      const std::string unit = parameter.unit.empty() ? "" : " " + parameter.unit;
      table.emplace_back(parameter.name, parameter.text + ", " + shown(parameter.min) + " to " +
                                             shown(parameter.max) + unit + " (default " +
                                             shown(parameter.standard) + ")");
    }
    Json object;
    object["name"] = filter.name;
    object["text"] = filter.text;
    object["parameters"] = parameters;
    list.push_back(object);
    text += filter.name + ": " + filter.text + "\n" + table_text(table);
  }
  Json object;
  object["filters"] = list;
  call.console.result(object, text);
  return 0;
}

/// The voxels of the box, in a volume of their own that lies at the same place.
core::Volume cropped(const core::Volume& volume, const model::CropBox& box) {
  std::array<int, 3> begin{};
  std::array<int, 3> dims{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    begin[axis] = std::min(box.begin[axis], volume.dims()[axis]);
    dims[axis] = std::min(box.end[axis], volume.dims()[axis]) - begin[axis];
    if (dims[axis] < 1)
      core::throw_usage("--crop: the box lies outside the volume of " + std::to_string(volume.dims()[0]) +
                        " x " + std::to_string(volume.dims()[1]) + " x " + std::to_string(volume.dims()[2]) +
                        " voxels.");
  }
  const auto& whole = volume.geometry();
  const core::ImageGeometry geometry(
      dims, whole.spacing_mm(),
      whole.to_lps_mm(
          {static_cast<double>(begin[0]), static_cast<double>(begin[1]), static_cast<double>(begin[2])}),
      whole.direction());
  std::vector<float> voxels;
  voxels.reserve(geometry.voxel_count());
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j) {
      const float* row = volume.data() + whole.index(begin[0], begin[1] + j, begin[2] + k);
      voxels.insert(voxels.end(), row, row + dims[0]);
    }
  return {geometry, std::move(voxels)};
}

/// Whole numbers stay whole through a median; other filters make fractions.
std::string pixel_type_of(const core::VolumeInfo& info, const std::vector<imaging::FilterStep>& chain) {
  const bool kept =
      std::all_of(chain.begin(), chain.end(), [](const auto& step) { return step.name == "median"; });
  return kept && info.pixel_type == "uint8" && info.components == 1 ? "uint8" : "float32";
}

/// The times of the frames that were read; none where they are not known, or
/// do not rise and so tell nothing.
std::vector<double> times_of(const core::VolumeSequence& sequence) {
  const auto& times = sequence.info.frame_times_s;
  const auto first = static_cast<std::size_t>(sequence.first_frame);
  if (times.size() < first + sequence.frames.size()) return {};
  const auto begin = times.begin() + sequence.first_frame;
  const auto end = begin + static_cast<std::ptrdiff_t>(sequence.frames.size());
  if (std::adjacent_find(begin, end, std::greater_equal<>()) != end) return {};
  return {begin, end};
}

/// Of the first frame, at the same places.
struct Speckle {
  imaging::SpeckleStatistics before, after;
};

/// Every frame in its turn; what is warned of is the same in each.
Speckle filter_frames(core::VolumeSequence& sequence, const ScanOptions& scan, const Call& call,
                      const core::Progress& progress) {
  Speckle speckle;
  const double count = static_cast<double>(sequence.frames.size());
  for (std::size_t n = 0; n < sequence.frames.size(); ++n) {
    const auto part = progress.part(static_cast<double>(n) / count, static_cast<double>(n + 1) / count);
    const core::Volume source = sequence.frames[n];
    const auto filtered =
        session::filter_volume(source, scan.recipe.filters, scan.filter_options, part.part(0.0, 0.9));
    if (n == 0) {
      call.console.warn(filtered.warnings);
      speckle.before = imaging::measure_speckle(source, part.part(0.9, 0.95));
      speckle.after = imaging::measure_speckle(filtered.volume, source, part.part(0.95, 1.0));
    }
    sequence.frames[n] =
        scan.recipe.tissue.crop ? cropped(filtered.volume, *scan.recipe.tissue.crop) : filtered.volume;
  }
  return speckle;
}

Json to_json(const imaging::SpeckleStatistics& speckle) {
  const auto measured = [&](double value) { return speckle.blocks > 0 ? number(value) : Json(nullptr); };
  Json object;
  object["mean"] = measured(speckle.mean);
  object["deviation"] = measured(speckle.deviation);
  object["snr"] = measured(speckle.snr);
  object["looks"] = measured(speckle.looks);
  object["blocks"] = speckle.blocks;
  object["tissue_blocks"] = speckle.tissue_blocks;
  object["block_voxels"] = speckle.block_voxels;
  object["threshold"] = number(speckle.threshold);
  object["bright"] = number(speckle.bright);
  object["dark"] = number(speckle.dark);
  object["contrast"] = number(speckle.contrast);
  object["cnr"] = number(speckle.cnr);
  return object;
}

void add_speckle(Table& table, const Speckle& speckle) {
  const auto change = [](double before, double after, int digits) {
    return shown(before, digits) + " -> " + shown(after, digits);
  };
  if (speckle.before.blocks == 0) {
    table.emplace_back("Speckle", "no even tissue to measure it in");
  } else {
    table.emplace_back("Speckle SNR", change(speckle.before.snr, speckle.after.snr, 3) + " (in the " +
                                          std::to_string(speckle.before.blocks) + " most even blocks)");
    table.emplace_back("Deviation", change(speckle.before.deviation, speckle.after.deviation, 3));
    table.emplace_back("Looks", change(speckle.before.looks, speckle.after.looks, 3));
  }
  table.emplace_back("Contrast to noise", change(speckle.before.cnr, speckle.after.cnr, 3));
}

/// Of all frames.
core::IntensityRange range_of(const std::vector<core::Volume>& frames) {
  core::IntensityRange range = frames.front().range();
  double sum = 0.0;
  for (const auto& frame : frames) {
    range.min = std::min(range.min, frame.range().min);
    range.max = std::max(range.max, frame.range().max);
    sum += frame.range().mean;
  }
  range.mean = sum / static_cast<double>(frames.size());
  return range;
}

int filter_scan(ScanOptions& scan, const std::string& output, const Call& call) {
  take_path(scan, "filter");
  if (output.empty()) core::throw_usage("filter needs -o OUT, the file to write.");
  check_output("-o", output, {".mha", ".mhd", ".nrrd", ".nii", ".nii.gz", ".dcm"}, {});
  const auto start = std::chrono::steady_clock::now();
  const auto progress = call.console.progress();
  auto sequence = imaging::read(scan.recipe.input.path, read_options(scan), progress.part(0.0, 0.3));
  call.console.warn(sequence.info.warnings);
  if (sequence.info.spacing_is_assumed())
    call.console.warn("assumed-spacing-written",
                      output +
                          " will say 1 mm where nothing is known, and no program that reads it can tell. "
                          "Give the spacing by --spacing.");
  const Speckle speckle = filter_frames(sequence, scan, call, progress.part(0.3, 0.8));
  imaging::WriteOptions write_options;
  write_options.pixel_type = pixel_type_of(sequence.info, scan.recipe.filters);
  write_options.frame_times_s = times_of(sequence);
  write_options.dicom.patient_axes = sequence.info.patient_axes;
  for (const auto& step : scan.recipe.filters)
    write_options.dicom.derivation +=
        (write_options.dicom.derivation.empty() ? "" : ", then ") + imaging::to_string(step);
  imaging::write(output, sequence.frames, 0.0, write_options, progress.part(0.8, 1.0));

  const auto& first = sequence.frames.front();
  const auto range = range_of(sequence.frames);
  Json object;
  object["output"] = output;
  Json names = Json::array();
  for (const auto& step : scan.recipe.filters) names.push_back(imaging::to_string(step));
  object["filters"] = names;
  object["dims"] = first.dims();
  object["spacing_mm"] = list_of(first.geometry().spacing_mm());
  object["frames"] = sequence.frames.size();
  object["pixel_type"] = write_options.pixel_type;
  object["min"] = number(range.min);
  object["max"] = number(range.max);
  object["mean"] = number(range.mean);
  object["speckle_before"] = to_json(speckle.before);
  object["speckle_after"] = to_json(speckle.after);
  object["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  Table table;
  table.emplace_back(
      "Filters", scan.recipe.filters.empty() ? "none" : join(names.get<std::vector<std::string>>(), ", "));
  table.emplace_back("Voxels", std::to_string(first.dims()[0]) + " x " + std::to_string(first.dims()[1]) +
                                   " x " + std::to_string(first.dims()[2]) + " " + write_options.pixel_type);
  table.emplace_back("Values", shown(range.min) + " to " + shown(range.max) + ", mean " + shown(range.mean));
  add_speckle(table, speckle);
  call.console.result(object, "Wrote " + output, table);
  return 0;
}

}  // namespace

int run_filter(const Call& call) {
  CommonOptions common;
  ScanOptions scan;
  std::string output;
  bool list = false;
  OptionSet options(
      "filter", "filter [options] PATH -o OUT",
      "Applies filters in the order given and writes the volume; without a filter it converts.");
  options.positional("PATH", 1, scan.paths);
  options.text("-o", "OUT",
               "the file to write: .mha, .mhd, .nrrd, .nii, .nii.gz or .dcm (Enhanced US Volume)", output);
  options.flag("--list", "prints the filters and their parameters", list);
  add_scan_options(options, scan);
  add_common(options, common);
  options.example("palpate-cli filter data/sample-heart.mha --filter median:radius=1 -o smooth.mha");
  options.example("palpate-cli filter --list");
  if (parse_or_help(options, call)) return 0;
  scan.filter_options.device = common.device;
  return list ? print_list(call) : filter_scan(scan, output, call);
}

}  // namespace palpate::cli
