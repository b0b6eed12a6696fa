#include "palpate/interaction/gesture.hpp"

#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <fstream>

using namespace palpate::interaction;
using palpate::core::Error;
using palpate::core::ErrorKind;

namespace {

std::string file_with(const std::string& steps) { return "{\"version\": 1, \"steps\": [" + steps + "]}"; }
std::string ray(const std::string& origin = "[1, 2, 3]", const std::string& direction = "[0, 3, 4]") {
  return R"({"origin_mm": )" + origin + R"(, "direction": )" + direction + "}";
}
std::string at(const std::string& t, const std::string& r = ray()) {
  return R"({"t_s": )" + t + R"(, "ray": )" + r + "}";
}
std::string drag(const std::string& path, const std::string& more = "") {
  return R"({"tool": "move", "path": [)" + path + "]" + more + "}";
}
std::string camera(const std::string& more = "") {
  return R"(, "camera": {"position_mm": [0, -9, 0], "focal_point_mm": [0, 0, 0], "view_up": [0, 0, 1])" +
         more + "}";
}

Error refusal_of(const std::string& text) {
  try {
    parse_gesture(text);
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorKind::internal, "none", "nothing was thrown");
}

bool same(const Gesture& a, const Gesture& b) {
  if (a.version != b.version || a.steps.size() != b.steps.size()) return false;
  for (std::size_t s = 0; s < a.steps.size(); ++s) {
    const GestureStep& x = a.steps[s];
    const GestureStep& y = b.steps[s];
    if (x.tool != y.tool || x.radius_mm != y.radius_mm || x.selection != y.selection ||
        x.cone_half_angle_deg != y.cone_half_angle_deg || x.path.size() != y.path.size() ||
        x.camera.has_value() != y.camera.has_value())
      return false;
    for (std::size_t p = 0; p < x.path.size(); ++p)
      if (x.path[p].t_s != y.path[p].t_s || x.path[p].ray.origin_mm != y.path[p].ray.origin_mm ||
          x.path[p].ray.direction != y.path[p].ray.direction)
        return false;
    if (!x.camera) continue;
    if (x.camera->position_mm != y.camera->position_mm ||
        x.camera->focal_point_mm != y.camera->focal_point_mm || x.camera->view_up != y.camera->view_up ||
        x.camera->view_angle_deg != y.camera->view_angle_deg || x.camera->parallel != y.camera->parallel ||
        x.camera->parallel_scale_mm != y.camera->parallel_scale_mm)
      return false;
  }
  return true;
}

}  // namespace

TEST(Gesture, IsReadWithItsDefaults) {
  const Gesture gesture = parse_gesture(file_with(drag(at("0.25") + "," + at("0.25") + "," + at("1.5"))));
  ASSERT_EQ(gesture.steps.size(), 1U);
  const GestureStep& step = gesture.steps[0];
  EXPECT_EQ(step.tool, "move");
  EXPECT_FALSE(step.camera);
  EXPECT_EQ(step.radius_mm, 5.0);
  EXPECT_EQ(step.selection, SelectionKind::sphere);
  EXPECT_EQ(step.cone_half_angle_deg, 1.0);
  ASSERT_EQ(step.path.size(), 3U);
  EXPECT_EQ(step.path[0].t_s, 0.25);
  EXPECT_EQ(step.path[0].ray.origin_mm, Eigen::Vector3d(1, 2, 3));
  EXPECT_LT((step.path[0].ray.direction - Eigen::Vector3d(0, 0.6, 0.8)).norm(), 1e-15);
  EXPECT_EQ(gesture.end_s(), 1.5);
  EXPECT_EQ(parse_gesture(file_with("")).end_s(), 0.0);
}

TEST(Gesture, IsReadWithAllItsMembers) {
  const Gesture gesture = parse_gesture(file_with(
      drag(at("0"), R"(, "radius_mm": 7.5, "selection": "connected", "cone_half_angle_deg": 2)" +
                        camera(R"(, "view_angle_deg": 40, "parallel": true, "parallel_scale_mm": 60)"))));
  const GestureStep& step = gesture.steps.at(0);
  EXPECT_EQ(step.radius_mm, 7.5);
  EXPECT_EQ(step.selection, SelectionKind::connected);
  EXPECT_EQ(step.cone_half_angle_deg, 2.0);
  ASSERT_TRUE(step.camera);
  EXPECT_EQ(step.camera->position_mm, Eigen::Vector3d(0, -9, 0));
  EXPECT_EQ(step.camera->view_angle_deg, 40.0);
  EXPECT_TRUE(step.camera->parallel);
  EXPECT_EQ(step.camera->parallel_scale_mm, 60.0);
}

TEST(Gesture, ComesBackBitForBit) {
  Gesture gesture;
  for (int s = 0; s < 3; ++s) {
    GestureStep step;
    step.radius_mm = 1.0 / (s + 3);
    step.selection = static_cast<SelectionKind>(s);
    step.cone_half_angle_deg = 0.1 * s;
    for (int p = 0; p < 5; ++p) {
      const double turn = 0.37 * (5 * s + p);
      step.path.push_back({0.1 * (5 * s + p),
                           {{turn / 3, -turn * 7, 1e-17},
                            Eigen::Vector3d(std::sin(turn), std::cos(turn), 0.3).normalized()}});
    }
    if (s > 0) {
      step.camera = Camera();
      step.camera->parallel = s == 2;
      step.camera->view_up = Eigen::Vector3d(0.1, 0.2, 0.9).normalized();
      step.camera->position_mm = {1.0 / 3.0, -80.1, 2};
    }
    gesture.steps.push_back(step);
  }
  const Gesture once = parse_gesture(to_json(gesture));
  EXPECT_TRUE(same(once, gesture));
  EXPECT_EQ(to_json(once), to_json(gesture));
}

TEST(Gesture, IsRefusedWithThePlace) {
  const std::string good = at("0");
  const std::vector<std::pair<std::string, std::string>> wrong{
      {"", "line 1"},
      {"{\"version\": 1,\n\"steps\": [}", "line 2"},
      {std::string(100000, '['), "line 1"},
      {"\"\xff\"", "line 1"},
      {"[]", "file"},
      {"{\"steps\": []}", "version"},
      {"{\"version\": 2, \"steps\": []}", "version"},
      {"{\"version\": 1.0, \"steps\": []}", "version"},
      {"{\"version\": 1}", "steps"},
      {"{\"version\": 1, \"steps\": {}}", "steps"},
      {"{\"version\": 1, \"version\": 1, \"steps\": []}", "version"},
      {"{\"version\": 1, \"steps\": [], \"extra\": 0}", "extra"},
      {file_with("7"), "steps[0]"},
      {file_with(R"({"path": []})"), "steps[0].tool"},
      {file_with(R"({"tool": 3, "path": []})"), "steps[0].tool"},
      {file_with(R"({"tool": "stretch", "path": []})"), "steps[0].tool"},
      {file_with(R"({"tool": "move"})"), "steps[0].path"},
      {file_with(drag("")), "steps[0].path"},
      {file_with(R"({"tool": "move", "path": {}})"), "steps[0].path"},
      {file_with(drag("3")), "steps[0].path[0]"},
      {file_with(drag(good, R"(, "colour": "red")")), "steps[0].colour"},
      {file_with(drag(good, R"(, "radius_mm": "5")")), "steps[0].radius_mm"},
      {file_with(drag(good, R"(, "radius_mm": true)")), "steps[0].radius_mm"},
      {file_with(drag(good, R"(, "radius_mm": null)")), "steps[0].radius_mm"},
      {file_with(drag(good, R"(, "radius_mm": 0)")), "steps[0].radius_mm"},
      {file_with(drag(good, R"(, "radius_mm": -1)")), "steps[0].radius_mm"},
      {file_with(drag(good, ",\n\"radius_mm\": 1e999")), "line 2"},
      {file_with(drag(good, R"(, "radius_mm": NaN)")), "line 1"},
      {file_with(drag(good, R"(, "depth_mm": 3)")), "steps[0].depth_mm"},
      {file_with(drag(good, R"(, "selection": "all")")), "steps[0].selection"},
      {file_with(drag(good, R"(, "selection": 1)")), "steps[0].selection"},
      {file_with(drag(good, R"(, "cone_half_angle_deg": 90)")), "steps[0].cone_half_angle_deg"},
      {file_with(drag(good, R"(, "camera": 4)")), "steps[0].camera"},
      {file_with(drag(good, R"(, "camera": {})")), "steps[0].camera.position_mm"},
      {file_with(drag(good, camera(R"(, "parallel": 1)"))), "steps[0].camera.parallel"},
      {file_with(drag(good, camera(R"(, "view_angle_deg": 0)"))), "steps[0].camera.view_angle_deg"},
      {file_with(drag(good, camera(R"(, "roll": 0)"))), "steps[0].camera.roll"},
      {file_with(drag(
           good, R"(, "camera": {"position_mm": [0,0,1], "focal_point_mm": [0,0,1], "view_up": [0,1,0]})")),
       "steps[0].camera"},
      {file_with(drag(good) + "," + drag(good) + "," + drag(at("0", ray("[0,0,0]", "[0,0,0]")))),
       "steps[2].path[0].ray.direction"},
      {file_with(drag(at("0", ray("[0,0]")))), "steps[0].path[0].ray.origin_mm"},
      {file_with(drag(at("0", ray("[0,0,\"z\"]")))), "steps[0].path[0].ray.origin_mm[2]"},
      {file_with(drag(at("0", ray("[0,0,1e300]")))), "steps[0].path[0].ray.origin_mm[2]"},
      {file_with(drag(at("0", R"({"origin_mm": [0,0,0]})"))), "steps[0].path[0].ray.direction"},
      {file_with(drag(at("0", R"({"origin_mm": [0,0,0], "direction": [0,0,1], "d": 1})"))),
       "steps[0].path[0].ray.d"},
      {file_with(drag(R"({"t_s": 0})")), "steps[0].path[0].ray"},
      {file_with(drag(R"({"ray": )" + ray() + "}")), "steps[0].path[0].t_s"},
      {file_with(drag(at("-0.1"))), "steps[0].path[0].t_s"},
      {file_with(drag(at("1") + "," + at("0.5"))), "steps[0].path[1].t_s"},
      {file_with(drag(at("1")) + "," + drag(at("0.5"))), "steps[1].path[0].t_s"},
  };
  for (const auto& [text, place] : wrong) {
    const Error error = refusal_of(text);
    EXPECT_EQ(error.kind(), ErrorKind::usage) << text.substr(0, 200);
    EXPECT_NE(std::string(error.what()).find("Gesture: " + place + ": "), std::string::npos)
        << "expected " << place << " in: " << error.what();
  }
}

TEST(Gesture, ALongFileIsReadInATimeThatGrowsWithItsLength) {
  std::string text = R"({"version":1,"steps":[)";
  for (int n = 0; n < 200000; ++n) text += R"({"tool":"move"},)";
  text += "{}]}";
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THROW(parse_gesture(text), Error);
  // A quarter of a second as it should be; half a minute where each object looks at all before it.
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(8));
}

TEST(Gesture, SaysWhatComesWithALaterVersion) {
  for (const std::string tool : {"cut", "cut-cone", "pin", "anchor", "probe", "undo", "redo"}) {
    const Error error = refusal_of(file_with("{\"tool\": \"" + tool + "\", \"path\": [" + at("0") + "]}"));
    EXPECT_EQ(error.kind(), ErrorKind::usage);
    EXPECT_NE(
        std::string(error.what()).find("steps[0].tool: the tool \"" + tool + "\" comes with a later version"),
        std::string::npos)
        << error.what();
  }
  const Error error = refusal_of(file_with(drag(at("0"), R"(, "selection": "geodesic")")));
  EXPECT_NE(std::string(error.what()).find("later version"), std::string::npos) << error.what();
}

TEST(Gesture, MustEndWithinTheRun) {
  const Gesture gesture = parse_gesture(file_with(drag(at("0.1")) + "," + drag(at("0.2") + "," + at("0.3"))));
  EXPECT_NO_THROW(check_within(gesture, 0.3));
  EXPECT_NO_THROW(check_within(gesture, 3 * 0.1 * (1 - 1e-15)));  // steps times the step, rounded
  try {
    check_within(gesture, 0.25);
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::usage);
    EXPECT_NE(std::string(error.what()).find("steps[1].path[1].t_s"), std::string::npos) << error.what();
  }
}

TEST(Gesture, IsLoadedFromAFile) {
  const palpate::testing::TemporaryFolder folder;
  std::ofstream(folder / "drag.json") << file_with(drag(at("0.5")));
  EXPECT_EQ(load_gesture(folder / "drag.json").end_s(), 0.5);
  for (const auto& path : {folder / "missing.json", folder.path()}) {
    try {
      load_gesture(path);
      FAIL() << "nothing was thrown";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::input);
      EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos);
    }
  }
}

TEST(Gesture, ReachOfAParallelCameraIsACylinder) {
  GestureStep step;
  step.cone_half_angle_deg = 2.0;
  EXPECT_EQ(reach_of(step).cone_half_angle_deg, 2.0);
  EXPECT_EQ(reach_of(step).cylinder_radius_mm, 0.0);
  step.camera = Camera();
  step.camera->position_mm = {0, -100, 0};
  EXPECT_EQ(reach_of(step).cylinder_radius_mm, 0.0);

  step.camera->parallel = true;
  const PickReach reach = pick_reach(*step.camera, 10, 500);
  step.cone_half_angle_deg = cone_half_angle_deg_of(reach, *step.camera);
  EXPECT_NEAR(reach_of(step).cylinder_radius_mm, reach.cylinder_radius_mm, 1e-12);  // tan of atan
  EXPECT_EQ(reach_of(step).cone_half_angle_deg, 0.0);
}
