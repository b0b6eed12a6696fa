#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "scan_options.hpp"
#include "values.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::cli {
namespace {

std::string three(const Eigen::Vector3d& vector) {
  return shown(vector.x(), 6) + " x " + shown(vector.y(), 6) + " x " + shown(vector.z(), 6);
}

Table table_of(const core::VolumeInfo& info) {
  Table table;
  const auto& dims = info.geometry.dims();
  table.emplace_back("Format", info.format + (info.modality.empty() ? "" : ", " + info.modality));
  if (!info.series_uid.empty()) table.emplace_back("Series", info.series_uid);
  table.emplace_back("Voxels", std::to_string(dims[0]) + " x " + std::to_string(dims[1]) + " x " +
                                   std::to_string(dims[2]) + " " + info.pixel_type +
                                   (info.components > 1 ? " x " + std::to_string(info.components) : ""));
  if (info.frames > 1) table.emplace_back("Frames", std::to_string(info.frames));
  table.emplace_back("Spacing", three(info.geometry.spacing_mm()) +
                                    (info.spacing_is_assumed()
                                         ? " (assumed)"
                                         : " mm (" + core::to_string(info.spacing_provenance[0]) + ")"));
  const auto& origin = info.geometry.origin_mm();
  table.emplace_back("Origin", shown(origin.x(), 6) + ", " + shown(origin.y(), 6) + ", " +
                                   shown(origin.z(), 6) + " mm LPS (" +
                                   core::to_string(info.origin_provenance) + ")");
  table.emplace_back("Direction", core::to_string(info.direction_provenance));
  table.emplace_back("Values", shown(info.min) + " to " + shown(info.max) + ", mean " + shown(info.mean));
  for (const auto& warning : info.warnings) table.emplace_back("Warning", warning.text);
  return table;
}

Json to_json(const imaging::InputReport& report) {
  Json object;
  object["path"] = report.path.string();
  object["ok"] = report.ok;
  object["error"] =
      report.ok ? Json(nullptr) : Json({{"code", report.error_code}, {"text", report.error_text}});
  Json volumes = Json::array();
  for (const auto& info : report.volumes) volumes.push_back(Json::parse(imaging::volume_info_json(info)));
  object["volumes"] = volumes;
  return object;
}

std::string to_text(const imaging::InputReport& report) {
  std::string text = report.path.string() + "\n";
  if (!report.ok) return text + "  cannot be read: " + report.error_text + "\n";
  for (const auto& info : report.volumes) text += table_text(table_of(info));
  return text;
}

}  // namespace

int run_info(const Call& call) {
  CommonOptions common;
  ScanOptions scan;
  OptionSet options("info", "info [options] PATH...",
                    "Says what is in files and folders: one entry per series and per other file.");
  options.positional("PATH", 100000, scan.paths);
  add_reading_options(options, scan);
  add_common(options, common);
  options.example("palpate-cli info data/sample-heart.mha");
  options.example("palpate-cli info --json scans/");
  if (parse_or_help(options, call)) return 0;
  if (scan.paths.empty()) core::throw_usage("info needs a file or a folder. See palpate-cli info --help.");

  const std::vector<std::filesystem::path> paths(scan.paths.begin(), scan.paths.end());
  const auto progress = call.console.progress();
  const auto reports = imaging::inspect(paths, read_options(scan), progress);
  progress.cancel().check();
  Json list = Json::array();
  std::string text;
  for (const auto& report : reports) {
    list.push_back(to_json(report));
    text += to_text(report);
  }
  if (reports.empty()) text = "There are no files there.\n";
  Json object;
  object["inputs"] = list;
  call.console.result(object, text);
  const bool any = std::any_of(reports.begin(), reports.end(), [](const auto& report) { return report.ok; });
  return any ? 0 : static_cast<int>(core::ErrorKind::input);
}

}  // namespace palpate::cli
