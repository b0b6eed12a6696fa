#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "scan_options.hpp"

#include "palpate/core/error.hpp"
#include "palpate/surface/extract.hpp"

namespace palpate::cli {
int run_simulate(const Call& call) {
  CommonOptions common;
  SimulationOptions simulation;
  auto& scan = simulation.scan;
  std::string output;
  OptionSet options(
      "simulate", "simulate [options] PATH",
      "Simulates the tissue of a scan without a display. Without --steps and --seconds it runs to "
      "the end of the gesture, or 100 steps.");
  options.positional("PATH", 1, scan.paths);
  options.text("-o", "POINTS.vtp", "writes points and links with their displacement", output);
  add_scan_options(options, scan);
  add_tissue_options(options, scan);
  add_simulation_options(options, simulation);
  add_common(options, common);
  options.example(
      "palpate-cli simulate data/sample-heart.mha --threshold 80 --seconds 0.5 --gravity 0,0,-9810 --json");
  options.example("palpate-cli simulate scan.mha --gesture pull.json --surface pulled.stl");
  if (parse_or_help(options, call)) return 0;
  simulation.scan.filter_options.device = common.device;
  take_path(scan, "simulate");
  if (!output.empty()) check_output("-o", output, {".vtp"});
  check_apart({{"-o", output},
               {"--surface", simulation.surface_path},
               {"--save-recipe", simulation.save_recipe_path}});
  check_request(simulation, common.device);

  const auto progress = call.console.progress();
  Prepared prepared = prepare_tissue(scan, call.console, progress.part(0.0, 0.4));
  if (!simulation.surface_path.empty() || scan.recipe.surface.mesh)
    prepare_surface(prepared, scan, true, call.console, progress.part(0.4, 0.5));
  const auto result = run_request(simulation, prepared, call.console, progress.part(0.5, 0.95));
  const auto object = to_json(result, prepared, scan.recipe);
  const auto table = table_of(result, prepared);
  const std::string heading = "Tissue of " + scan.recipe.input.path.string();
  if (result.diverged) {
    // The exit code speaks of the run; files of a run that failed would mislead.
    call.console.result(object, heading, table);
    throw_diverged(result);
  }
  progress.report(0.95, "Writing");
  if (!output.empty()) surface::save_points(output, *prepared.tissue.tissue, result.state.positions_mm);
  if (!simulation.surface_path.empty())
    write_surface(simulation.surface_path, prepared, result.surface.get());
  if (!simulation.save_recipe_path.empty()) session::save_recipe(simulation.save_recipe_path, scan.recipe);
  call.console.result(object, heading, table);
  return 0;
}

}  // namespace palpate::cli
