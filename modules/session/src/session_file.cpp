#include "palpate/session/session_file.hpp"

#include "json_reader.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

namespace palpate::session {
namespace fs = std::filesystem;
using core::Error;
using core::ErrorKind;
using nlohmann::json;

namespace {

constexpr int current_version = 1;
constexpr const char* kind_word = "palpate-session";
constexpr std::size_t largest_bytes = std::size_t{16} << 20U;
constexpr double farthest_mm = 1e9;

const std::vector<std::string>& layout_words() {
  static const std::vector<std::string> words{"four-up", "side-by-side", "3d-large"};
  return words;
}
const std::vector<std::string>& show_words() {
  static const std::vector<std::string> words{"surface", "points", "links"};
  return words;
}
const std::vector<std::string>& view_words() {
  static const std::vector<std::string> words{"axial", "3d", "sagittal", "coronal"};
  return words;
}

json vector_value(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

template <typename Value, typename Make>
json optional_value(const std::optional<Value>& value, Make make) {
  return value ? make(*value) : json(nullptr);
}

json to_value(const SliceFraming& framing) {
  return {{"zoom_percent", framing.zoom_percent}, {"middle_mm", vector_value(framing.middle_mm)}};
}

json to_value(const interaction::Camera& camera) {
  return {{"position_mm", vector_value(camera.position_mm)},
          {"focal_point_mm", vector_value(camera.focal_point_mm)},
          {"view_up", vector_value(camera.view_up)},
          {"view_angle_deg", camera.view_angle_deg},
          {"parallel", camera.parallel},
          {"parallel_scale_mm", camera.parallel_scale_mm}};
}

json to_value(const Views& views) {
  const auto framing = [](const SliceFraming& one) { return to_value(one); };
  const auto number = [](double one) { return json(one); };
  const auto view_word = [](ViewKind one) { return json(view_words()[static_cast<std::size_t>(one)]); };
  const auto camera = [](const interaction::Camera& one) { return to_value(one); };
  return {{"layout", layout_words()[static_cast<std::size_t>(views.layout)]},
          {"maximised", optional_value(views.maximised, view_word)},
          {"show", show_words()[static_cast<std::size_t>(views.show)]},
          {"crosshair_mm", optional_value(views.crosshair_mm, vector_value)},
          {"window", optional_value(views.window, number)},
          {"level", optional_value(views.level, number)},
          {"axial", optional_value(views.axial, framing)},
          {"sagittal", optional_value(views.sagittal, framing)},
          {"coronal", optional_value(views.coronal, framing)},
          {"camera", optional_value(views.camera, camera)}};
}

fs::path absolute_of(const fs::path& path) {
  return path.empty() ? path : fs::absolute(path).lexically_normal();
}

fs::path relative_to(const fs::path& path, const fs::path& folder) {
  if (path.empty()) return path;
  const fs::path absolute = absolute_of(path);
  const fs::path relative = absolute.lexically_relative(absolute_of(folder));
  return relative.empty() ? absolute : relative;
}

Eigen::Vector3d read_vector(ObjectReader& reader, const std::string& key) {
  const json& value = reader.at(key);
  const std::string place = reader.place_of(key);
  if (!value.is_array() || value.size() != 3) refuse(place, "a list of three numbers is needed.");
  Eigen::Vector3d vector;
  for (std::size_t n = 0; n < 3; ++n)
    vector[static_cast<Eigen::Index>(n)] =
        ObjectReader::number(value[n], place + "[" + std::to_string(n) + "]", -farthest_mm, farthest_mm);
  return vector;
}

std::optional<SliceFraming> read_framing(ObjectReader& views, const std::string& key) {
  if (!views.has(key)) return {};
  ObjectReader reader = views.object(key);
  SliceFraming framing;
  reader.read("zoom_percent", framing.zoom_percent, 1e-3, 1e7);
  framing.middle_mm = read_vector(reader, "middle_mm");
  reader.finish();
  return framing;
}

std::optional<interaction::Camera> read_camera(ObjectReader& views) {
  if (!views.has("camera")) return {};
  ObjectReader reader = views.object("camera");
  interaction::Camera camera;
  camera.position_mm = read_vector(reader, "position_mm");
  camera.focal_point_mm = read_vector(reader, "focal_point_mm");
  camera.view_up = read_vector(reader, "view_up");
  reader.read("view_angle_deg", camera.view_angle_deg, 1e-3, 179.0);
  reader.read("parallel", camera.parallel);
  reader.read("parallel_scale_mm", camera.parallel_scale_mm, 1e-6, farthest_mm);
  if ((camera.position_mm - camera.focal_point_mm).norm() < 1e-9)
    refuse(reader.place_of("focal_point_mm"), "it must lie apart from position_mm.");
  const Eigen::Vector3d sight = (camera.focal_point_mm - camera.position_mm).normalized();
  if (camera.view_up.cross(sight).norm() < 1e-9 * std::max(1.0, camera.view_up.norm()))
    refuse(reader.place_of("view_up"), "it must not point along the line of sight.");
  reader.finish();
  return camera;
}

Views read_views(ObjectReader reader) {
  Views views;
  std::size_t word = 0;
  reader.read_word("layout", word, layout_words());
  views.layout = static_cast<LayoutKind>(word);
  if (reader.has("maximised")) {
    reader.read_word("maximised", word, view_words());
    views.maximised = static_cast<ViewKind>(word);
  }
  word = 0;
  reader.read_word("show", word, show_words());
  views.show = static_cast<ShowKind>(word);
  if (reader.has("crosshair_mm")) views.crosshair_mm = read_vector(reader, "crosshair_mm");
  if (reader.has("window")) {
    double window = 1.0;
    reader.read("window", window, 1e-9, 1e12);
    views.window = window;
  }
  if (reader.has("level")) {
    double level = 0.0;
    reader.read("level", level, -1e12, 1e12);
    views.level = level;
  }
  views.axial = read_framing(reader, "axial");
  views.sagittal = read_framing(reader, "sagittal");
  views.coronal = read_framing(reader, "coronal");
  views.camera = read_camera(reader);
  reader.finish();
  return views;
}

/// The recipe says its places by itself, without those around it.
Recipe read_recipe(const json& value) {
  try {
    return parse_recipe(value.dump());
  } catch (const Error& error) {
    throw Error(error.kind(), error.code(), std::string("recipe.") + error.what(), error.details());
  }
}

void add_place(std::vector<fs::path>& places, const fs::path& place) {
  if (!place.empty() && std::find(places.begin(), places.end(), place) == places.end())
    places.push_back(place);
}

LoadedSession parse_session(const std::string& text, const fs::path& folder) {
  const json value = parse_json(text, "The session");
  ObjectReader reader(value, "");
  // First what tells another file, or a later program's, from a damaged one.
  std::string kind;
  reader.read("kind", kind);
  if (kind != kind_word)
    refuse("kind", std::string("this is no session of Palpate: \"") + kind_word + "\" is needed.");
  int version = 0;
  reader.at("version");
  reader.read("version", version, 1, 1 << 30);
  if (version > current_version)
    throw Error(ErrorKind::input, "newer-version",
                "it was written by a later version of Palpate (its format is " + std::to_string(version) +
                    ", this program reads up to " + std::to_string(current_version) +
                    "). Open it with that version.");
  LoadedSession loaded;
  Session& session = loaded.session;
  session.recipe = read_recipe(reader.at("recipe"));
  std::string absolute;
  reader.read("scan_was_at", absolute);
  if (reader.has("tissue_frame")) {
    int frame = 0;
    reader.read("tissue_frame", frame, 0, 1 << 30);
    session.tissue_frame = frame;
  }
  if (reader.has("views")) session.views = read_views(reader.object("views"));
  std::string saved_as;
  reader.read("saved_as", saved_as);
  session.saved_as = saved_as;
  reader.finish();

  const fs::path given = session.recipe.input.path;
  if (given.empty()) refuse("recipe.input.path", "this is needed and missing.");
  const fs::path plain = given.has_filename() ? given : given.parent_path();  // "series/" is "series"
  add_place(loaded.places, (folder / plain).lexically_normal());
  if (!absolute.empty()) add_place(loaded.places, fs::path(absolute).lexically_normal());
  add_place(loaded.places, folder / plain.filename());
  session.recipe.input.path = loaded.places.front();
  auto& mesh = session.recipe.surface.mesh;
  if (mesh) mesh = (folder / *mesh).lexically_normal();
  auto& mask = session.recipe.mask.path;
  if (mask) mask = found_beside((folder / *mask).lexically_normal(), folder);
  auto& anchors = session.recipe.simulation.anchors.file;
  if (!anchors.empty()) anchors = found_beside((folder / anchors).lexically_normal(), folder);
  return loaded;
}

}  // namespace

std::string to_json(const Session& session, const fs::path& folder) {
  Session written = session;
  written.recipe.input.path = relative_to(session.recipe.input.path, folder);
  if (session.recipe.surface.mesh)
    written.recipe.surface.mesh = relative_to(*session.recipe.surface.mesh, folder);
  if (session.recipe.mask.path) written.recipe.mask.path = relative_to(*session.recipe.mask.path, folder);
  auto& anchors = written.recipe.simulation.anchors.file;
  anchors = relative_to(anchors, folder);
  json value{{"kind", kind_word},
             {"version", current_version},
             {"recipe", json::parse(to_json(written.recipe))},
             {"scan_was_at", absolute_of(session.recipe.input.path).string()},
             {"tissue_frame", optional_value(session.tissue_frame, [](int frame) { return json(frame); })},
             {"views", to_value(session.views)}};
  if (!session.saved_as.empty()) value["saved_as"] = absolute_of(session.saved_as).string();
  // Paths may hold bytes that are no UTF-8; they must not make saving fail.
  return value.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

void save_session(const fs::path& path, const Session& session) {
  core::write_file(path, to_json(session, fs::absolute(path).parent_path()));
}

LoadedSession load_session(const fs::path& path) {
  std::error_code unknown;
  const bool regular = fs::is_regular_file(path, unknown);
  std::ifstream file(path, std::ios::binary);
  if (!regular || !file)
    throw Error(ErrorKind::input, "not-found",
                "The session " + path.string() + " cannot be read. Check the name and that you may read it.");
  if (const auto bytes = fs::file_size(path, unknown); bytes > largest_bytes)
    throw Error(ErrorKind::input, "too-large",
                path.string() + " has " + std::to_string(bytes) + " bytes; no session is that large.");
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  try {
    return parse_session(text, fs::absolute(path).parent_path());
  } catch (const Error& error) {
    const bool newer = error.code() == "newer-version";
    throw Error(ErrorKind::input, newer ? error.code() : "bad-session",
                "The session " + path.filename().string() + " cannot be opened: " + error.what(),
                error.details());
  }
}

FoundInput find_input(const LoadedSession& loaded, const core::Progress& progress) {
  const std::string& wanted = loaded.session.recipe.input.sha256;
  FoundInput found;
  for (std::size_t n = 0; n < loaded.places.size(); ++n) {
    const auto& place = loaded.places[n];
    std::error_code ignored;
    if (!fs::exists(place, ignored)) continue;
    const auto count = static_cast<double>(loaded.places.size());
    std::string sha256;
    try {
      sha256 = file_sha256(place,
                           progress.part(static_cast<double>(n) / count, static_cast<double>(n + 1) / count));
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::cancelled) throw;
      continue;  // it is there and cannot be read: as good as missing
    }
    if (wanted.empty() || sha256 == wanted) return {FoundInput::State::same, place, sha256};
    if (found.state == FoundInput::State::missing) found = {FoundInput::State::changed, place, sha256};
  }
  return found;
}

}  // namespace palpate::session
