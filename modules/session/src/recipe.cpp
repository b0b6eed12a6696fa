#include "palpate/session/recipe.hpp"

#include "checksum.hpp"
#include "json_reader.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"

#include <nlohmann/json.hpp>

#include <fstream>
#include <iterator>
#include <limits>
#include <system_error>

namespace palpate::session {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr double largest = 1e12;
constexpr int most_voxels = 1 << 30;
constexpr int most_label = 1000000000;
constexpr std::size_t largest_recipe_bytes = std::size_t{16} << 20U;

/// In the order of model::LinkRule.
const std::vector<std::string>& link_words() {
  static const std::vector<std::string> words{"six", "nearest", "lattice18", "lattice26"};
  return words;
}
/// In the order of model::PointRule.
const std::vector<std::string>& point_words() {
  static const std::vector<std::string> words{"lattice", "blue-noise"};
  return words;
}
/// In the order of AnchorSettings::Rule.
const std::vector<std::string>& anchor_words() {
  static const std::vector<std::string> words{"none", "border", "file"};
  return words;
}
/// In the order of the members of IntensityScaling.
const std::vector<std::string>& scaling_words() {
  static const std::vector<std::string> words{"stiffness", "damping", "drag", "mass"};
  return words;
}
const std::vector<simulation::LayoutChoice>& layouts() {
  static const std::vector<simulation::LayoutChoice> choices{simulation::LayoutChoice::automatic,
                                                             simulation::LayoutChoice::lattice,
                                                             simulation::LayoutChoice::explicit_links};
  return choices;
}
template <typename Choice>
std::vector<std::string> words_of(const std::vector<Choice>& choices) {
  std::vector<std::string> words;
  for (const Choice choice : choices) words.push_back(simulation::to_string(choice));
  return words;
}
const std::vector<std::string>& space_words() {
  static const std::vector<std::string> words{"automatic", "lps", "ras"};
  return words;
}
const std::vector<std::string>& mapping_words() {
  static const std::vector<std::string> words{"none", "triangle"};
  return words;
}

json optional_number(const std::optional<double>& value) { return value ? json(*value) : json(nullptr); }

json to_value(const InputSettings& input) {
  return {{"path", input.path.string()},
          {"sha256", input.sha256},
          {"series_uid", input.series_uid},
          {"frame", input.frame},
          {"spacing_mm", input.spacing_mm ? json(*input.spacing_mm) : json(nullptr)},
          {"orientation", input.orientation},
          {"grid_spacing_mm", optional_number(input.grid_spacing_mm)},
          {"allow_truncated", input.allow_truncated}};
}

json to_value(const MaskSettings& mask) {
  if (!mask.path) return nullptr;
  return {{"path", mask.path->string()},
          {"label", mask.label ? json(*mask.label) : json(nullptr)},
          {"sha256", mask.sha256}};
}

json to_value(const model::TissueParameters& tissue, const MaskSettings& mask) {
  json crop = nullptr;
  if (tissue.crop) crop = {{"begin", tissue.crop->begin}, {"end", tissue.crop->end}};
  // JSON has no infinity: null is "no upper limit".
  return {{"threshold_low", optional_number(tissue.threshold_low)},
          {"threshold_high", tissue.threshold_high},
          {"crop", crop},
          {"stride", tissue.stride},
          {"noise", tissue.noise},
          {"seed", tissue.seed},
          {"mask", to_value(mask)},
          {"points", point_words()[static_cast<std::size_t>(tissue.points)]},
          {"links", link_words()[static_cast<std::size_t>(tissue.links)]},
          {"max_links", tissue.max_links},
          {"min_component", tissue.min_component}};
}

json to_value(const SurfaceSettings& surface) {
  return {{"mapping", mapping_words()[surface.mapped ? 1 : 0]},
          {"mesh", surface.mesh ? json(surface.mesh->string()) : json(nullptr)},
          {"mesh_space", space_words()[static_cast<std::size_t>(surface.mesh_space)]},
          {"face_budget", surface.face_budget}};
}

json to_value(const AnchorDab& dab) {
  return {{"place_mm", {dab.place_mm.x(), dab.place_mm.y(), dab.place_mm.z()}},
          {"radius_mm", dab.radius_mm},
          {"frees", dab.frees}};
}

json to_value(const AnchorSettings& anchors) {
  json painted = json::array();
  for (const AnchorDab& dab : anchors.painted) painted.push_back(to_value(dab));
  const bool by_file = anchors.rule == AnchorSettings::Rule::file;
  return {{"rule", anchor_words()[static_cast<std::size_t>(anchors.rule)]},
          {"file", by_file ? json(anchors.file.string()) : json(nullptr)},
          {"sha256", by_file ? anchors.sha256 : std::string()},
          {"painted", painted}};
}

json to_value(const IntensityScaling& scaling) {
  json scaled = json::array();
  const std::array<bool, 4> on{scaling.stiffness, scaling.damping, scaling.drag, scaling.mass};
  for (std::size_t n = 0; n < on.size(); ++n)
    if (on[n]) scaled.push_back(scaling_words()[n]);
  return scaled;
}

json to_value(const SimulationSettings& simulation) {
  const auto& parameters = simulation.parameters;
  const auto& gravity = parameters.gravity_mm_per_s2;
  return {{"stiffness_per_s2", parameters.stiffness_per_s2},
          {"damping_per_s", parameters.damping_per_s},
          {"drag_per_s", parameters.drag_per_s},
          {"gravity_mm_per_s2", {gravity.x(), gravity.y(), gravity.z()}},
          {"mass", parameters.mass},
          {"beat", {{"period_s", parameters.beat_period_s}, {"amplitude", parameters.beat_amplitude}}},
          {"integrator", simulation::to_string(parameters.integrator)},
          {"layout", simulation::to_string(simulation.layout)},
          {"anchors", to_value(simulation.anchors)},
          {"scale_by_intensity", to_value(simulation.scaling)},
          {"step_s", optional_number(simulation.step_s)}};
}

json to_value(const Recipe& recipe) {
  json filters = json::array();
  for (const auto& step : recipe.filters)
    filters.push_back({{"name", step.name}, {"parameters", json(step.parameters)}});
  return {{"version", recipe.version},
          {"input", to_value(recipe.input)},
          {"filters", filters},
          {"tissue", to_value(recipe.tissue, recipe.mask)},
          {"surface", to_value(recipe.surface)},
          {"simulation", to_value(recipe.simulation)}};
}

/// Paths may hold bytes that are no UTF-8; they must not make saving fail.
std::string text_of(const json& value) {
  return value.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

template <typename Number, typename Read>
std::array<Number, 3> read_three(const json& value, const std::string& place, Read read) {
  if (!value.is_array() || value.size() != 3) refuse(place, "a list of three numbers is needed.");
  std::array<Number, 3> three{};
  for (std::size_t n = 0; n < 3; ++n) three[n] = read(value[n], place + "[" + std::to_string(n) + "]");
  return three;
}

InputSettings read_input(ObjectReader reader) {
  InputSettings input;
  std::string path;
  reader.read("path", path);
  input.path = path;
  reader.read("sha256", input.sha256);
  reader.read("series_uid", input.series_uid);
  reader.read("frame", input.frame, 0, most_voxels);
  reader.read("allow_truncated", input.allow_truncated);
  reader.read("orientation", input.orientation);
  if (reader.has("grid_spacing_mm"))
    input.grid_spacing_mm =
        ObjectReader::number(reader.at("grid_spacing_mm"), reader.place_of("grid_spacing_mm"), 1e-3, 1e3);
  if (reader.has("spacing_mm"))
    input.spacing_mm = read_three<double>(reader.at("spacing_mm"), reader.place_of("spacing_mm"),
                                          [](const json& value, const std::string& place) {
                                            return ObjectReader::number(value, place, 1e-9, largest);
                                          });
  reader.finish();
  return input;
}

std::vector<imaging::FilterStep> read_filters(const json& value) {
  if (!value.is_array()) refuse("filters", "a list is needed.");
  std::vector<imaging::FilterStep> chain;
  for (std::size_t n = 0; n < value.size(); ++n) {
    const std::string place = "filters[" + std::to_string(n) + "]";
    ObjectReader reader(value[n], place);
    imaging::FilterStep step;
    reader.read("name", step.name);
    if (reader.has("parameters")) {
      const auto& parameters = reader.at("parameters");
      if (!parameters.is_object()) refuse(reader.place_of("parameters"), "an object in braces is needed.");
      for (const auto& [key, number] : parameters.items())
        step.parameters[key] =
            ObjectReader::number(number, reader.place_of("parameters") + "." + key, -largest, largest);
    }
    reader.finish();
    // Names and ranges are the filters' own to judge.
    try {
      step = imaging::parse_filter(imaging::to_string(step));
    } catch (const core::Error& error) {
      refuse(place, error.what());
    }
    chain.push_back(step);
  }
  return chain;
}

MaskSettings read_mask(ObjectReader reader) {
  MaskSettings mask;
  std::string path;
  reader.at("path");
  reader.read("path", path);
  if (path.empty()) refuse(reader.place_of("path"), "the name of a file is needed.");
  mask.path = path;
  if (reader.has("label")) {
    int label = 0;
    reader.read("label", label, -most_label, most_label);
    mask.label = label;
  }
  reader.read("sha256", mask.sha256);
  reader.finish();
  return mask;
}

model::TissueParameters read_tissue(ObjectReader reader, MaskSettings& mask) {
  model::TissueParameters tissue;
  if (reader.has("threshold_low")) {
    double low = 0.0;
    reader.read("threshold_low", low, -largest, largest);
    tissue.threshold_low = low;
  }
  reader.read("threshold_high", tissue.threshold_high, -largest, largest);
  if (reader.has("crop")) {
    ObjectReader crop = reader.object("crop");
    const auto whole = [](const json& value, const std::string& place) {
      return static_cast<int>(ObjectReader::whole(value, place, 0, most_voxels));
    };
    model::CropBox box;
    box.begin = read_three<int>(crop.at("begin"), crop.place_of("begin"), whole);
    box.end = read_three<int>(crop.at("end"), crop.place_of("end"), whole);
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (box.begin[axis] >= box.end[axis]) refuse(crop.place_of("end"), "it must lie beyond the beginning.");
    crop.finish();
    tissue.crop = box;
  }
  reader.read("stride", tissue.stride, 1, 1024);
  reader.read("noise", tissue.noise, 0.0, 0.5);
  reader.read("seed", tissue.seed);
  if (reader.has("mask")) mask = read_mask(reader.object("mask"));
  auto points = static_cast<std::size_t>(tissue.points);
  reader.read_word("points", points, point_words());
  tissue.points = static_cast<model::PointRule>(points);
  auto links = static_cast<std::size_t>(tissue.links);
  reader.read_word("links", links, link_words());
  tissue.links = static_cast<model::LinkRule>(links);
  if (tissue.points == model::PointRule::blue_noise && tissue.links != model::LinkRule::nearest)
    refuse(reader.place_of("links"),
           "points without a lattice (blue-noise) are linked by nearest only, not by " + link_words()[links] +
               ".");
  reader.read("max_links", tissue.max_links, 1, 64);
  std::uint64_t least = tissue.min_component;
  reader.read("min_component", least);
  tissue.min_component = least;
  reader.finish();
  return tissue;
}

SurfaceSettings read_surface(ObjectReader reader) {
  SurfaceSettings surface;
  std::size_t mapping = surface.mapped ? 1 : 0;
  reader.read_word("mapping", mapping, mapping_words());
  surface.mapped = mapping == 1;
  if (reader.has("mesh")) {
    std::string mesh;
    reader.read("mesh", mesh);
    surface.mesh = mesh;
  }
  std::size_t space = 0;
  reader.read_word("mesh_space", space, space_words());
  surface.mesh_space = static_cast<surface::MeshSpace>(space);
  reader.read("face_budget", surface.face_budget, 4, 100000000);
  reader.finish();
  return surface;
}

AnchorDab read_dab(ObjectReader reader) {
  AnchorDab dab;
  const auto place = read_three<double>(reader.at("place_mm"), reader.place_of("place_mm"),
                                        [](const json& value, const std::string& at) {
                                          return ObjectReader::number(value, at, -largest, largest);
                                        });
  dab.place_mm = {place[0], place[1], place[2]};
  reader.read("radius_mm", dab.radius_mm, 0.0, largest);
  reader.read("frees", dab.frees);
  reader.finish();
  return dab;
}

AnchorSettings read_anchors(ObjectReader reader) {
  AnchorSettings anchors;
  std::size_t rule = 0;
  reader.read_word("rule", rule, anchor_words());
  anchors.rule = static_cast<AnchorSettings::Rule>(rule);
  std::string file;
  reader.read("file", file);
  reader.read("sha256", anchors.sha256);
  const bool by_file = anchors.rule == AnchorSettings::Rule::file;
  if (by_file && file.empty()) refuse(reader.place_of("file"), "the rule \"file\" needs the name of one.");
  if (!by_file && !file.empty()) refuse(reader.place_of("file"), "only the rule \"file\" takes one.");
  anchors.file = file;
  if (reader.has("painted")) {
    const json& painted = reader.at("painted");
    const std::string place = reader.place_of("painted");
    if (!painted.is_array()) refuse(place, "a list is needed.");
    for (std::size_t n = 0; n < painted.size(); ++n)
      anchors.painted.push_back(read_dab(ObjectReader(painted[n], place + "[" + std::to_string(n) + "]")));
  }
  reader.finish();
  return anchors;
}

IntensityScaling read_scaling(const json& value, const std::string& place) {
  if (!value.is_array()) refuse(place, "a list is needed.");
  IntensityScaling scaling;
  const std::array<bool*, 4> switches{&scaling.stiffness, &scaling.damping, &scaling.drag, &scaling.mass};
  for (std::size_t n = 0; n < value.size(); ++n)
    *switches[ObjectReader::word(value[n], place + "[" + std::to_string(n) + "]", scaling_words())] = true;
  return scaling;
}

SimulationSettings read_simulation(ObjectReader reader) {
  SimulationSettings simulation;
  auto& parameters = simulation.parameters;
  reader.read("stiffness_per_s2", parameters.stiffness_per_s2, 0.0, 1e9);
  reader.read("damping_per_s", parameters.damping_per_s, 0.0, 1e6);
  reader.read("drag_per_s", parameters.drag_per_s, 0.0, 1e4);
  if (reader.has("gravity_mm_per_s2")) {
    const auto gravity =
        read_three<double>(reader.at("gravity_mm_per_s2"), reader.place_of("gravity_mm_per_s2"),
                           [](const json& value, const std::string& place) {
                             return ObjectReader::number(value, place, -1e6, 1e6);
                           });
    parameters.gravity_mm_per_s2 = {gravity[0], gravity[1], gravity[2]};
  }
  reader.read("mass", parameters.mass, 1e-3, 1e3);
  if (reader.has("beat")) {
    ObjectReader beat = reader.object("beat");
    beat.read("period_s", parameters.beat_period_s, 0.05, 60.0);
    beat.read("amplitude", parameters.beat_amplitude, 0.0, 0.5);
    beat.finish();
  }
  if (reader.has("integrator"))
    parameters.integrator = simulation::all_integrators()[ObjectReader::word(
        reader.at("integrator"), reader.place_of("integrator"), words_of(simulation::all_integrators()))];
  if (reader.has("layout"))
    simulation.layout =
        layouts()[ObjectReader::word(reader.at("layout"), reader.place_of("layout"), words_of(layouts()))];
  if (reader.has("anchors")) simulation.anchors = read_anchors(reader.object("anchors"));
  if (reader.has("scale_by_intensity"))
    simulation.scaling = read_scaling(reader.at("scale_by_intensity"), reader.place_of("scale_by_intensity"));
  if (reader.has("step_s")) {
    double step_s = 0.0;
    reader.read("step_s", step_s, 1e-9, 1.0);
    simulation.step_s = step_s;
  }
  reader.finish();
  return simulation;
}

}  // namespace

std::string to_json(const Recipe& recipe) { return text_of(to_value(recipe)); }

Recipe parse_recipe(const std::string& json_text) {
  const json value = parse_json(json_text, "The recipe");
  ObjectReader reader(value, "");
  Recipe recipe;
  reader.at("version");
  reader.read("version", recipe.version, 1, 1);
  if (reader.has("input")) recipe.input = read_input(reader.object("input"));
  if (reader.has("filters")) recipe.filters = read_filters(reader.at("filters"));
  if (reader.has("tissue")) recipe.tissue = read_tissue(reader.object("tissue"), recipe.mask);
  if (reader.has("surface")) recipe.surface = read_surface(reader.object("surface"));
  if (reader.has("simulation")) recipe.simulation = read_simulation(reader.object("simulation"));
  reader.finish();
  return recipe;
}

Recipe load_recipe(const fs::path& path) {
  std::error_code unknown;
  const auto bytes = fs::is_regular_file(path, unknown) ? fs::file_size(path, unknown) : std::uintmax_t{0};
  std::ifstream file(path, std::ios::binary);
  if (!file || !fs::is_regular_file(path, unknown))
    throw core::Error(
        core::ErrorKind::input, "not-found",
        "The recipe " + path.string() + " cannot be read. Check the name and that you may read it.");
  if (bytes > largest_recipe_bytes)
    throw core::Error(core::ErrorKind::input, "too-large",
                      path.string() + " has " + std::to_string(bytes) + " bytes; no recipe is that large.");
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  Recipe recipe;
  try {
    recipe = parse_recipe(text);
  } catch (const core::Error& error) {
    throw core::Error(error.kind(), error.code(), path.string() + ": " + error.what(), error.details());
  }
  const auto beside = [&](const fs::path& given) {
    return given.empty() || given.is_absolute() ? given : (path.parent_path() / given).lexically_normal();
  };
  recipe.input.path = beside(recipe.input.path);
  if (recipe.surface.mesh) recipe.surface.mesh = beside(*recipe.surface.mesh);
  const fs::path folder = path.parent_path();
  if (recipe.mask.path) recipe.mask.path = found_beside(beside(*recipe.mask.path), folder);
  auto& anchors = recipe.simulation.anchors.file;
  if (!anchors.empty()) anchors = found_beside(beside(anchors), folder);
  return recipe;
}

fs::path found_beside(const fs::path& given, const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(given, ignored)) return given;
  // "masks/" names the folder "masks".
  const fs::path plain = given.has_filename() ? given : given.parent_path();
  const fs::path beside = folder / plain.filename();
  return fs::exists(beside, ignored) ? beside : given;
}

void save_recipe(const fs::path& path, const Recipe& recipe) {
  // Relative paths are those of the working folder now; in the file they are
  // beside it, so that scan and recipe can move together.
  const fs::path folder = fs::absolute(path).parent_path();
  const auto beside = [&](const fs::path& given) {
    return given.empty() || given.is_absolute() ? given : fs::absolute(given).lexically_proximate(folder);
  };
  Recipe written = recipe;
  written.input.path = beside(recipe.input.path);
  if (recipe.surface.mesh) written.surface.mesh = beside(*recipe.surface.mesh);
  if (recipe.mask.path) written.mask.path = beside(*recipe.mask.path);
  written.simulation.anchors.file = beside(recipe.simulation.anchors.file);
  core::write_file(path, to_json(written));
}

std::string recipe_sha256(const Recipe& recipe) {
  json value = to_value(recipe);
  value["input"].erase("path");
  if (recipe.mask.path) value["tissue"]["mask"].erase("path");
  value["simulation"]["anchors"].erase("file");
  return sha256_of(text_of(value));
}

std::vector<core::Warning> note_label_checksums(Recipe& recipe, const core::Progress& progress) {
  std::vector<core::Warning> warnings;
  const auto note = [&](const fs::path& path, std::string& noted, const std::string& code,
                        const core::Progress& part) {
    const std::string sum = file_sha256(path, part);
    if (!noted.empty() && noted != sum)
      warnings.push_back(
          {code, path.string() + " is not the file that the recipe was made with: its checksum differs."});
    noted = sum;
  };
  if (recipe.mask.path) note(*recipe.mask.path, recipe.mask.sha256, "mask-changed", progress.part(0.0, 0.5));
  auto& anchors = recipe.simulation.anchors;
  if (anchors.rule == AnchorSettings::Rule::file)
    note(anchors.file, anchors.sha256, "anchors-changed", progress.part(0.5, 1.0));
  return warnings;
}

}  // namespace palpate::session
