#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "scan_options.hpp"
#include "values.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <system_error>

namespace palpate::cli {
namespace {

std::string three(const Eigen::Vector3d& vector, int digits = 6) {
  return shown(vector.x(), digits) + " x " + shown(vector.y(), digits) + " x " + shown(vector.z(), digits);
}

std::string size_of(const core::VolumeInfo& info) {
  const auto& dims = info.geometry.dims();
  return std::to_string(dims[0]) + " x " + std::to_string(dims[1]) + " x " + std::to_string(dims[2]);
}

/// One word where all axes agree, else one each.
std::string source_of(const std::array<core::Provenance, 3>& axes) {
  const std::string first = core::to_string(axes[0]);
  if (axes[0] == axes[1] && axes[1] == axes[2]) return first;
  return first + ", " + core::to_string(axes[1]) + ", " + core::to_string(axes[2]);
}

std::string frames_of(const core::VolumeInfo& info) {
  std::string text = std::to_string(info.frames);
  if (info.frame_times_s.size() > 1)
    text += ", " + shown(info.frame_times_s.back() - info.frame_times_s.front()) + " s (" +
            core::to_string(info.time_provenance) + ")";
  return text;
}

std::string orientation_of(const core::VolumeInfo& info) {
  std::string text = info.orientation + " (" + core::to_string(info.direction_provenance) + ")";
  if (!info.orientation_choices.empty())
    text += "; in use for such files: " + join(info.orientation_choices, ", ") + " (--orientation)";
  return text;
}

Table table_of(const core::VolumeInfo& info) {
  Table table;
  table.emplace_back("Format", info.format + (info.modality.empty() ? "" : ", " + info.modality));
  if (!info.series_uid.empty()) table.emplace_back("Series", info.series_uid);
  if (!info.description.empty()) table.emplace_back("Description", info.description);
  if (!info.date.empty()) table.emplace_back("Date", info.date);
  if (!info.scanner.empty()) table.emplace_back("Scanner", info.scanner);
  table.emplace_back("Voxels", size_of(info) + " " + info.pixel_type +
                                   (info.components > 1 ? " x " + std::to_string(info.components) : ""));
  if (info.frames > 1) table.emplace_back("Frames", frames_of(info));
  table.emplace_back("Spacing", three(info.geometry.spacing_mm()) +
                                    (info.spacing_is_assumed() ? " (" : " mm (") +
                                    source_of(info.spacing_provenance) + ")");
  const auto& origin = info.geometry.origin_mm();
  table.emplace_back("Origin", shown(origin.x(), 6) + ", " + shown(origin.y(), 6) + ", " +
                                   shown(origin.z(), 6) + " mm LPS (" +
                                   core::to_string(info.origin_provenance) + ")");
  table.emplace_back("Orientation", orientation_of(info));
  table.emplace_back("Values", shown(info.min) + " to " + shown(info.max) + ", mean " + shown(info.mean));
  for (const auto& warning : info.warnings) table.emplace_back("Warning", warning.text);
  return table;
}

Json to_json(const imaging::InputReport& report, bool headers_only) {
  Json object;
  object["path"] = report.path.string();
  object["ok"] = report.ok;
  object["error"] =
      report.ok ? Json(nullptr) : Json({{"code", report.error_code}, {"text", report.error_text}});
  Json volumes = Json::array();
  for (const auto& info : report.volumes) {
    volumes.push_back(Json::parse(imaging::volume_info_json(info)));
    if (headers_only)
      for (const char* key : {"min", "max", "mean"}) volumes.back()[key] = nullptr;
  }
  object["volumes"] = volumes;
  return object;
}

std::string to_text(const imaging::InputReport& report) {
  std::string text = report.path.string() + "\n";
  if (!report.ok) return text + "  cannot be read: " + report.error_text + "\n";
  for (const auto& info : report.volumes) text += table_text(table_of(info));
  return text;
}

/// A series of several files, which its folder may hold others beside.
bool in_folder(const imaging::InputReport& report) {
  std::error_code error;
  return !report.volumes.front().series_uid.empty() && std::filesystem::is_directory(report.path, error);
}

/// A line a series, in columns.
std::string overview(const std::vector<imaging::InputReport>& reports) {
  std::vector<std::array<std::string, 6>> rows{{"Kind", "Voxels", "Frames", "Spacing", "Date", "Path"}};
  for (const auto& report : reports) {
    if (!report.ok) {
      rows.push_back({"-", "cannot be read", "", "", "", report.path.string() + ": " + report.error_code});
      continue;
    }
    for (const auto& info : report.volumes)
      rows.push_back({info.modality.empty() ? info.format : info.modality, size_of(info),
                      std::to_string(info.frames),
                      info.spacing_is_assumed() ? "unknown" : three(info.geometry.spacing_mm(), 4) + " mm",
                      info.date.empty() ? "-" : info.date,
                      report.path.string() + (in_folder(report) ? " --series " + info.series_uid : "")});
  }
  std::array<std::size_t, 6> widths{};
  for (const auto& row : rows)
    for (std::size_t column = 0; column < row.size(); ++column)
      widths[column] = std::max(widths[column], row[column].size());
  std::string text;
  for (const auto& row : rows) {
    for (std::size_t column = 0; column + 1 < row.size(); ++column)
      text += row[column] + std::string(widths[column] + 2 - row[column].size(), ' ');
    text += row.back() + "\n";
  }
  return text;
}

}  // namespace

int run_info(const Call& call) {
  CommonOptions common;
  ScanOptions scan;
  bool headers_only = false;
  OptionSet options("info", "info [options] PATH...",
                    "Says what is in files and folders: one entry per series and per other file.");
  options.positional("PATH", 100000, scan.paths);
  add_reading_options(options, scan);
  options.section("Info");
  options.flag("--headers-only", "do not decode pixels: at once, without the values' range", headers_only);
  add_common(options, common);
  options.example("palpate-cli info data/sample-heart.mha");
  options.example("palpate-cli info --json scans/");
  options.example("palpate-cli info --headers-only scans/");
  if (parse_or_help(options, call)) return 0;
  if (scan.paths.empty()) core::throw_usage("info needs a file or a folder. See palpate-cli info --help.");

  const std::vector<std::filesystem::path> paths(scan.paths.begin(), scan.paths.end());
  const auto progress = call.console.progress();
  const auto reports = headers_only ? imaging::inspect_headers(paths, read_options(scan), progress)
                                    : imaging::inspect(paths, read_options(scan), progress);
  progress.cancel().check();
  Json list = Json::array();
  std::string text;
  for (const auto& report : reports) {
    list.push_back(to_json(report, headers_only));
    if (!headers_only) text += to_text(report);
  }
  if (headers_only) text = overview(reports);
  if (reports.empty()) text = "There are no files there.\n";
  Json object;
  object["inputs"] = list;
  object["sandbox"] = imaging::reader_sandbox();
  call.console.result(object, text);
  const bool any = std::any_of(reports.begin(), reports.end(), [](const auto& report) { return report.ok; });
  return any ? 0 : static_cast<int>(core::ErrorKind::input);
}

}  // namespace palpate::cli
