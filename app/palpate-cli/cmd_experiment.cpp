#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "values.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"
#include "palpate/evaluation/experiment.hpp"
#include "palpate/visualization/chart.hpp"
#include "palpate/visualization/picture.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>
#include <unistd.h>

namespace palpate::cli {
namespace fs = std::filesystem;
namespace {

namespace vis = visualization;
using evaluation::Experiment;

struct Request {
  std::vector<std::string> names;
  std::string folder;
  std::string device;
  bool quick = false;
};

std::vector<std::string> all_names() {
  std::vector<std::string> names;
  for (const auto& experiment : evaluation::experiments()) names.push_back(experiment.name);
  return names;
}

const Experiment& experiment_of(const std::string& name) {
  const auto& all = evaluation::experiments();
  return *std::find_if(all.begin(), all.end(), [&](const Experiment& one) { return one.name == name; });
}

int print_list(Console& console) {
  Json object;
  object["experiments"] = Json::array();
  Table table;
  for (const auto& experiment : evaluation::experiments()) {
    Json one;
    one["name"] = experiment.name;
    one["figure"] = experiment.figure;
    one["text"] = experiment.text;
    one["needs_device"] = experiment.needs_device;
    object["experiments"].push_back(one);
    table.emplace_back(experiment.name, experiment.figure + ": " + experiment.text);
  }
  console.result(object, "Figures of the thesis, measured again:", table);
  return 0;
}

/// The folder that results go to. One that this program made and left empty is
/// removed again.
class OutputFolder {
 public:
  explicit OutputFolder(const std::string& path) : path_(path) {
    std::error_code failed;
    if (!fs::exists(path_, failed) && !failed) {
      for (fs::path at = path_; !at.empty() && !fs::exists(at, failed); at = at.parent_path())
        made_.push_back(at);
      fs::create_directories(path_, failed);
    }
    if (failed) refuse(failed.message());
    if (!fs::is_directory(path_, failed)) refuse(path + " is not a folder");
    if (access(path_.c_str(), W_OK | X_OK) != 0) refuse("the folder may not be written to");
  }
  ~OutputFolder() { clear(); }
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  const fs::path& path() const noexcept { return path_; }

 private:
  [[noreturn]] void refuse(const std::string& why) const {
    clear();
    throw core::Error(core::ErrorKind::output, "cannot-write",
                      "Cannot write to " + path_.string() + ": " + why + ". Choose another folder.");
  }
  void clear() const noexcept {
    std::error_code ignored;
    for (const auto& folder : made_) fs::remove(folder, ignored);  // refuses one that is not empty
  }

  fs::path path_;
  std::vector<fs::path> made_;  ///< the innermost first
};

vis::ChartAxis axis_of(const evaluation::Axis& axis) { return {axis.title, axis.logarithmic, axis.range}; }

vis::Chart chart_of(const evaluation::Plot& plot) {
  vis::Chart chart{plot.title, axis_of(plot.x), axis_of(plot.y), {}};
  for (const auto& series : plot.series)
    chart.series.push_back(
        {series.name, series.x, series.y, series.line, series.markers, series.dashed, series.color});
  return chart;
}

constexpr int shape_width_px = 720;
constexpr int shape_height_px = 360;

/// From the front and a little above, without perspective, so that both halves
/// of a picture are seen alike; all of it fits.
interaction::Camera camera_of(const evaluation::Shape& shape) {
  const Eigen::Vector3d toward = Eigen::Vector3d(0.18, -1.0, 0.30).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitZ().cross(toward).normalized();
  const Eigen::Vector3d up = toward.cross(right);
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const auto& place : *shape.positions_mm) {
    const Eigen::Vector3d at = place.cast<double>();
    const Eigen::Vector2d seen(right.dot(at), up.dot(at));
    low = low.cwiseMin(seen);
    high = high.cwiseMax(seen);
  }
  const Eigen::Vector2d middle = 0.5 * (low + high);
  const Eigen::Vector2d half = 0.5 * (high - low);
  interaction::Camera camera;
  camera.focal_point_mm = shape.tissue->points.center_mm + middle.x() * right + middle.y() * up;
  camera.position_mm = camera.focal_point_mm + 10.0 * half.norm() * toward;
  camera.view_up = Eigen::Vector3d::UnitZ();
  camera.parallel = true;
  constexpr double aspect = static_cast<double>(shape_width_px) / shape_height_px;
  camera.parallel_scale_mm = 1.06 * std::max(half.y(), half.x() / aspect) + 0.5;
  return camera;
}

/// Points coloured by how far they moved.
core::Picture picture_of(const evaluation::Shape& shape, const core::Progress& progress) {
  auto tissue = std::make_shared<model::Tissue>(*shape.tissue);
  tissue->points.intensities = shape.values;
  vis::SceneContent content;
  content.tissue = std::move(tissue);
  content.positions_mm = shape.positions_mm;
  vis::ViewSettings settings;
  settings.show = vis::Show::points;
  settings.camera = camera_of(shape);
  settings.annotations = false;
  settings.background = {1.0F, 1.0F, 1.0F};
  settings.use_gradient = false;
  const vis::PictureRequest request{shape_width_px, shape_height_px, vis::PictureView::three_d};
  auto picture = vis::draw_picture(content, settings, request, progress);
  // Sixteen levels of light are seen as smooth on a ball of a few pixels, and
  // pack into half the bytes.
  for (auto& channel : picture.rgba) channel = static_cast<std::uint8_t>((channel + 8) / 17 * 17);
  return picture;
}

/// All files of a result or none: they are made aside and then renamed.
std::vector<std::string> write(const evaluation::Result& result, const fs::path& folder,
                               const core::Progress& progress) {
  const core::AtomicOutput output(folder / (result.name + ".csv"));
  std::vector<std::string> files;
  for (const auto& table : result.tables) {
    files.push_back(table.name + ".csv");
    core::write_file(output.staged(files.back()), evaluation::to_csv(table));
  }
  for (const auto& plot : result.plots) {
    files.push_back(plot.name + ".png");
    vis::save_png(output.staged(files.back()), vis::draw_chart(chart_of(plot), {}, progress));
  }
  for (const auto& shape : result.shapes) {
    files.push_back(shape.name + ".png");
    vis::save_png(output.staged(files.back()), picture_of(shape, progress));
  }
  // What would stand in the way of the second must not leave the first alone.
  for (const auto& file : files)
    if (std::error_code ignored; fs::is_directory(folder / file, ignored))
      throw core::output_error(folder / file, "is-a-folder", "a folder of that name is there");
  progress.cancel().check();
  for (const auto& file : files) output.commit(output.staged(file), folder / file);
  return files;
}

std::vector<std::string> wanted(const Request& request) {
  const auto names = all_names();
  auto accepted = names;
  accepted.insert(accepted.end(), {"all", "list"});
  std::vector<std::string> list;
  for (const auto& name : request.names) {
    parse_choice(name, accepted);
    if (name == "list") core::throw_usage("\"list\" stands alone: palpate-cli experiment list.");
    for (const auto& one : name == "all" ? names : std::vector<std::string>{name})
      if (std::find(list.begin(), list.end(), one) == list.end()) list.push_back(one);
  }
  return list;
}

/// Opened only where an experiment runs on it. Where `all` are asked for on
/// the reference, those that measure a device are left out.
evaluation::Setup setup_of(const Request& request, std::vector<std::string>& names, Console& console) {
  evaluation::Setup setup;
  setup.quick = request.quick;
  const bool uses = std::any_of(names.begin(), names.end(),
                                [](const auto& name) { return experiment_of(name).uses_device; });
  if (!uses) return setup;
  if (!compute::is_reference_selector(request.device)) {
    setup.device = compute::open_device(request.device);
    return setup;
  }
  for (auto name = names.begin(); name != names.end();) {
    const bool leave_out = experiment_of(*name).needs_device;
    const bool asked = std::find(request.names.begin(), request.names.end(), *name) != request.names.end();
    if (leave_out && asked)
      core::throw_usage(
          "The experiment " + *name +
          " measures an OpenCL device and cannot run on the reference; choose one by --device.");
    if (leave_out)
      console.warn("needs-device", "The experiment " + *name + " is left out: it measures a device.");
    name = leave_out ? names.erase(name) : name + 1;
  }
  return setup;
}

std::string shown_finding(const evaluation::Finding& finding) {
  return shown(finding.value) + (finding.unit.empty() ? "" : " " + finding.unit) + "  (" + finding.text + ")";
}

int run_request(const Request& request, Console& console) {
  auto names = wanted(request);
  if (names.empty())
    core::throw_usage("experiment needs a name: " + join(all_names(), ", ") + ", all or list.");
  if (request.folder.empty()) core::throw_usage("experiment needs -o DIR, the folder to write to.");
  const auto setup = setup_of(request, names, console);
  const OutputFolder folder(request.folder);
  const auto progress = console.progress();
  Json object;
  object["folder"] = request.folder;
  object["device"] = setup.device ? setup.device->info().name : "reference";
  object["driver"] = setup.device ? setup.device->info().driver : "";
  object["quick"] = request.quick;
  object["experiments"] = Json::array();
  Table table;
  for (std::size_t n = 0; n < names.size(); ++n) {
    const auto count = static_cast<double>(names.size());
    const auto part = progress.part(static_cast<double>(n) / count, static_cast<double>(n + 1) / count);
    const auto start = std::chrono::steady_clock::now();
    const auto result = evaluation::run(names[n], setup, part.part(0.0, 0.95));
    Json one;
    one["name"] = names[n];
    one["figure"] = experiment_of(names[n]).figure;
    one["files"] = write(result, folder.path(), part.part(0.95, 1.0));
    one["findings"] = Json::object();
    table.emplace_back(names[n], experiment_of(names[n]).figure + ": " +
                                     join(one["files"].get<std::vector<std::string>>(), ", "));
    for (const auto& finding : result.findings) {
      one["findings"][finding.name] = {
          {"value", number(finding.value)}, {"unit", finding.unit}, {"text", finding.text}};
      table.emplace_back("  " + finding.name, shown_finding(finding));
    }
    one["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    object["experiments"].push_back(one);
  }
  console.result(object, "Wrote to " + request.folder, table);
  return 0;
}

}  // namespace

int run_experiment(const Call& call) {
  CommonOptions common;
  Request request;
  OptionSet options("experiment", "experiment NAME... -o DIR | experiment list",
                    "Measures figures of the thesis again with this program's own solvers, and writes the "
                    "numbers as CSV and the curves as PNG.");
  options.positional("NAME", 64, request.names);
  options.text("-o", "DIR", "the folder to write to; it is made where it is missing", request.folder);
  options.flag("--quick", "fewer and smaller cases", request.quick);
  add_common(options, common);
  options.example("palpate-cli experiment list");
  options.example("palpate-cli experiment stability-stiffness -o figures");
  options.example("palpate-cli experiment all -o figures --json");
  if (parse_or_help(options, call)) return 0;
  request.device = common.device;
  if (request.names == std::vector<std::string>{"list"}) return print_list(call.console);
  return run_request(request, call.console);
}

}  // namespace palpate::cli
