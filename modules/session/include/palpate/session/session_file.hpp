#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/interaction/ray.hpp"
#include "palpate/session/recipe.hpp"

#include <Eigen/Core>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::session {

enum class LayoutKind { four_up, side_by_side, three_d_large };
enum class ShowKind { surface, points, links };
/// A view by its place in the window.
enum class ViewKind { axial, three_d, sagittal, coronal };

/// How far a slice view is zoomed, and what lies in its middle.
struct SliceFraming {
  double zoom_percent = 100.0;
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();  ///< LPS
};
/// How the views looked. What is absent is as a newly opened scan has it.
struct Views {
  LayoutKind layout = LayoutKind::four_up;
  std::optional<ViewKind> maximised;
  ShowKind show = ShowKind::surface;
  std::optional<Eigen::Vector3d> crosshair_mm;  ///< LPS; decides the slices
  std::optional<double> window, level;
  std::optional<SliceFraming> axial, sagittal, coronal;
  std::optional<interaction::Camera> camera;  ///< of the 3-D view
};

/// What a session file holds: all that is needed to make everything else
/// again. Moves, cuts and the simulation's state are no part of it.
struct Session {
  Recipe recipe;
  std::optional<int> tissue_frame;  ///< of the scan, where the tissue was built
  Views views;
  /// Where the session was last saved by the user; only in an autosave.
  std::filesystem::path saved_as;
};

constexpr const char* session_ending = ".palpate.json";

/// Sorted keys. Paths are written relative to `folder`, and the scan's
/// absolute one beside it as a hint.
std::string to_json(const Session& session, const std::filesystem::path& folder);
/// Written whole or not at all. Throws Error(output).
void save_session(const std::filesystem::path& path, const Session& session);

/// A session as its file has it, with the places where its scan may be.
struct LoadedSession {
  Session session;  ///< recipe.input.path is the first of `places`
  /// Absolute, in the order to try: beside the file, where it was, flat beside the file.
  std::vector<std::filesystem::path> places;
};
/// Throws Error(input) that names the file and the place in it: "not-found",
/// "too-large", "bad-session" for damage and unknown keys, "newer-version".
LoadedSession load_session(const std::filesystem::path& path);

/// What became of a session's scan.
struct FoundInput {
  enum class State { same, changed, missing };
  State state = State::missing;
  std::filesystem::path path;  ///< empty where missing
  std::string sha256;          ///< of what is at `path`
};
/// Looks at the places in their order for the scan with the session's
/// checksum; without it the first that exists counts as changed. A session
/// without a checksum takes the first that exists. Throws Error(cancelled).
FoundInput find_input(const LoadedSession& loaded, const core::Progress& progress = {});

}  // namespace palpate::session
