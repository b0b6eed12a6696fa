#pragma once

#include "palpate/interaction/move_tool.hpp"
#include "palpate/interaction/ray.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::interaction {

struct GesturePoint {
  double t_s = 0.0;  ///< from the start of the run
  Ray ray;
};
/// One use of a tool. Only "move" so far.
struct GestureStep {
  std::string tool = "move";
  std::optional<Camera> camera;
  std::vector<GesturePoint> path;  ///< times never fall, also from step to step; at least one
  double radius_mm = 5.0;
  SelectionKind selection = SelectionKind::sphere;
  double cone_half_angle_deg = 1.0;  ///< 0..89; for a parallel camera see reach_of()
};
/// The reach of a recorded pick. A file knows only the cone; for a parallel
/// camera the cylinder is as wide as that cone at the camera's focal point.
PickReach reach_of(const GestureStep& step);
/// What to record, so that reach_of() gives this reach again.
double cone_half_angle_deg_of(const PickReach& reach, const Camera& camera);

struct Gesture {
  int version = 1;
  std::vector<GestureStep> steps;
  double end_s() const noexcept;
};

/// JSON of docs/cli.md. Throws Error(usage) with the place in the text
/// ("steps[2].path[0].ray.direction: ..."), also for tools and selections that
/// a later version brings. Directions are normalised; a zero one is refused.
Gesture parse_gesture(const std::string& json_text);
Gesture load_gesture(const std::filesystem::path& path);  ///< Error(input) where unreadable
std::string to_json(const Gesture& gesture);
/// Throws Error(usage) where a path runs beyond `end_s`.
void check_within(const Gesture& gesture, double end_s);

}  // namespace palpate::interaction
