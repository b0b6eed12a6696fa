#pragma once

#include "console.hpp"
#include "options.hpp"

#include "palpate/session/pipeline.hpp"
#include "palpate/session/recipe.hpp"
#include "palpate/session/run.hpp"

#include <string>
#include <vector>

namespace palpate::cli {

/// The options that subcommands share, and the recipe that they fill.
struct ScanOptions {
  session::Recipe recipe;
  imaging::FilterOptions filter_options;
  std::vector<std::string> paths;
  bool frame_given = false;
  bool filters_given = false;
};
/// --series, --frame, --spacing, --orientation, --grid-spacing, --allow-truncated.
void add_reading_options(OptionSet& options, ScanOptions& scan);
/// The above, --filter and --crop.
void add_scan_options(OptionSet& options, ScanOptions& scan);
void add_tissue_options(OptionSet& options, ScanOptions& scan);

/// What simulate and render have in common.
struct SimulationOptions {
  ScanOptions scan;
  session::RunRequest request;
  bool steps_given = false, seconds_given = false;
  std::string gesture_path, surface_path, save_recipe_path;
};
void add_simulation_options(OptionSet& options, SimulationOptions& simulation);

/// The one input of a subcommand; refuses none.
void take_path(ScanOptions& scan, const std::string& command);
imaging::ReadOptions read_options(const ScanOptions& scan);

/// Everything before the run.
struct Prepared {
  core::VolumeInfo info;
  core::Volume filtered;
  session::BuiltTissue tissue;
  session::BoundSurface surface;
};
/// Reads and filters; notes the input's checksum in the recipe.
Prepared prepare_volume(ScanOptions& scan, Console& console, const core::Progress& progress);
/// And builds the tissue.
Prepared prepare_tissue(ScanOptions& scan, Console& console, const core::Progress& progress);
/// The surface; where a scan gives none and `needed` is not set, a warning.
void prepare_surface(Prepared& prepared, const ScanOptions& scan, bool needed, Console& console,
                     const core::Progress& progress);

/// Checks what can be checked before the long work: outputs, gesture, device.
void check_request(SimulationOptions& simulation, const std::string& device);
/// Runs. Its warnings go to the console.
session::RunResult run_request(const SimulationOptions& simulation, const Prepared& prepared,
                               Console& console, const core::Progress& progress);
/// The surface as the run left it; at rest where `deformed` is null.
void write_surface(const std::string& path, const Prepared& prepared,
                   const surface::DeformedSurface* deformed);
Json to_json(const session::RunResult& result, const Prepared& prepared, const session::Recipe& recipe);
Table table_of(const session::RunResult& result, const Prepared& prepared);
/// Error(diverged), for the exit code after the result was printed.
[[noreturn]] void throw_diverged(const session::RunResult& result);

/// Numbers of a vector, as JSON.
Json list_of(const Eigen::Vector3d& vector);

}  // namespace palpate::cli
