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
  recipe.tissue.links = model::LinkRule::six;
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
  EXPECT_EQ(session::to_json(read), session::to_json(recipe));
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
      {"{\"version\": 1, \"tissue\": {\"links\": \"lattice18\"}}", "tissue.links"},
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
      {"{\"version\": 1, \"simulation\": {\"integrator\": \"verlet\"}}", "simulation.integrator"},
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
  EXPECT_EQ(session::recipe_sha256(other), session::recipe_sha256(recipe));
  EXPECT_EQ(session::recipe_sha256(recipe).size(), 64U);
  const std::function<void(session::Recipe&)> changes[] = {
      [](auto& r) { r.input.sha256[0] = 'b'; }, [](auto& r) { r.tissue.seed = 7; },
      [](auto& r) { r.filters.pop_back(); },    [](auto& r) { r.simulation.step_s.reset(); },
      [](auto& r) { r.surface.mapped = true; }, [](auto& r) { r.tissue.crop.reset(); },
      [](auto& r) { r.input.frame = 5; },
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
