#include "palpate/session/session_file.hpp"

#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace palpate::session {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

void put(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// Nothing in it stands at its default.
Session full(const fs::path& scan) {
  Session session;
  auto& recipe = session.recipe;
  recipe.input.path = scan;
  recipe.input.sha256 = "abc";
  recipe.input.series_uid = "1.2.3";
  recipe.input.frame = 4;
  recipe.input.spacing_mm = {0.4, 0.5, 0.6};
  recipe.input.orientation = "RAS";
  recipe.input.grid_spacing_mm = 0.75;
  recipe.input.allow_truncated = true;
  recipe.filters = {imaging::parse_filter("median:radius=2"), imaging::parse_filter("gaussian:sigma=1.5")};
  recipe.tissue.threshold_low = 40.5;
  recipe.tissue.threshold_high = 200.0;
  recipe.tissue.crop = model::CropBox{{1, 2, 3}, {10, 20, 30}};
  recipe.tissue.stride = 2;
  recipe.tissue.noise = 0.25;
  recipe.tissue.seed = 99;
  recipe.tissue.links = model::LinkRule::nearest;
  recipe.tissue.max_links = 9;
  recipe.tissue.min_component = 17;
  recipe.surface.mapped = false;
  recipe.surface.mesh = scan.parent_path() / "mesh.stl";
  recipe.surface.mesh_space = surface::MeshSpace::ras;
  recipe.surface.face_budget = 1234;
  recipe.simulation.parameters.stiffness_per_s2 = 111.0;
  recipe.simulation.parameters.damping_per_s = 2.5;
  recipe.simulation.parameters.drag_per_s = 0.5;
  recipe.simulation.parameters.gravity_mm_per_s2 = {1.0, -2.0, 3.0};
  recipe.simulation.step_s = 0.001;
  recipe.mask.path = scan.parent_path() / "mask.mha";
  recipe.mask.label = 2;
  recipe.simulation.layout = simulation::LayoutChoice::explicit_links;
  recipe.simulation.anchors.rule = AnchorSettings::Rule::file;
  recipe.simulation.anchors.file = scan.parent_path() / "anchors.mha";
  session.tissue_frame = 3;
  auto& views = session.views;
  views.layout = LayoutKind::three_d_large;
  views.maximised = ViewKind::sagittal;
  views.show = ShowKind::links;
  views.crosshair_mm = Eigen::Vector3d(1.25, -2.5, 0.1);
  views.window = 99.5;
  views.level = -3.25;
  views.axial = SliceFraming{150.0, {1, 2, 3}};
  views.sagittal = SliceFraming{80.0, {4, 5, 6}};
  views.coronal = SliceFraming{33.3, {-7, 8, -9}};
  interaction::Camera camera;
  camera.position_mm = {10, 20, 30};
  camera.focal_point_mm = {1, 2, 3};
  camera.view_up = {0, 1, 0};
  camera.view_angle_deg = 25.0;
  camera.parallel = true;
  camera.parallel_scale_mm = 55.0;
  views.camera = camera;
  session.saved_as = scan.parent_path() / "mine.palpate.json";
  return session;
}

/// Code and words of the refusal.
std::string refusal(const fs::path& path, const std::string& code) {
  try {
    load_session(path);
  } catch (const core::Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::input);
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "it was accepted";
  return {};
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), by);
}

TEST(SessionFile, EverythingComesBack) {
  const TemporaryFolder folder;
  const Session session = full(folder / "scan.mha");
  const fs::path path = folder / "a.palpate.json";
  save_session(path, session);
  const LoadedSession loaded = load_session(path);
  // The text holds every value, so equal texts are equal sessions; that each
  // value is read and not merely kept is what the members below show.
  EXPECT_EQ(to_json(loaded.session, folder.path()), to_json(session, folder.path()));
  const auto& recipe = loaded.session.recipe;
  EXPECT_EQ(recipe.input.path, session.recipe.input.path);
  EXPECT_EQ(recipe.input.series_uid, "1.2.3");
  EXPECT_EQ(recipe.input.frame, 4);
  EXPECT_EQ(recipe.input.spacing_mm, session.recipe.input.spacing_mm);
  EXPECT_EQ(recipe.input.orientation, "RAS");
  EXPECT_EQ(recipe.input.grid_spacing_mm, 0.75);
  ASSERT_EQ(recipe.filters.size(), 2U);
  EXPECT_EQ(imaging::to_string(recipe.filters[1]), imaging::to_string(session.recipe.filters[1]));
  EXPECT_EQ(recipe.tissue.crop->end, (std::array<int, 3>{10, 20, 30}));
  EXPECT_EQ(recipe.surface.mesh, session.recipe.surface.mesh);
  EXPECT_EQ(recipe.simulation.step_s, 0.001);
  EXPECT_EQ(recipe.mask.path, session.recipe.mask.path);
  EXPECT_EQ(recipe.mask.label, 2);
  EXPECT_EQ(recipe.simulation.layout, simulation::LayoutChoice::explicit_links);
  EXPECT_EQ(recipe.simulation.anchors.file, session.recipe.simulation.anchors.file);
  EXPECT_EQ(loaded.session.tissue_frame, 3);
  EXPECT_EQ(loaded.session.saved_as, session.saved_as);
  const auto& views = loaded.session.views;
  EXPECT_EQ(views.layout, LayoutKind::three_d_large);
  EXPECT_EQ(views.maximised, ViewKind::sagittal);
  EXPECT_EQ(views.show, ShowKind::links);
  EXPECT_EQ(views.crosshair_mm, Eigen::Vector3d(1.25, -2.5, 0.1));
  EXPECT_EQ(views.window, 99.5);
  EXPECT_EQ(views.level, -3.25);
  EXPECT_EQ(views.axial->zoom_percent, 150.0);
  EXPECT_EQ(views.sagittal->middle_mm, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(views.coronal->zoom_percent, 33.3);
  EXPECT_EQ(views.camera->position_mm, Eigen::Vector3d(10, 20, 30));
  EXPECT_EQ(views.camera->view_angle_deg, 25.0);
  EXPECT_TRUE(views.camera->parallel);
}

TEST(SessionFile, DefaultsComeBackAsDefaults) {
  const TemporaryFolder folder;
  Session session;
  session.recipe.input.path = folder / "scan.mha";
  save_session(folder / "a.palpate.json", session);
  const auto loaded = load_session(folder / "a.palpate.json").session;
  EXPECT_FALSE(loaded.tissue_frame);
  EXPECT_FALSE(loaded.views.maximised);
  EXPECT_FALSE(loaded.views.crosshair_mm);
  EXPECT_FALSE(loaded.views.camera);
  EXPECT_FALSE(loaded.recipe.surface.mesh);
  EXPECT_TRUE(loaded.saved_as.empty());
}

TEST(SessionFile, AMovedFolderIsFoundByItsRelativePath) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "study" / fs::path("scans"));
  fs::create_directories(folder / "study" / fs::path("sessions"));
  const fs::path scan = folder / "study" / fs::path("scans") / "a.mha";
  put(scan, "voxels");
  put(scan.parent_path() / "mesh.stl", "mesh");
  put(scan.parent_path() / "mask.mha", "mask");
  Session session = full(scan);
  session.recipe.input.sha256 = file_sha256(scan);
  const fs::path file = folder / "study" / fs::path("sessions") / "a.palpate.json";
  save_session(file, session);
  EXPECT_THAT(text_of(file), HasSubstr("\"../scans/a.mha\""));
  fs::rename(folder / "study", folder / "elsewhere");
  const auto loaded = load_session(folder / "elsewhere" / fs::path("sessions") / "a.palpate.json");
  const auto found = find_input(loaded);
  EXPECT_EQ(found.state, FoundInput::State::same);
  EXPECT_EQ(found.path, folder / "elsewhere" / fs::path("scans") / "a.mha");
  EXPECT_EQ(loaded.session.recipe.surface.mesh, folder / "elsewhere" / fs::path("scans") / "mesh.stl");
  EXPECT_EQ(loaded.session.recipe.mask.path, folder / "elsewhere" / fs::path("scans") / "mask.mha");
}

TEST(SessionFile, ASessionMovedAloneFindsTheScanWhereItWas) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "scans");
  fs::create_directory(folder / "mail");
  Session session = full(folder / "scans" / fs::path("a.mha"));
  put(session.recipe.input.path, "voxels");
  session.recipe.input.sha256 = file_sha256(session.recipe.input.path);
  save_session(folder / "scans" / fs::path("a.palpate.json"), session);
  fs::rename(folder / "scans" / fs::path("a.palpate.json"), folder / "mail" / fs::path("a.palpate.json"));
  // Another scan of that name beside it is not taken for it.
  put(folder / "mail" / fs::path("a.mha"), "other voxels");
  const auto found = find_input(load_session(folder / "mail" / fs::path("a.palpate.json")));
  EXPECT_EQ(found.state, FoundInput::State::same);
  EXPECT_EQ(found.path, session.recipe.input.path);
}

TEST(SessionFile, AScanThatChangedOrIsGoneIsTold) {
  const TemporaryFolder folder;
  Session session = full(folder / "a.mha");
  put(folder / "a.mha", "voxels");
  session.recipe.input.sha256 = file_sha256(folder / "a.mha");
  save_session(folder / "a.palpate.json", session);
  put(folder / "a.mha", "voxelz");
  auto found = find_input(load_session(folder / "a.palpate.json"));
  EXPECT_EQ(found.state, FoundInput::State::changed);
  EXPECT_EQ(found.path, folder / "a.mha");
  EXPECT_EQ(found.sha256, file_sha256(folder / "a.mha"));
  fs::remove(folder / "a.mha");
  found = find_input(load_session(folder / "a.palpate.json"));
  EXPECT_EQ(found.state, FoundInput::State::missing);
  EXPECT_TRUE(found.path.empty());
}

TEST(SessionFile, ASessionBesideItsSeriesDoesNotChangeIt) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "series");
  put(folder / "series" / fs::path("1.dcm"), "one");
  const std::string before = file_sha256(folder / "series");
  Session session = full(folder / "series");
  session.recipe.input.sha256 = before;
  save_session(folder / "series" / fs::path("a.palpate.json"), session);
  EXPECT_EQ(file_sha256(folder / "series"), before);
  EXPECT_EQ(find_input(load_session(folder / "series" / fs::path("a.palpate.json"))).state,
            FoundInput::State::same);
  put(folder / "series" / fs::path("2.dcm"), "two");
  EXPECT_NE(file_sha256(folder / "series"), before);
}

TEST(SessionFile, WhatDoesNotFitIsRefusedWithItsPlace) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.palpate.json";
  const std::string good = to_json(full(folder / "scan.mha"), folder.path());
  const auto refused = [&](const std::string& text) {
    put(path, text);
    return refusal(path, "bad-session");
  };
  EXPECT_THAT(refused(replaced(good, "\"layout\": \"3d-large\"", "\"layouts\": \"3d-large\"")),
              HasSubstr("views.layouts"));
  EXPECT_THAT(refused(replaced(good, "\"3d-large\"", "\"huge\"")), HasSubstr("views.layout"));
  EXPECT_THAT(refused(replaced(good, "\"max_links\": 9", "\"max_links\": 900")),
              HasSubstr("recipe.tissue.max_links"));
  EXPECT_THAT(refused(replaced(good, "\"median\"", "\"magic\"")), HasSubstr("recipe.filters[0]"));
  EXPECT_THAT(refused(replaced(good, "\"tissue_frame\": 3", "\"tissue_frame\": -3")),
              HasSubstr("tissue_frame"));
  EXPECT_THAT(refused(replaced(good, "\"zoom_percent\": 150.0", "\"zoom_percent\": 0")),
              HasSubstr("views.axial.zoom_percent"));
  EXPECT_THAT(refused(replaced(good, "\"version\": 1,\n  \"views\"", "\"views\"")), HasSubstr("version"));
  EXPECT_THAT(refused("[1, 2]"), HasSubstr("an object"));
  EXPECT_THAT(refused("{}"), HasSubstr("kind"));
  EXPECT_THAT(refused(""), HasSubstr("line 1"));
}

TEST(SessionFile, ACutOffFileIsRefusedWhereverItEnds) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.palpate.json";
  const std::string good = to_json(full(folder / "scan.mha"), folder.path());
  for (std::size_t length = 0; length + 2 < good.size(); length += 97) {
    put(path, good.substr(0, length));
    EXPECT_THAT(refusal(path, "bad-session"), HasSubstr("a.palpate.json")) << length;
  }
}

TEST(SessionFile, ALaterVersionSaysSo) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.palpate.json";
  const std::string good = to_json(full(folder / "scan.mha"), folder.path());
  // Of a later version nothing is known: its new keys are no damage.
  const auto at = good.rfind("\"version\": 1");
  const auto other = good.find("\"version\": 1");
  ASSERT_NE(at, other) << "the recipe has one of its own";
  std::string newer = good;
  newer.replace(at, 12, "\"version\": 7, \"hologram\": true");
  put(path, newer);
  EXPECT_THAT(refusal(path, "newer-version"), HasSubstr("later version"));
}

TEST(SessionFile, AMissingOrHugeFileIsRefused) {
  const TemporaryFolder folder;
  refusal(folder / "none.palpate.json", "not-found");
  refusal(folder.path(), "not-found");
  put(folder / "huge.palpate.json", "");
  fs::resize_file(folder / "huge.palpate.json", std::uintmax_t{1} << 30);
  refusal(folder / "huge.palpate.json", "too-large");
}

TEST(SessionFile, AFullDiskOrAClosedFolderLeavesTheOlderSession) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.palpate.json";
  put(path, "older");
  const Session session = full(folder / "scan.mha");
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{64, 64};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    try {
      save_session(path, session);
    } catch (const core::Error& error) {
      ::_exit(error.exit_code());
    } catch (...) {
      ::_exit(99);
    }
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 6) << status;
  EXPECT_EQ(text_of(path), "older");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
  // Nobody, not even the superuser, can make a file here.
  try {
    save_session("/proc/a.palpate.json", session);
    ADD_FAILURE() << "it was written";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::output);
  }
}

}  // namespace
}  // namespace palpate::session
