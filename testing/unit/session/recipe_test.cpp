#include "palpate/session/recipe.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::testing::TemporaryFolder;
using ::testing::HasSubstr;
namespace fs = std::filesystem;
namespace model = palpate::model;
namespace session = palpate::session;

namespace {

session::Recipe unusual_recipe() {
  session::Recipe recipe;
  recipe.input.path = "scans/heart.mha";
  recipe.input.sha256 = std::string(64, 'a');
  recipe.input.series_uid = "1.2.3";
  recipe.input.frame = 4;
  recipe.input.spacing_mm = {0.5, 0.25, 1.0 / 3.0};
  recipe.input.allow_truncated = true;
  recipe.filters = {palpate::imaging::parse_filter("median:radius=2"),
                    palpate::imaging::parse_filter("gaussian:sigma=0.7")};
  recipe.tissue.threshold_low = 60.25;
  recipe.tissue.threshold_high = 200;
  recipe.tissue.crop = model::CropBox{{1, 2, 3}, {10, 20, 30}};
  recipe.tissue.stride = 2;
  recipe.tissue.noise = 0.25;
  recipe.tissue.seed = 18446744073709551615U;
  recipe.tissue.links = model::LinkRule::lattice18;
  recipe.mask.path = "masks/heart.nii.gz";
  recipe.mask.label = -3;
  recipe.mask.sha256 = std::string(64, 'c');
  recipe.tissue.max_links = 18;
  recipe.tissue.min_component = 100;
  recipe.surface.mapped = false;
  recipe.surface.mesh = "heart.stl";
  recipe.surface.mesh_space = palpate::surface::MeshSpace::ras;
  recipe.surface.face_budget = 1234;
  recipe.simulation.parameters.stiffness_per_s2 = 5000;
  recipe.simulation.parameters.damping_per_s = 1.5;
  recipe.simulation.parameters.drag_per_s = 0.01;
  recipe.simulation.parameters.gravity_mm_per_s2 = {1, -2, 9810};
  recipe.simulation.step_s = 0.001;
  recipe.simulation.parameters.integrator = palpate::simulation::Integrator::implicit_euler;
  recipe.simulation.parameters.mass = 2.5;
  recipe.simulation.parameters.beat_period_s = 0.8;
  recipe.simulation.parameters.beat_amplitude = 0.2;
  recipe.simulation.layout = palpate::simulation::LayoutChoice::explicit_links;
  recipe.simulation.anchors.rule = session::AnchorSettings::Rule::file;
  recipe.simulation.anchors.file = "masks/fixed.mha";
  recipe.simulation.anchors.sha256 = std::string(64, 'd');
  recipe.simulation.anchors.painted = {{{1, -2, 3.5}, 4.0, false}, {{0, 0, 1}, 2.0, true}};
  recipe.simulation.scaling.damping = recipe.simulation.scaling.mass = true;
  return recipe;
}

std::string usage_error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::usage);
    return error.what();
  }
  ADD_FAILURE() << "nothing was refused";
  return {};
}

}  // namespace

TEST(Recipe, EveryParameterSurvivesTheText) {
  const auto recipe = unusual_recipe();
  const auto read = session::parse_recipe(session::to_json(recipe));
  EXPECT_EQ(read.input.path, recipe.input.path);
  EXPECT_EQ(read.input.sha256, recipe.input.sha256);
  EXPECT_EQ(read.input.series_uid, recipe.input.series_uid);
  EXPECT_EQ(read.input.frame, recipe.input.frame);
  EXPECT_EQ(read.input.spacing_mm, recipe.input.spacing_mm);
  EXPECT_EQ(read.input.allow_truncated, recipe.input.allow_truncated);
  EXPECT_EQ(read.filters, recipe.filters);
  EXPECT_EQ(read.tissue.threshold_low, recipe.tissue.threshold_low);
  EXPECT_EQ(read.tissue.threshold_high, recipe.tissue.threshold_high);
  EXPECT_EQ(read.tissue.crop->begin, recipe.tissue.crop->begin);
  EXPECT_EQ(read.tissue.crop->end, recipe.tissue.crop->end);
  EXPECT_EQ(read.tissue.stride, recipe.tissue.stride);
  EXPECT_EQ(read.tissue.noise, recipe.tissue.noise);
  EXPECT_EQ(read.tissue.seed, recipe.tissue.seed);
  EXPECT_EQ(read.tissue.links, recipe.tissue.links);
  EXPECT_EQ(read.tissue.max_links, recipe.tissue.max_links);
  EXPECT_EQ(read.tissue.min_component, recipe.tissue.min_component);
  EXPECT_EQ(read.surface.mapped, recipe.surface.mapped);
  EXPECT_EQ(read.surface.mesh, recipe.surface.mesh);
  EXPECT_EQ(read.surface.mesh_space, recipe.surface.mesh_space);
  EXPECT_EQ(read.surface.face_budget, recipe.surface.face_budget);
  EXPECT_EQ(read.simulation.parameters.stiffness_per_s2, recipe.simulation.parameters.stiffness_per_s2);
  EXPECT_EQ(read.simulation.parameters.damping_per_s, recipe.simulation.parameters.damping_per_s);
  EXPECT_EQ(read.simulation.parameters.drag_per_s, recipe.simulation.parameters.drag_per_s);
  EXPECT_EQ(read.simulation.parameters.gravity_mm_per_s2, recipe.simulation.parameters.gravity_mm_per_s2);
  EXPECT_EQ(read.simulation.step_s, recipe.simulation.step_s);
  EXPECT_EQ(read.mask.path, recipe.mask.path);
  EXPECT_EQ(read.mask.label, recipe.mask.label);
  EXPECT_EQ(read.mask.sha256, recipe.mask.sha256);
  const auto& simulation = read.simulation;
  EXPECT_EQ(simulation.parameters.integrator, recipe.simulation.parameters.integrator);
  EXPECT_EQ(simulation.parameters.mass, recipe.simulation.parameters.mass);
  EXPECT_EQ(simulation.parameters.beat_period_s, recipe.simulation.parameters.beat_period_s);
  EXPECT_EQ(simulation.parameters.beat_amplitude, recipe.simulation.parameters.beat_amplitude);
  EXPECT_EQ(simulation.layout, recipe.simulation.layout);
  EXPECT_EQ(simulation.anchors.rule, recipe.simulation.anchors.rule);
  EXPECT_EQ(simulation.anchors.file, recipe.simulation.anchors.file);
  EXPECT_EQ(simulation.anchors.sha256, recipe.simulation.anchors.sha256);
  EXPECT_EQ(simulation.anchors.painted, recipe.simulation.anchors.painted);
  EXPECT_FALSE(simulation.scaling.stiffness);
  EXPECT_TRUE(simulation.scaling.damping);
  EXPECT_FALSE(simulation.scaling.drag);
  EXPECT_TRUE(simulation.scaling.mass);
  EXPECT_EQ(session::to_json(read), session::to_json(recipe));
}

TEST(Recipe, EveryWordOfEveryChoiceComesBack) {
  session::Recipe recipe;
  for (const auto links : {model::LinkRule::six, model::LinkRule::nearest, model::LinkRule::lattice18,
                           model::LinkRule::lattice26}) {
    recipe.tissue.links = links;
    EXPECT_EQ(session::parse_recipe(session::to_json(recipe)).tissue.links, links);
  }
  for (const auto integrator : palpate::simulation::all_integrators()) {
    recipe.simulation.parameters.integrator = integrator;
    EXPECT_EQ(session::parse_recipe(session::to_json(recipe)).simulation.parameters.integrator, integrator);
  }
  using palpate::simulation::LayoutChoice;
  for (const auto layout : {LayoutChoice::automatic, LayoutChoice::lattice, LayoutChoice::explicit_links}) {
    recipe.simulation.layout = layout;
    EXPECT_EQ(session::parse_recipe(session::to_json(recipe)).simulation.layout, layout);
  }
  recipe.tissue.links = model::LinkRule::nearest;
  for (const auto points : {model::PointRule::lattice, model::PointRule::blue_noise}) {
    recipe.tissue.points = points;
    EXPECT_EQ(session::parse_recipe(session::to_json(recipe)).tissue.points, points);
  }
  recipe.simulation.anchors.rule = session::AnchorSettings::Rule::border;
  EXPECT_EQ(session::parse_recipe(session::to_json(recipe)).simulation.anchors.rule,
            session::AnchorSettings::Rule::border);
}

TEST(Recipe, OfAnEarlierVersionLoadsWithDefaultsForWhatIsNew) {
  const auto read = session::parse_recipe(
      R"({"version": 1, "tissue": {"links": "six", "max_links": 8, "threshold_low": 60},
          "simulation": {"integrator": "rk4", "stiffness_per_s2": 5000, "step_s": null}})");
  EXPECT_EQ(read.tissue.links, model::LinkRule::six);
  EXPECT_EQ(read.tissue.points, model::PointRule::lattice);
  EXPECT_FALSE(read.mask.path.has_value());
  EXPECT_EQ(read.simulation.parameters.stiffness_per_s2, 5000);
  EXPECT_EQ(read.simulation.parameters.mass, 1.0);
  EXPECT_EQ(read.simulation.parameters.beat_amplitude, 0.0);
  EXPECT_EQ(read.simulation.layout, palpate::simulation::LayoutChoice::automatic);
  EXPECT_EQ(read.simulation.anchors.rule, session::AnchorSettings::Rule::none);
}

TEST(Recipe, DefaultsAreWrittenAndReadBack) {
  const auto text = session::to_json(session::Recipe{});
  for (const char* key : {"\"max_links\": 12", "\"noise\": 0.1", "\"stiffness_per_s2\": 10000.0",
                          "\"face_budget\"", "\"threshold_low\": null", "\"step_s\": null"})
    EXPECT_THAT(text, HasSubstr(key));
  const auto read = session::parse_recipe(text);
  EXPECT_FALSE(read.tissue.threshold_low.has_value());
  EXPECT_EQ(read.tissue.threshold_high, std::numeric_limits<double>::infinity());
  EXPECT_EQ(session::to_json(read), text);
  EXPECT_EQ(session::to_json(session::parse_recipe("{\"version\": 1}")), text)
      << "what is absent is at its default";
}

TEST(Recipe, RefusalsNameThePlace) {
  const struct {
    const char* text;
    const char* place;
  } cases[] = {
      {"", "line 1, column 1"},
      {"{\n  \"version\": 1,\n  oops}", "line 3, column 3"},
      {"[]", "the outermost value"},
      {"{}", "version"},
      {"{\"version\": 2}", "version"},
      {"{\"version\": \"1\"}", "version"},
      {"{\"version\": 1, \"tisue\": {}}", "tisue"},
      {"{\"version\": 1, \"tissue\": []}", "tissue"},
      {"{\"version\": 1, \"tissue\": {\"stride\": 0}}", "tissue.stride"},
      {"{\"version\": 1, \"tissue\": {\"stride\": 1.5}}", "tissue.stride"},
      {"{\"version\": 1, \"tissue\": {\"seed\": -1}}", "tissue.seed"},
      {R"({"version": 1, "tissue": {"links": "lattice20"}})", "tissue.links"},
      {R"({"version": 1, "tissue": {"points": "random"}})", "tissue.points"},
      {R"({"version": 1, "tissue": {"points": "blue-noise", "links": "six"}})", "tissue.links"},
      {R"({"version": 1, "tissue": {"mask": "heart.mha"}})", "tissue.mask"},
      {R"({"version": 1, "tissue": {"mask": {"label": 2}}})", "tissue.mask.path"},
      {R"({"version": 1, "tissue": {"mask": {"path": ""}}})", "tissue.mask.path"},
      {R"({"version": 1, "tissue": {"mask": {"path": "m.mha", "label": 1.5}}})", "tissue.mask.label"},
      {R"({"version": 1, "tissue": {"mask": {"path": "m.mha", "color": 1}}})", "tissue.mask.color"},
      {R"({"version": 1, "simulation": {"layout": "tree"}})", "simulation.layout"},
      {R"({"version": 1, "simulation": {"mass": 0}})", "simulation.mass"},
      {R"({"version": 1, "simulation": {"mass": 1001}})", "simulation.mass"},
      {R"({"version": 1, "simulation": {"beat": {"period_s": 0.01}}})", "simulation.beat.period_s"},
      {R"({"version": 1, "simulation": {"beat": {"amplitude": 0.6}}})", "simulation.beat.amplitude"},
      {R"({"version": 1, "simulation": {"beat": {"rate": 1}}})", "simulation.beat.rate"},
      {R"({"version": 1, "simulation": {"anchors": {"rule": "top"}}})", "simulation.anchors.rule"},
      {R"({"version": 1, "simulation": {"anchors": {"rule": "file"}}})", "simulation.anchors.file"},
      {R"({"version": 1, "simulation": {"anchors": {"rule": "border", "file": "a.mha"}}})",
       "simulation.anchors.file"},
      {R"({"version": 1, "simulation": {"anchors": {"painted": [{"radius_mm": 1}]}}})",
       "simulation.anchors.painted[0].place_mm"},
      {R"({"version": 1, "simulation": {"anchors": {"painted": [{"place_mm": [0, 0, 0], "radius_mm": -1}]}}})",
       "simulation.anchors.painted[0].radius_mm"},
      {R"({"version": 1, "simulation": {"scale_by_intensity": "mass"}})", "simulation.scale_by_intensity"},
      {R"({"version": 1, "simulation": {"scale_by_intensity": ["mass", "colour"]}})",
       "simulation.scale_by_intensity[1]"},
      {R"({"version": 1, "simulation": {"scale_by_intensity": [1]}})", "simulation.scale_by_intensity[0]"},
      {"{\"version\": 1, \"tissue\": {\"max_links\": 65}}", "tissue.max_links"},
      {"{\"version\": 1, \"tissue\": {\"noise\": true}}", "tissue.noise"},
      {"{\"version\": 1, \"tissue\": {\"crop\": {\"begin\": [0, 0, 0], \"end\": [5, 5]}}}",
       "tissue.crop.end"},
      {"{\"version\": 1, \"tissue\": {\"crop\": {\"begin\": [0, 0, -1], \"end\": [5, 5, 5]}}}",
       "tissue.crop.begin[2]"},
      {"{\"version\": 1, \"tissue\": {\"crop\": {\"begin\": [0, 5, 0], \"end\": [5, 5, 5]}}}",
       "tissue.crop.end"},
      {"{\"version\": 1, \"input\": {\"spacing_mm\": [1, 0, 1]}}", "input.spacing_mm[1]"},
      {"{\"version\": 1, \"input\": {\"frame\": 99999999999999999999}}", "input.frame"},
      {"{\"version\": 1, \"filters\": [{\"name\": \"blur\"}]}", "filters[0]"},
      {"{\"version\": 1, \"filters\": [{\"name\": \"median\", \"parameters\": {\"radius_voxels\": \"2\"}}]}",
       "filters[0].parameters.radius_voxels"},
      {"{\"version\": 1, \"surface\": {\"mapping\": \"mixed\"}}", "surface.mapping"},
      {"{\"version\": 1, \"simulation\": {\"stiffness_per_s2\": -1}}", "simulation.stiffness_per_s2"},
      {"{\"version\": 1, \"simulation\": {\"integrator\": \"leapfrog\"}}", "simulation.integrator"},
      {"{\"version\": 1, \"simulation\": {\"step_s\": 0}}", "simulation.step_s"},
      {"{\"version\": 1, \"simulation\": {\"gravity_mm_per_s2\": [0, 0]}}", "simulation.gravity_mm_per_s2"},
      {"{\"version\": 1, \"simulation\": {\"gravity_mm_per_s2\": [0, 0, 1e400]}}", "The recipe"},
  };
  for (const auto& one : cases) {
    const auto error = usage_error_of([&] { session::parse_recipe(one.text); });
    EXPECT_EQ(error.rfind(one.place, 0), 0U) << one.text << "\n" << error;
  }
}

TEST(Recipe, PathsAreBesideTheFile) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "cases/one");
  palpate::core::write_file(
      folder / "cases/one/recipe.json",
      "{\"version\": 1, \"input\": {\"path\": \"../scan.mha\"}, \"surface\": {\"mesh\": "
      "\"/elsewhere/heart.stl\"}}");
  const auto read = session::load_recipe(folder / "cases/one/recipe.json");
  EXPECT_EQ(read.input.path, folder / "cases/scan.mha");
  EXPECT_EQ(*read.surface.mesh, fs::path("/elsewhere/heart.stl"));
}

TEST(Recipe, AMaskAndAnchorsThatMovedWithTheRecipeAreFoundBesideIt) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "old");
  palpate::core::write_file(folder / "old/mask.mha", "mask");
  palpate::core::write_file(folder / "old/fixed.mha", "fixed");
  session::Recipe recipe;
  recipe.mask.path = folder / "old/mask.mha";
  recipe.simulation.anchors.rule = session::AnchorSettings::Rule::file;
  recipe.simulation.anchors.file = folder / "old/fixed.mha";
  session::save_recipe(folder / "old/one.json", recipe);
  EXPECT_EQ(session::load_recipe(folder / "old/one.json").mask.path, folder / "old/mask.mha");
  fs::rename(folder / "old", folder / "new");
  const auto moved = session::load_recipe(folder / "new/one.json");
  EXPECT_EQ(moved.mask.path, folder / "new/mask.mha");
  EXPECT_EQ(moved.simulation.anchors.file, folder / "new/fixed.mha");
  fs::remove(folder / "new/mask.mha");
  EXPECT_EQ(session::load_recipe(folder / "new/one.json").mask.path, folder / "old/mask.mha")
      << "what is nowhere is named as it was given";
}

TEST(Recipe, NotesTheLabelsChecksumsAndWarnsWhereTheyChanged) {
  const TemporaryFolder folder;
  palpate::core::write_file(folder / "mask.mha", "mask");
  palpate::core::write_file(folder / "fixed.mha", "fixed");
  session::Recipe recipe;
  EXPECT_TRUE(session::note_label_checksums(recipe).empty()) << "there are no labels";
  recipe.mask.path = folder / "mask.mha";
  recipe.simulation.anchors.rule = session::AnchorSettings::Rule::file;
  recipe.simulation.anchors.file = folder / "fixed.mha";
  EXPECT_TRUE(session::note_label_checksums(recipe).empty());
  EXPECT_EQ(recipe.mask.sha256, session::file_sha256(folder / "mask.mha"));
  EXPECT_EQ(recipe.simulation.anchors.sha256, session::file_sha256(folder / "fixed.mha"));
  EXPECT_TRUE(session::note_label_checksums(recipe).empty()) << "nothing has changed";
  palpate::core::write_file(folder / "mask.mha", "another");
  auto warnings = session::note_label_checksums(recipe);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].code, "mask-changed");
  palpate::core::write_file(folder / "fixed.mha", "another");
  warnings = session::note_label_checksums(recipe);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].code, "anchors-changed");
  fs::remove(folder / "mask.mha");
  EXPECT_THROW(session::note_label_checksums(recipe), Error);
}

TEST(Recipe, ARelativePathStillLeadsToTheScanAfterSavingElsewhere) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "recipes");
  session::Recipe recipe;
  recipe.input.path = fs::path("scan.mha");  // of the working folder
  session::save_recipe(folder / "recipes/one.json", recipe);
  const auto read = session::load_recipe(folder / "recipes/one.json");
  EXPECT_EQ(fs::weakly_canonical(read.input.path), fs::weakly_canonical(fs::absolute("scan.mha")));
}

TEST(Recipe, LoadingNamesTheFileAndThePlace) {
  const TemporaryFolder folder;
  palpate::core::write_file(folder / "bad.json", "{\"version\": 1, \"tissue\": {\"stride\": 0}}");
  const auto error = usage_error_of([&] { session::load_recipe(folder / "bad.json"); });
  EXPECT_THAT(error, HasSubstr((folder / "bad.json").string() + ": tissue.stride"));
  for (const fs::path& path : {folder / "none.json", folder.path()}) {
    try {
      session::load_recipe(path);
      ADD_FAILURE() << "nothing was refused";
    } catch (const Error& refused) {
      EXPECT_EQ(refused.kind(), ErrorKind::input);
    }
  }
}

TEST(Recipe, TheChecksumIsOfTheParametersAndNotOfThePath) {
  const auto recipe = unusual_recipe();
  auto other = recipe;
  other.input.path = "/another/place.mha";
  other.mask.path = "/another/mask.mha";
  other.simulation.anchors.file = "/another/fixed.mha";
  EXPECT_EQ(session::recipe_sha256(other), session::recipe_sha256(recipe));
  EXPECT_EQ(session::recipe_sha256(recipe).size(), 64U);
  const std::function<void(session::Recipe&)> changes[] = {
      [](auto& r) { r.input.sha256[0] = 'b'; }, [](auto& r) { r.tissue.seed = 7; },
      [](auto& r) { r.filters.pop_back(); },    [](auto& r) { r.simulation.step_s.reset(); },
      [](auto& r) { r.surface.mapped = true; }, [](auto& r) { r.tissue.crop.reset(); },
      [](auto& r) { r.input.frame = 5; },       [](auto& r) { r.mask.sha256[0] = 'b'; },
      [](auto& r) { r.mask.path.reset(); },     [](auto& r) { r.simulation.anchors.sha256[0] = 'b'; },
      [](auto& r) { r.mask.label = 1; },        [](auto& r) { r.simulation.anchors.painted.clear(); },
  };
  for (const auto& change : changes) {
    auto changed = recipe;
    change(changed);
    EXPECT_NE(session::recipe_sha256(changed), session::recipe_sha256(recipe));
  }
}

TEST(WriteTextFile, ReplacesAWholeFileAndLeavesNothingBesideIt) {
  const TemporaryFolder folder;
  palpate::core::write_file(folder / "a.json", "old and longer");
  palpate::core::write_file(folder / "a.json", "new");
  EXPECT_EQ(fs::file_size(folder / "a.json"), 3U);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(WriteTextFile, FailuresAreOutputErrorsAndLeaveNothing) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "taken/inside");
  for (const fs::path& path : {folder / "none/a.json", folder / "taken"}) {
    try {
      palpate::core::write_file(path, "text");
      ADD_FAILURE() << "written: " << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::output);
      EXPECT_THAT(error.what(), HasSubstr(path.string()));
    }
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1) << "only the folder \"taken\"";
}
