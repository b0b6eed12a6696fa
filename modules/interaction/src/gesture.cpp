#include "palpate/interaction/gesture.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <initializer_list>
#include <set>
#include <sstream>
#include <system_error>
#include <vector>

namespace palpate::interaction {
namespace {

using Json = nlohmann::json;

constexpr double radians_per_degree = 3.14159265358979323846 / 180.0;
/// No scan is a kilometre wide; squares of such numbers still fit everywhere.
constexpr double farthest_mm = 1e6;
constexpr double longest_s = 1e6;
constexpr std::uintmax_t largest_file = 64U << 20U;

[[noreturn]] void refuse(const std::string& place, const std::string& text) {
  core::throw_usage("Gesture: " + place + ": " + text);
}

std::string with_found(const Json& value, const std::string& text) {
  // Only the kind of what has members: printing goes as deep as they nest.
  if (value.is_structured()) return text + ", found " + (value.is_array() ? "a list." : "an object.");
  std::string found = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (found.size() > 40) found = found.substr(0, 40) + "...";
  return text + ", found " + found + ".";
}

/// One object of the file: its members by name, and where it stands.
class Node {
 public:
  Node(const Json& value, std::string place, std::initializer_list<const char*> known)
      : value_(value), place_(std::move(place)) {
    if (!value.is_object()) refuse(place_, with_found(value, "must be an object"));
    for (const auto& [key, member] : value.items()) {
      if (std::find(known.begin(), known.end(), key) != known.end()) continue;
      std::string text = "is unknown; known here are";
      for (const char* name : known) text += std::string(" ") + name;
      refuse(at(key), text + ".");
    }
  }

  std::string at(const std::string& key) const { return place_ == "file" ? key : place_ + "." + key; }
  const Json* find(const char* key) const {
    const auto found = value_.find(key);
    return found == value_.end() ? nullptr : &*found;
  }
  const Json& need(const char* key) const {
    const Json* found = find(key);
    if (found == nullptr) refuse(at(key), "is missing.");
    return *found;
  }

  double number(const char* key, double low, double high) const {
    return number(need(key), at(key), low, high);
  }
  double number_or(const char* key, double otherwise, double low, double high) const {
    return find(key) == nullptr ? otherwise : number(key, low, high);
  }
  /// Above `low`, not at it.
  double positive_or(const char* key, double otherwise, double high) const {
    const double value = number_or(key, otherwise, 0.0, high);
    if (value == 0.0) refuse(at(key), "must be above 0.");
    return value;
  }
  bool flag_or(const char* key, bool otherwise) const {
    const Json* found = find(key);
    if (found == nullptr) return otherwise;
    if (!found->is_boolean()) refuse(at(key), with_found(*found, "must be true or false"));
    return found->get<bool>();
  }
  std::string word(const char* key) const {
    const Json& found = need(key);
    if (!found.is_string()) refuse(at(key), with_found(found, "must be a word in quotes"));
    return found.get<std::string>();
  }
  const Json& list(const char* key) const {
    const Json& found = need(key);
    if (!found.is_array()) refuse(at(key), with_found(found, "must be a list"));
    return found;
  }
  Eigen::Vector3d vector(const char* key) const {
    const Json& found = need(key);
    if (!found.is_array() || found.size() != 3)
      refuse(at(key), with_found(found, "must be a list of three numbers"));
    Eigen::Vector3d result;
    for (std::size_t axis = 0; axis < 3; ++axis)
      result[static_cast<Eigen::Index>(axis)] =
          number(found[axis], at(key) + "[" + std::to_string(axis) + "]", -farthest_mm, farthest_mm);
    return result;
  }
  Eigen::Vector3d direction(const char* key) const {
    const Eigen::Vector3d found = vector(key);
    // A unit vector stays as it is, bit for bit, so that a file that is read
    // and written again does not drift.
    if (std::abs(found.norm() - 1.0) < 1e-12) return found;
    const Eigen::Vector3d unit = found.stableNormalized();
    if (!(std::abs(unit.norm() - 1.0) < 1e-9)) refuse(at(key), "must not be zero.");
    return unit;
  }

 private:
  static double number(const Json& value, const std::string& place, double low, double high) {
    if (!value.is_number()) refuse(place, with_found(value, "must be a number"));
    const auto found = value.get<double>();
    if (std::isfinite(found) && found >= low && found <= high) return found;
    std::ostringstream text;
    text << "must be from " << low << " to " << high;
    refuse(place, with_found(value, text.str()));
  }

  const Json& value_;
  std::string place_;
};

std::string numbered(const std::string& place, const char* list, std::size_t n) {
  return (place.empty() ? "" : place + ".") + list + "[" + std::to_string(n) + "]";
}

Camera camera_from(const Json& json, const std::string& place) {
  const Node node(
      json, place,
      {"position_mm", "focal_point_mm", "view_up", "view_angle_deg", "parallel", "parallel_scale_mm"});
  Camera camera;
  camera.position_mm = node.vector("position_mm");
  camera.focal_point_mm = node.vector("focal_point_mm");
  camera.view_up = node.direction("view_up");
  camera.view_angle_deg = node.positive_or("view_angle_deg", camera.view_angle_deg, 179.0);
  camera.parallel = node.flag_or("parallel", camera.parallel);
  camera.parallel_scale_mm = node.positive_or("parallel_scale_mm", camera.parallel_scale_mm, farthest_mm);
  try {
    ray_through(camera, 0.0, 0.0, 1.0);
  } catch (const core::Error& error) {
    refuse(place, error.what());
  }
  return camera;
}

GesturePoint point_from(const Json& json, const std::string& place) {
  const Node node(json, place, {"t_s", "ray"});
  GesturePoint point;
  point.t_s = node.number("t_s", 0.0, longest_s);
  const Node ray(node.need("ray"), node.at("ray"), {"origin_mm", "direction"});
  point.ray.origin_mm = ray.vector("origin_mm");
  point.ray.direction = ray.direction("direction");
  return point;
}

void check_tool(const std::string& tool, const std::string& place) {
  if (tool == "move") return;
  for (const char* later : {"cut", "cut-cone", "pin", "anchor", "probe", "undo", "redo"})
    if (tool == later)
      refuse(place, "the tool \"" + tool + "\" comes with a later version; this one has move.");
  refuse(place, "the tool \"" + tool + "\" is unknown; use move.");
}

/// `earliest_s` is where the step before it ended; moved to where this one ends.
GestureStep step_from(const Json& json, const std::string& place, double& earliest_s) {
  const Node node(json, place,
                  {"tool", "camera", "path", "radius_mm", "selection", "cone_half_angle_deg", "depth_mm"});
  GestureStep step;
  step.tool = node.word("tool");
  check_tool(step.tool, node.at("tool"));
  if (node.find("depth_mm") != nullptr)
    refuse(node.at("depth_mm"), "belongs to cuts, which come with a later version.");
  if (const Json* camera = node.find("camera")) step.camera = camera_from(*camera, node.at("camera"));
  step.radius_mm = node.positive_or("radius_mm", step.radius_mm, farthest_mm);
  if (node.find("selection") != nullptr) {
    try {
      step.selection = selection_kind_from(node.word("selection"));
    } catch (const core::Error& error) {
      const std::string text = error.what();
      if (text.rfind("Gesture: ", 0) == 0) throw;
      refuse(node.at("selection"), text);
    }
  }
  step.cone_half_angle_deg = node.number_or("cone_half_angle_deg", step.cone_half_angle_deg, 0.0, 89.0);

  const Json& path = node.list("path");
  if (path.empty()) refuse(node.at("path"), "must hold at least one place of the cursor.");
  step.path.reserve(path.size());
  for (std::size_t n = 0; n < path.size(); ++n) {
    const std::string here = numbered(place, "path", n);
    step.path.push_back(point_from(path[n], here));
    if (step.path.back().t_s < earliest_s) {
      std::ostringstream text;
      text << "is " << step.path.back().t_s << " s, before the " << earliest_s
           << " s that came earlier in the file.";
      refuse(here + ".t_s", text.str());
    }
    earliest_s = step.path.back().t_s;
  }
  return step;
}

std::string line_of(const std::string& text, std::size_t byte) {
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(byte, text.size()));
  return "line " + std::to_string(std::count(text.begin(), end, '\n') + 1);
}

/// Looks for keys that stand twice (the parser would take the last). Not the
/// parser's own callback: that looks through all elders of each value, which
/// takes hours for a long list.
class KeyWatch final : public nlohmann::json_sax<Json> {
 public:
  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_array(std::size_t) override { return true; }
  bool end_array() override { return true; }
  bool start_object(std::size_t) override {
    keys_.emplace_back();
    return true;
  }
  bool end_object() override {
    keys_.pop_back();
    return true;
  }
  bool key(string_t& name) override {
    if (!keys_.back().insert(name).second) refuse(name, "stands twice in one object.");
    return true;
  }
  /// The parser tells what is wrong.
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

 private:
  std::vector<std::set<std::string>> keys_;
};

/// Refuses what is not JSON.
Json parsed(const std::string& text) {
  try {
    Json json = Json::parse(text);
    KeyWatch watch;
    Json::sax_parse(text, &watch);
    return json;
  } catch (const Json::parse_error& error) {
    refuse(line_of(text, error.byte), "is not valid JSON from there on.");
  } catch (const Json::exception& error) {
    // A number too large for a double; the parser names it between quotes.
    const std::string reason = error.what();
    const std::size_t open = reason.find('\'');
    const std::size_t close = reason.rfind('\'');
    const std::string token = open < close ? reason.substr(open + 1, close - open - 1) : std::string();
    refuse(line_of(text, token.empty() ? 0 : text.find(token)),
           "holds a number that is too large" + (token.empty() ? "." : " (" + token.substr(0, 40) + ")."));
  }
}

Json to_list(const Eigen::Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

}  // namespace

double Gesture::end_s() const noexcept {
  double end = 0.0;
  for (const GestureStep& step : steps)
    if (!step.path.empty()) end = std::max(end, step.path.back().t_s);
  return end;
}

PickReach reach_of(const GestureStep& step) {
  PickReach reach;
  reach.cone_half_angle_deg = step.cone_half_angle_deg;
  if (step.camera && step.camera->parallel) {
    reach.cylinder_radius_mm = std::tan(step.cone_half_angle_deg * radians_per_degree) *
                               (step.camera->focal_point_mm - step.camera->position_mm).norm();
    reach.cone_half_angle_deg = 0.0;
  }
  return reach;
}

double cone_half_angle_deg_of(const PickReach& reach, const Camera& camera) {
  if (!(reach.cylinder_radius_mm > 0.0)) return reach.cone_half_angle_deg;
  return std::atan2(reach.cylinder_radius_mm, (camera.focal_point_mm - camera.position_mm).norm()) /
         radians_per_degree;
}

Gesture parse_gesture(const std::string& json_text) {
  const Json json = parsed(json_text);
  const Node file(json, "file", {"version", "steps"});
  Gesture gesture;
  const Json& version = file.need("version");
  if (!version.is_number_integer() || version != 1) refuse("version", with_found(version, "must be 1"));
  const Json& steps = file.list("steps");
  double earliest_s = 0.0;
  for (std::size_t n = 0; n < steps.size(); ++n)
    gesture.steps.push_back(step_from(steps[n], numbered("", "steps", n), earliest_s));
  return gesture;
}

Gesture load_gesture(const std::filesystem::path& path) {
  const auto unreadable = [&](const std::string& why) -> core::Error {
    return {core::ErrorKind::input, "gesture-unreadable",
            "The gesture file \"" + path.string() + "\" " + why + ". Name a gesture file that can be read."};
  };
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw unreadable("does not exist");
  if (!std::filesystem::is_regular_file(path, error)) throw unreadable("is not a file");
  if (std::filesystem::file_size(path, error) > largest_file) throw unreadable("is larger than 64 MB");
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream || (text.str().empty() && std::filesystem::file_size(path, error) > 0))
    throw unreadable("cannot be read");
  return parse_gesture(text.str());
}

std::string to_json(const Gesture& gesture) {
  Json file{{"version", gesture.version}, {"steps", Json::array()}};
  for (const GestureStep& step : gesture.steps) {
    Json path = Json::array();
    for (const GesturePoint& point : step.path)
      path.push_back(
          {{"t_s", point.t_s},
           {"ray",
            {{"origin_mm", to_list(point.ray.origin_mm)}, {"direction", to_list(point.ray.direction)}}}});
    Json json{{"tool", step.tool},
              {"path", std::move(path)},
              {"radius_mm", step.radius_mm},
              {"selection", to_string(step.selection)},
              {"cone_half_angle_deg", step.cone_half_angle_deg}};
    if (step.camera)
      json["camera"] = {{"position_mm", to_list(step.camera->position_mm)},
                        {"focal_point_mm", to_list(step.camera->focal_point_mm)},
                        {"view_up", to_list(step.camera->view_up)},
                        {"view_angle_deg", step.camera->view_angle_deg},
                        {"parallel", step.camera->parallel},
                        {"parallel_scale_mm", step.camera->parallel_scale_mm}};
    file["steps"].push_back(std::move(json));
  }
  return file.dump(2) + "\n";
}

void check_within(const Gesture& gesture, double end_s) {
  // The end is a number of steps times the step: a few roundings.
  const double last_s = end_s * (1.0 + 1e-9);
  for (std::size_t s = 0; s < gesture.steps.size(); ++s)
    for (std::size_t p = 0; p < gesture.steps[s].path.size(); ++p) {
      const double t_s = gesture.steps[s].path[p].t_s;
      if (t_s <= last_s) continue;
      std::ostringstream text;
      text << "is " << t_s << " s, beyond the end of the run at " << end_s
           << " s; run longer or shorten the gesture.";
      refuse(numbered(numbered("", "steps", s), "path", p) + ".t_s", text.str());
    }
}

}  // namespace palpate::interaction
