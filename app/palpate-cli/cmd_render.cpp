#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "scan_options.hpp"
#include "values.hpp"

#include "palpate/core/error.hpp"
#include "palpate/surface/extract.hpp"
#include "palpate/visualization/picture.hpp"

#include <array>

namespace palpate::cli {
namespace {

namespace vis = visualization;

struct PictureOptions {
  std::string output, background;
  vis::PictureRequest request;
  vis::Show show = vis::Show::surface;
  std::string view = "four-up", show_word = "surface";
  bool transparent = false;
  std::array<float, 3> ground{0.0F, 0.0F, 0.0F};
};

std::array<float, 3> parse_colour(const std::string& text) {
  if (text == "black") return {0.0F, 0.0F, 0.0F};
  if (text == "white") return {1.0F, 1.0F, 1.0F};
  if (text.size() != 7 || text[0] != '#' ||
      text.find_first_not_of("0123456789abcdefABCDEF", 1) != std::string::npos)
    core::throw_usage("black, white or #RRGGBB is needed, not \"" + text + "\".");
  std::array<float, 3> colour{};
  for (std::size_t n = 0; n < 3; ++n)
    colour[n] = static_cast<float>(std::stoi(text.substr(1 + 2 * n, 2), nullptr, 16)) / 255.0F;
  return colour;
}

void parse_size(const std::string& text, vis::PictureRequest& request) {
  const auto sides = split(text, 'x');
  if (sides.size() != 2) core::throw_usage("WIDTHxHEIGHT in pixels is needed, not \"" + text + "\".");
  request.width_px = static_cast<int>(parse_whole(sides[0], 16, 8192));
  request.height_px = static_cast<int>(parse_whole(sides[1], 16, 8192));
}

void add_picture_options(OptionSet& options, PictureOptions& picture) {
  options.section("Picture");
  options.text("-o", "OUT.png", "the picture to write", picture.output);
  options.value("--size", "WxH", "in pixels, 16 to 8192 a side (default 1600x1200)",
                [&](const std::string& text) { parse_size(text, picture.request); });
  options.value(
      "--view", "VIEW", "four-up, side-by-side, 3d, axial, coronal or sagittal (default four-up)",
      [&](const std::string& text) {
        picture.view = parse_choice(text, {"four-up", "side-by-side", "3d", "axial", "coronal", "sagittal"});
        picture.request.view = vis::picture_view_from(picture.view);
      });
  options.value("--show", "surface|points|links", "what the 3-D view shows (default surface)",
                [&](const std::string& text) {
                  picture.show_word = parse_choice(text, {"surface", "points", "links"});
                  picture.show = text == "points"  ? vis::Show::points
                                 : text == "links" ? vis::Show::links
                                                   : vis::Show::surface;
                });
  options.value("--color-by", "intensity", "what the colours say (default intensity)",
                [](const std::string& text) {
                  parse_choice(text, {"intensity"}, {"displacement", "strain", "speed", "force", "binding"});
                });
  options.value("--background", "COLOUR", "black, white or #RRGGBB (default: a soft gradient in 3-D)",
                [&](const std::string& text) {
                  picture.ground = parse_colour(text);
                  picture.background = text;
                });
  options.flag("--transparent", "leaves the ground out of the picture", picture.transparent);
}

vis::SceneContent content_of(const Prepared& prepared, const session::RunResult* result) {
  vis::SceneContent content;
  const auto& info = prepared.info;
  content.volume = prepared.filtered;
  content.spacing_assumed = info.spacing_is_assumed();
  content.spacing_badge = content.spacing_assumed ? "assumed" : core::to_string(info.spacing_provenance[0]);
  content.orientation_known = info.patient_axes;
  content.mesh = prepared.surface.mesh;
  content.tissue = prepared.tissue.tissue;
  if (result != nullptr) {
    content.deformed = result->surface;
    content.positions_mm = std::make_shared<const std::vector<Eigen::Vector3f>>(result->state.positions_mm);
  }
  return content;
}

/// A picture of the tissue at rest needs no device, so none is asked for.
bool runs(const SimulationOptions& simulation) {
  return simulation.seconds_given || !simulation.gesture_path.empty() ||
         (simulation.request.steps && *simulation.request.steps > 0);
}

int draw(const PictureOptions& picture, SimulationOptions& simulation, const Call& call) {
  auto& scan = simulation.scan;
  const auto progress = call.console.progress();
  Prepared prepared = prepare_tissue(scan, call.console, progress.part(0.0, 0.4));
  const bool surface_needed = !simulation.surface_path.empty() || scan.recipe.surface.mesh.has_value();
  prepare_surface(prepared, scan, surface_needed, call.console, progress.part(0.4, 0.6));
  std::optional<session::RunResult> result;
  if (runs(simulation)) {
    result = run_request(simulation, prepared, call.console, progress.part(0.6, 0.9));
    if (result->diverged) throw_diverged(*result);
  }
  auto settings = vis::standard_settings(prepared.filtered);
  settings.show = picture.show;
  settings.transparent = picture.transparent;
  if (!picture.background.empty()) {
    settings.background = picture.ground;
    settings.use_gradient = false;
  }
  const auto content = content_of(prepared, result ? &*result : nullptr);
  const auto pixels = vis::draw_picture(content, settings, picture.request, progress.part(0.9, 0.97));
  progress.report(0.97, "Writing");
  vis::save_png(picture.output, pixels);
  if (!simulation.surface_path.empty())
    write_surface(simulation.surface_path, prepared, result ? result->surface.get() : nullptr);
  if (!simulation.save_recipe_path.empty()) session::save_recipe(simulation.save_recipe_path, scan.recipe);

  Json object;
  object["output"] = picture.output;
  object["size_px"] = Json::array({pixels.width_px, pixels.height_px});
  object["view"] = picture.view;
  object["show"] = picture.show_word;
  object["points"] = prepared.tissue.statistics.points;
  object["links"] = prepared.tissue.statistics.links;
  object["faces"] = prepared.surface.mesh ? prepared.surface.mesh->triangles.size() : 0;
  if (!prepared.surface.space_reason.empty()) object["mesh_axes"] = prepared.surface.space_reason;
  object["recipe_sha256"] = session::recipe_sha256(scan.recipe);
  object["simulation"] = result ? to_json(*result, prepared, scan.recipe) : Json(nullptr);
  Table table;
  table.emplace_back("Size",
                     std::to_string(pixels.width_px) + " x " + std::to_string(pixels.height_px) + " pixels");
  table.emplace_back("View", picture.view + ", " + picture.show_word);
  if (!result && !prepared.surface.space_reason.empty())
    table.emplace_back("Mesh axes", prepared.surface.space_reason);
  if (result)
    for (auto& row : table_of(*result, prepared)) table.push_back(std::move(row));
  call.console.result(object, "Wrote " + picture.output, table);
  return 0;
}

}  // namespace

int run_render(const Call& call) {
  CommonOptions common;
  SimulationOptions simulation;
  PictureOptions picture;
  auto& scan = simulation.scan;
  simulation.request.steps = 0;
  OptionSet options("render", "render [options] PATH|--recipe FILE -o OUT.png",
                    "Draws slices and the tissue into a PNG file, without a display. The tissue is at rest "
                    "unless --steps, --seconds or --gesture is given.");
  options.positional("PATH", 1, scan.paths);
  add_picture_options(options, picture);
  add_scan_options(options, scan);
  add_tissue_options(options, scan);
  add_simulation_options(options, simulation);
  add_common(options, common);
  options.example("palpate-cli render data/sample-heart.mha -o heart.png --size 1600x1200");
  options.example("palpate-cli render scan.mha --view 3d --show points --background white -o points.png");
  if (parse_or_help(options, call)) return 0;
  simulation.scan.filter_options.device = common.device;
  take_path(scan, "render");
  if (picture.output.empty()) core::throw_usage("render needs -o OUT.png, the picture to write.");
  check_output("-o", picture.output, {".png"});
  if (!simulation.steps_given && (simulation.seconds_given || !simulation.gesture_path.empty()))
    simulation.request.steps.reset();
  check_apart({{"-o", picture.output},
               {"--surface", simulation.surface_path},
               {"--save-recipe", simulation.save_recipe_path}});
  check_request(simulation, common.device);
  return draw(picture, simulation, call);
}

}  // namespace palpate::cli
