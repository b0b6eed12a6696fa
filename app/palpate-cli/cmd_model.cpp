#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "scan_options.hpp"
#include "values.hpp"

#include "palpate/core/error.hpp"
#include "palpate/surface/extract.hpp"

#include <chrono>
#include <cmath>
#include <optional>

namespace palpate::cli {
namespace {

/// What is printed of a tissue, built or estimated.
struct Counted {
  model::TissueStatistics statistics;
  double stable_step_s = 0.0;
  double build_s = 0.0;
  std::optional<double> threshold_low;  ///< none where a mask alone says what tissue is
  bool on_lattice = true;
  bool estimated = false;
};

Json to_json(const Counted& counted) {
  const auto& statistics = counted.statistics;
  Json object;
  object["points"] = statistics.points;
  object["links"] = statistics.links;
  object["links_per_point"]["min"] = statistics.min_links_per_point;
  object["links_per_point"]["mean"] = number(statistics.mean_links_per_point);
  object["links_per_point"]["max"] = statistics.max_links_per_point;
  object["components"] = statistics.components;
  object["largest_component"] = statistics.largest_component;
  object["isolated"] = statistics.isolated;
  object["bounds_mm"] = Json::array({list_of(statistics.bounds_min_mm), list_of(statistics.bounds_max_mm)});
  object["stable_step_s"] = number(counted.stable_step_s);
  object["bytes"] = statistics.bytes;
  object["build_s"] = number(counted.build_s);
  object["threshold_low"] = counted.threshold_low ? number(*counted.threshold_low) : Json(nullptr);
  object["on_lattice"] = counted.on_lattice;
  object["estimated"] = counted.estimated;
  return object;
}

Table table_of(const Counted& counted) {
  const auto& statistics = counted.statistics;
  const std::string about = counted.estimated ? "about " : "";
  Table table;
  table.emplace_back("Threshold", counted.threshold_low ? shown(*counted.threshold_low) + " and above"
                                                        : std::string("none: all of the mask"));
  table.emplace_back("Points", shown_count(statistics.points));
  table.emplace_back("Links", about + shown_count(statistics.links) + ", " +
                                  shown(statistics.mean_links_per_point, 3) + " a point (" +
                                  std::to_string(statistics.min_links_per_point) + " to " +
                                  std::to_string(statistics.max_links_per_point) + ")");
  table.emplace_back("Pieces", about + shown_count(statistics.components) + ", the largest with " +
                                   shown_count(statistics.largest_component) + " points, " +
                                   shown_count(statistics.isolated) + " single points");
  const Eigen::Vector3d size = statistics.bounds_max_mm - statistics.bounds_min_mm;
  table.emplace_back("Size", shown(size.x()) + " x " + shown(size.y()) + " x " + shown(size.z()) + " mm");
  table.emplace_back("Largest stable step", about + shown(counted.stable_step_s * 1000.0) + " ms");
  table.emplace_back("Memory", about + shown_bytes(static_cast<double>(statistics.bytes)));
  table.emplace_back(counted.estimated ? "Estimated in" : "Built in", shown(counted.build_s, 3) + " s");
  return table;
}

std::optional<double> threshold_of(const session::Recipe& recipe, double used) {
  if (recipe.mask.path && !recipe.tissue.threshold_low) return std::nullopt;
  return used;
}

Counted estimated(ScanOptions& scan, Console& console, const core::Progress& progress) {
  const auto prepared = prepare_volume(scan, console, progress.part(0.0, 0.5));
  const auto start = std::chrono::steady_clock::now();
  const auto estimate = session::estimate_tissue(prepared.filtered, scan.recipe, progress.part(0.5, 1.0));
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  console.warn(estimate.warnings);
  return {estimate.tissue.statistics,
          estimate.stable_step.step_s,
          wall.count(),
          threshold_of(scan.recipe, estimate.threshold_low),
          estimate.tissue.sample.on_lattice,
          estimate.tissue.sampled};
}

}  // namespace

int run_model(const Call& call) {
  CommonOptions common;
  ScanOptions scan;
  std::string output;
  bool estimate = false;
  OptionSet options(
      "model", "model [options] PATH [-o OUT.vtp]",
      "Makes tissue of a scan: a point mass for each voxel of a threshold range or a mask, joined by links.");
  options.positional("PATH", 1, scan.paths);
  options.text("-o", "OUT.vtp", "writes points and links", output);
  options.flag("--estimate", "counts from a sample without building; the points are exact", estimate);
  add_scan_options(options, scan);
  add_tissue_options(options, scan);
  add_common(options, common);
  options.example("palpate-cli model data/sample-heart.mha --threshold 80 --min-component 100 -o heart.vtp");
  options.example("palpate-cli model scan.mha --mask labels.mha:2 --links lattice18");
  if (parse_or_help(options, call)) return 0;
  scan.filter_options.device = common.device;
  take_path(scan, "model");
  if (!output.empty()) {
    if (estimate)
      core::throw_usage("-o: --estimate builds nothing that could be written; leave one of them out.");
    check_output("-o", output, {".vtp"});
  }

  const auto progress = call.console.progress();
  if (estimate) {
    const auto counted = estimated(scan, call.console, progress);
    call.console.result(to_json(counted), "Tissue of " + scan.recipe.input.path.string(), table_of(counted));
    return 0;
  }
  const auto prepared = prepare_tissue(scan, call.console, progress.part(0.0, 0.9));
  if (!output.empty()) {
    progress.report(0.9, "Writing");
    surface::save_points(output, *prepared.tissue.tissue, prepared.tissue.tissue->points.positions_mm);
  }
  const Counted counted{prepared.tissue.statistics,
                        prepared.tissue.stable_step.step_s,
                        prepared.tissue.build_s,
                        threshold_of(scan.recipe, prepared.tissue.threshold_low),
                        prepared.tissue.tissue->on_lattice,
                        false};
  call.console.result(to_json(counted), "Tissue of " + scan.recipe.input.path.string(), table_of(counted));
  return 0;
}

}  // namespace palpate::cli
