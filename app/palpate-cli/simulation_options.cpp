#include "outputs.hpp"
#include "scan_options.hpp"
#include "values.hpp"

#include "palpate/compute/device.hpp"
#include "palpate/core/error.hpp"
#include "palpate/simulation/sag.hpp"

#include <cmath>

namespace palpate::cli {
namespace {

constexpr long standard_steps = 100;
const std::vector<std::string> mesh_endings{".vtp", ".stl", ".ply", ".obj"};

session::AnchorSettings parse_anchors(const std::string& text) {
  session::AnchorSettings anchors;
  if (text == "none") return anchors;
  if (text == "border") {
    anchors.rule = session::AnchorSettings::Rule::border;
    return anchors;
  }
  std::error_code ignored;
  // A word that is no file is a slip of the pen; a path is for the reader to miss.
  if (text.find_first_of("./") == std::string::npos && !std::filesystem::exists(text, ignored))
    core::throw_usage("none, border or the file of a label image is needed; there is no file \"" + text +
                      "\".");
  anchors.rule = session::AnchorSettings::Rule::file;
  anchors.file = text;
  return anchors;
}

session::IntensityScaling parse_scaling(const std::string& text) {
  session::IntensityScaling scaling;
  if (text == "none") return scaling;
  for (const auto& word : split(text, ',')) {
    parse_choice(word, {"stiffness", "damping", "drag", "mass", "none"});
    if (word == "none") core::throw_usage("\"none\" stands alone; it cannot be joined with others.");
    scaling.stiffness |= word == "stiffness";
    scaling.damping |= word == "damping";
    scaling.drag |= word == "drag";
    scaling.mass |= word == "mass";
  }
  return scaling;
}

void parse_beat(const std::string& text, simulation::Parameters& parameters) {
  const auto parts = split(text, ':');
  if (parts.size() != 2)
    core::throw_usage("PERIOD:AMPLITUDE is needed, such as 0.8:0.1, not \"" + text + "\".");
  parameters.beat_period_s = parse_number(parts[0], 0.05, 60.0, "s");
  parameters.beat_amplitude = parse_number(parts[1], 0.0, 0.5);
}

std::vector<std::string> integrator_words() {
  std::vector<std::string> words;
  for (const auto integrator : simulation::all_integrators())
    words.push_back(simulation::to_string(integrator));
  return words;
}

/// What is not alike everywhere, or changes with time.
void add_material_options(OptionSet& options, simulation::Parameters& parameters,
                          session::SimulationSettings& settings) {
  options.value("--mass", "M", "of every point, in units of the usual one, 0.001 to 1000 (default 1)",
                [&](const std::string& text) { parameters.mass = parse_number(text, 1e-3, 1e3); });
  options.value("--scale-by-intensity", "stiffness|damping|drag|mass|none",
                "multiplied by 0.5 to 1.5 from the darkest to the brightest tissue; several with commas "
                "(default none)",
                [&](const std::string& text) { settings.scaling = parse_scaling(text); });
  options.value("--anchor", "none|border|FILE",
                "points that never move: on the image's or crop's border, or where a label image is not 0 "
                "(default none)",
                [&](const std::string& text) { settings.anchors = parse_anchors(text); });
  options.value("--beat", "PERIOD:AMPLITUDE",
                "rest lengths shorten and recover each PERIOD (0.05 to 60 s), by up to AMPLITUDE (0 to 0.5) "
                "of them (default: no beat)",
                [&](const std::string& text) { parse_beat(text, parameters); });
}

void add_physics_options(OptionSet& options, simulation::Parameters& parameters,
                         session::SimulationSettings& settings) {
  options.section("Simulation");
  options.value("--stiffness", "K", "of the springs per unit mass, s^-2 (default 10000)",
                [&](const std::string& text) { parameters.stiffness_per_s2 = parse_number(text, 0.0, 1e9); });
  options.value("--damping", "C", "of the dampers per unit mass, s^-1 (default 3)",
                [&](const std::string& text) { parameters.damping_per_s = parse_number(text, 0.0, 1e6); });
  options.value("--drag", "D", "on every point, s^-1 (default 0.1)",
                [&](const std::string& text) { parameters.drag_per_s = parse_number(text, 0.0, 1e4); });
  options.value("--gravity", "X,Y,Z", "mm/s^2 in LPS (default 0,0,0)", [&](const std::string& text) {
    const auto gravity = parse_three(text, -1e6, 1e6);
    parameters.gravity_mm_per_s2 = {gravity[0], gravity[1], gravity[2]};
  });
  add_material_options(options, parameters, settings);
  options.value("--integrator", "NAME", join(integrator_words(), ", ") + " (default rk4)",
                [&](const std::string& text) {
                  parameters.integrator = simulation::integrator_of(parse_choice(text, integrator_words()));
                });
  options.value(
      "--layout", "auto|lattice|explicit", "how links lie in memory; the motion is the same (default auto)",
      [&](const std::string& text) {
        settings.layout = simulation::layout_of(parse_choice(text, {"auto", "lattice", "explicit"}));
      });
  options.value("--step", "H|auto", "time step in s, up to 1 (default auto: below the largest stable one)",
                [&](const std::string& text) {
                  if (text == "auto")
                    settings.step_s.reset();
                  else
                    settings.step_s = parse_number(text, 1e-9, 1.0, "s, or auto,");
                });
  options.later({"--displacement"});
}

}  // namespace

void add_simulation_options(OptionSet& options, SimulationOptions& simulation) {
  auto& recipe = simulation.scan.recipe;
  add_physics_options(options, recipe.simulation.parameters, recipe.simulation);
  options.value("--steps", "N", "steps to take", [&](const std::string& text) {
    simulation.request.steps = parse_whole(text, 0, 1000000000);
    simulation.steps_given = true;
  });
  options.value("--seconds", "T", "time to simulate, instead of --steps", [&](const std::string& text) {
    simulation.request.seconds = parse_number(text, 0.0, 1e6, "s");
    simulation.seconds_given = true;
  });
  options.text("--gesture", "FILE", "a recorded gesture (JSON) that is played", simulation.gesture_path);
  options.section("Surface");
  options.value("--surface-mapping", "none|triangle", "how the surface follows the points (default triangle)",
                [&](const std::string& text) {
                  const auto word = parse_choice(text, {"none", "triangle"},
                                                 {"one-to-one", "triangle-curved", "mixed", "normal-offset"});
                  recipe.surface.mapped = word == "triangle";
                });
  options.value("--mesh", "FILE", "a surface (.stl, .ply, .obj, .vtp, .vtk) instead of the scan's own",
                [&](const std::string& text) {
                  if (text.empty()) core::throw_usage("an empty name is not accepted.");
                  recipe.surface.mesh = text;
                });
  options.text("--surface", "OUT", "writes the deformed surface: .vtp, .stl, .ply or .obj",
               simulation.surface_path);
  options.section("Recipe");
  options.first_value("--recipe", "FILE",
                      "takes all parameters from a recipe; options on the line go before it",
                      [&](const std::string& text) { recipe = session::load_recipe(text); });
  options.text("--save-recipe", "FILE", "writes all parameters and the scan's checksum",
               simulation.save_recipe_path);
}

void check_request(SimulationOptions& simulation, const std::string& device) {
  const auto& recipe = simulation.scan.recipe;
  auto& request = simulation.request;
  request.device = device;
  if (simulation.steps_given && simulation.seconds_given)
    core::throw_usage("--steps and --seconds say the same thing; give one of them.");
  if (!simulation.surface_path.empty()) {
    if (!recipe.surface.mapped)
      core::throw_usage(
          "--surface: there is no surface to write with --surface-mapping none; take triangle.");
    check_output("--surface", simulation.surface_path, mesh_endings);
  }
  if (!simulation.save_recipe_path.empty())
    check_output("--save-recipe", simulation.save_recipe_path, {".json"});
  if (!simulation.gesture_path.empty()) request.gesture = interaction::load_gesture(simulation.gesture_path);
  std::error_code ignored;
  if (!std::filesystem::exists(recipe.input.path, ignored)) return;  // for the reader to say
  const bool any_steps = !request.steps || *request.steps > 0;
  if (any_steps && !compute::is_reference_selector(device)) compute::open_device(device);
}

session::RunResult run_request(const SimulationOptions& simulation, const Prepared& prepared,
                               Console& console, const core::Progress& progress) {
  const auto& recipe = simulation.scan.recipe;
  session::RunRequest request = simulation.request;
  if (!simulation.steps_given && !simulation.seconds_given) {
    if (request.gesture)
      request.seconds = request.gesture->end_s();
    else if (!request.steps)
      request.steps = standard_steps;
  }
  const auto& tissue = prepared.tissue;
  const auto sag =
      simulation::sag_under_gravity(*tissue.tissue, tissue.material.anchors, recipe.simulation.parameters);
  if (!std::isfinite(sag.strain))
    console.warn("too-soft", "Nothing holds the tissue against this gravity.");
  else if (sag.is_too_soft())
    console.warn("too-soft", "The tissue is too soft for this gravity: it would stretch by about " +
                                 shown(sag.sag_mm, 2) + " mm. It takes --stiffness " +
                                 shown(sag.stiffness_per_s2, 2) + " at least, or more that is anchored.");
  auto result = session::run(prepared.tissue, prepared.surface, recipe.simulation, request, progress);
  console.warn(result.warnings);
  if (result.recoveries > 0 && !result.diverged) console.warn("recovered", result.message);
  return result;
}

void write_surface(const std::string& path, const Prepared& prepared,
                   const surface::DeformedSurface* deformed) {
  core::TriangleMesh mesh = *prepared.surface.mesh;
  if (deformed != nullptr) {
    mesh.normals.resize(mesh.vertices_mm.size());
    for (std::size_t n = 0; n < mesh.vertices_mm.size(); ++n) {
      mesh.vertices_mm[n] = Eigen::Map<const Eigen::Vector3f>(deformed->vertices() + 3 * n);
      mesh.normals[n] = Eigen::Map<const Eigen::Vector3f>(deformed->normals() + 3 * n);
    }
  }
  surface::save_mesh(path, mesh);
}

Json to_json(const session::RunResult& result, const Prepared& prepared, const session::Recipe& recipe) {
  const auto& statistics = prepared.tissue.statistics;
  const double steps = static_cast<double>(result.steps);
  Json object;
  object["points"] = statistics.points;
  object["links"] = statistics.links;
  object["components"] = statistics.components;
  object["largest_component"] = statistics.largest_component;
  object["steps"] = result.steps;
  object["step_s"] = number(result.step_s);
  object["substeps"] = result.substeps;
  object["stable_step_s"] = number(result.stable_step_s);
  object["stable_step_kind"] = result.stable_step_is_estimate ? "estimate" : "bound";
  object["seconds"] = number(result.seconds);
  object["wall_s"] = number(result.wall_s);
  object["ms_per_step"] = number(result.steps > 0 ? result.wall_s * 1000.0 / steps : 0.0);
  object["realtime_factor"] = number(result.wall_s > 0.0 ? result.seconds / result.wall_s : 0.0);
  object["max_displacement_mm"] = number(result.max_displacement_mm);
  object["kinetic_energy"] = number(result.energy.kinetic);
  object["potential_energy"] = number(result.energy.potential);
  object["momentum"] = list_of(result.energy.momentum);
  object["anchors"] = prepared.tissue.material.anchors.size();
  object["recoveries"] = result.recoveries;
  object["diverged"] = result.diverged;
  if (!prepared.surface.space_reason.empty()) object["mesh_axes"] = prepared.surface.space_reason;
  object["integrator"] = result.integrator;
  object["layout"] = result.layout;
  object["layout_reason"] = result.layout_reason;
  object["device"] = result.device;
  object["driver"] = result.driver;
  object["recipe_sha256"] = session::recipe_sha256(recipe);
  return object;
}

Table table_of(const session::RunResult& result, const Prepared& prepared) {
  const auto& statistics = prepared.tissue.statistics;
  const double steps = static_cast<double>(result.steps);
  Table table;
  table.emplace_back("Points", shown_count(statistics.points));
  table.emplace_back("Links", shown_count(statistics.links));
  table.emplace_back("Pieces", shown_count(statistics.components) + ", the largest with " +
                                   shown_count(statistics.largest_component) + " points");
  if (!prepared.surface.space_reason.empty()) table.emplace_back("Mesh axes", prepared.surface.space_reason);
  table.emplace_back("Simulated", shown(result.seconds) + " s in " +
                                      shown_count(static_cast<std::uint64_t>(result.steps)) + " steps of " +
                                      shown(result.step_s * 1000.0) + " ms (stable up to " +
                                      shown(result.stable_step_s * 1000.0) + " ms)");
  if (result.steps > 0)
    table.emplace_back("Took", shown(result.wall_s, 3) + " s, " + shown(result.wall_s * 1000.0 / steps, 3) +
                                   " ms a step, " + shown(result.seconds / result.wall_s, 3) +
                                   " times real time");
  table.emplace_back("Farthest moved", shown(result.max_displacement_mm) + " mm");
  table.emplace_back("Kinetic energy", shown(result.energy.kinetic) + " mm^2/s^2");
  table.emplace_back("Potential energy", shown(result.energy.potential) + " mm^2/s^2");
  if (const auto anchors = prepared.tissue.material.anchors.size(); anchors > 0)
    table.emplace_back("Anchored", shown_count(anchors) + " points");
  table.emplace_back("Recoveries", std::to_string(result.recoveries));
  table.emplace_back("Method", result.integrator + ", " + result.layout + " links");
  if (!result.layout_reason.empty()) table.emplace_back("Why so", result.layout_reason);
  table.emplace_back("Device", result.device);
  return table;
}

void throw_diverged(const session::RunResult& result) {
  throw core::Error(core::ErrorKind::diverged, "diverged", result.message);
}

}  // namespace palpate::cli
