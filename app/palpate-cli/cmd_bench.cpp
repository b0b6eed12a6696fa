#include "bench_engine.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "values.hpp"

#include "palpate/compute/kernel_library.hpp"
#include "palpate/core/error.hpp"
#include "palpate/imaging/filters.hpp"
#include "palpate/imaging/phantom.hpp"
#include "palpate/imaging/reader.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <sstream>
#include <thread>
#include <unistd.h>

namespace palpate::cli {
namespace {

struct Request {
  bool quick = false;
  std::vector<std::string> cases;
  std::string device;
};

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// One row of `imaging`.
struct Figure {
  std::string name;
  std::size_t voxels = 0;
  int runs = 1;
  double seconds = 0.0;
  std::string baseline;
  double baseline_seconds = 0.0;
};

Json to_json(const Figure& figure) {
  Json object;
  object["name"] = figure.name;
  object["voxels"] = figure.voxels;
  object["runs"] = figure.runs;
  object["seconds"] = number(figure.seconds);
  object["baseline"] = figure.baseline;
  object["baseline_seconds"] = number(figure.baseline_seconds);
  object["ratio"] = number(figure.seconds / figure.baseline_seconds);
  return object;
}

std::string to_text(const Figure& figure) {
  return shown(figure.seconds) + " s (median of " + std::to_string(figure.runs) + "), " +
         shown(figure.seconds / figure.baseline_seconds) + " times " + figure.baseline + " (" +
         shown(figure.baseline_seconds) + " s)";
}

/// The kinds of vectors that the processor has, out of its long list.
std::vector<std::string> cpu_flags() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("flags", 0) != 0 && line.rfind("Features", 0) != 0) continue;
    std::vector<std::string> flags;
    std::istringstream words(line.substr(line.find(':') + 1));
    for (std::string word; words >> word;)
      for (const char* const kind : {"sse4_2", "avx", "fma", "f16c", "asimd", "sve"})
        if (word.rfind(kind, 0) == 0) {
          flags.push_back(word);
          break;
        }
    return flags;
  }
  return {};
}

/// Bytes a second of a[n] = b[n] + s c[n], the best of some runs as STREAM
/// counts it, over arrays that no cache holds.
double triad_gb_s(const std::optional<compute::Device>& device, bool quick, const core::Progress& progress) {
  const std::size_t count = std::size_t{1} << (quick ? 23U : 25U);
  const std::vector<float> ones(count, 1.0F);
  const std::vector<float> threes(count, 3.0F);
  std::vector<float> sums(count, 0.0F);
  std::function<void()> triad;
  compute::Buffer a, b, c;
  compute::Kernel kernel;
  if (device) {
    const std::size_t bytes = count * sizeof(float);
    a = compute::Buffer::allocate(*device, bytes);
    b = compute::Buffer::copy_of(*device, ones.data(), bytes);
    c = compute::Buffer::copy_of(*device, ones.data(), bytes);
    kernel = compute::KernelLibrary(*device).build("triad.cl", "triad");
    kernel.set_all(a, b, c, 3.0F, static_cast<std::uint32_t>(count));
    triad = [&] {
      kernel.run(count / 16);
      device->finish();
    };
  } else {
    triad = [&] {
      const std::size_t threads = std::max(1U, std::thread::hardware_concurrency());
      std::vector<std::thread> team;
      for (std::size_t n = 0; n < threads; ++n)
        team.emplace_back([&, n] {
          const std::size_t end = count * (n + 1) / threads;
          for (std::size_t at = count * n / threads; at < end; ++at) sums[at] = ones[at] + 3.0F * threes[at];
        });
      for (auto& thread : team) thread.join();
    };
  }
  triad();  // the first touches the pages and builds the kernel
  double best = 0.0;
  for (int run = 0; run < 10; ++run) {
    progress.report(run / 10.0, "Measuring the memory");
    best = std::max(best, 12.0 * static_cast<double>(count) / seconds_of(triad) / 1e9);
  }
  return best;
}

/// What is measured in full, and what --quick takes for it.
const std::vector<std::string> full_cases{"adaptive-116x200x117", "median-116x200x117",
                                          "gaussian-116x200x117", "handover-300mb"};
const std::vector<std::string> small_cases{"adaptive-58x100x58", "median-58x100x58", "gaussian-58x100x58",
                                           "handover-30mb"};

bool is_engine(const std::string& name) {
  const auto& names = engine_cases();
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<std::string> all_cases() {
  auto all = engine_cases();
  all.insert(all.end(), full_cases.begin(), full_cases.end());
  return all;
}

std::vector<std::string> quick_cases() {
  std::vector<std::string> quick{"jittered-20k", "lattice18-20k-verlet"};
  quick.insert(quick.end(), small_cases.begin(), small_cases.end());
  return quick;
}

/// The published layout is OpenCL; without a device there is nothing to set beside it.
void refuse_engine(const std::vector<std::string>& named) {
  const auto engine = std::find_if(named.begin(), named.end(), is_engine);
  if (engine != named.end())
    core::throw_usage("--case " + *engine +
                      " compares kernels and needs an OpenCL device; see palpate-cli devices.");
}

bool is_small(const std::string& name) {
  return std::find(small_cases.begin(), small_cases.end(), name) != small_cases.end();
}

/// The middle of a speckled phantom, as large as the thesis' image.
core::Volume thesis_sized(bool small, const core::Progress& progress) {
  const std::array<int, 3> dims = small ? std::array<int, 3>{58, 100, 58} : std::array<int, 3>{116, 200, 117};
  imaging::PhantomParameters parameters;
  parameters.size = dims[1];
  const core::Volume heart = imaging::make_phantom(parameters, progress).frames.front();
  std::vector<float> voxels;
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j)
      for (int i = 0; i < dims[0]; ++i)
        voxels.push_back(
            heart.at((heart.dims()[0] - dims[0]) / 2 + i, j, (heart.dims()[2] - dims[2]) / 2 + k));
  return {core::ImageGeometry(dims, heart.geometry().spacing_mm(), Eigen::Vector3d::Zero()),
          std::move(voxels)};
}

class Bench {
 public:
  Bench(const Request& request, std::optional<compute::Device> device, const core::Progress& progress)
      : request_(request), device_(std::move(device)), progress_(progress) {}

  void run() {
    auto wanted = request_.cases;
    if (wanted.empty()) wanted = request_.quick ? quick_cases() : all_cases();
    if (!device_) {
      refuse_engine(request_.cases);
      wanted.erase(std::remove_if(wanted.begin(), wanted.end(), is_engine), wanted.end());
    }
    const double parts = static_cast<double>(wanted.size()) + 1.0;
    triad_gb_s_ = triad_gb_s(device_, request_.quick, progress_.part(0.0, 1.0 / parts));
    for (std::size_t n = 0; n < wanted.size(); ++n) {
      const auto part =
          progress_.part((static_cast<double>(n) + 1.0) / parts, (static_cast<double>(n) + 2.0) / parts);
      if (is_engine(wanted[n]))
        engine_.push_back(measure_engine(wanted[n], *device_, triad_gb_s_, request_.quick, part));
      else
        figures_.push_back(measure(wanted[n], part));
    }
  }
  const std::vector<EngineFigure>& engine() const noexcept { return engine_; }
  double triad() const noexcept { return triad_gb_s_; }
  const std::vector<Figure>& figures() const noexcept { return figures_; }

 private:
  Figure measure(const std::string& name, const core::Progress& progress) {
    if (name.rfind("handover", 0) == 0) return handover(name, progress);
    if (volume_.empty() || is_small(name) != volume_is_small_) {
      volume_is_small_ = is_small(name);
      volume_ = thesis_sized(volume_is_small_, progress.part(0.0, 0.1));
    }
    const std::string filter = name.substr(0, name.find('-'));
    return filter == "adaptive" ? adaptive(name, progress.part(0.1, 1.0))
                                : plain(name, filter, progress.part(0.1, 1.0));
  }

  double time_of(const std::string& filter, const std::string& device, const core::Progress& progress) const {
    const imaging::FilterStep step = imaging::parse_filter(filter);
    return seconds_of([&] { imaging::apply_filters(volume_, {step}, {device}, progress); });
  }

  /// Against its own twin in double, which takes ten times as long: once.
  Figure adaptive(const std::string& name, const core::Progress& progress) const {
    Figure figure{name, volume_.size(), request_.quick ? 3 : 5, 0.0, "its CPU reference", 0.0};
    if (device_) time_of("adaptive", request_.device, progress.part(0.0, 0.1));  // builds the kernels
    std::vector<double> times;
    for (int run = 0; run < figure.runs; ++run) {
      const auto part = progress.part(0.1 + 0.08 * run, 0.1 + 0.08 * (run + 1));
      times.push_back(time_of("adaptive", request_.device, part));
      if (run == figure.runs / 2)
        figure.baseline_seconds = time_of("adaptive", "reference", progress.part(0.5, 1.0));
    }
    figure.seconds = median(times);
    return figure;
  }

  /// Against reading and writing every voxel once at the triad's pace.
  Figure plain(const std::string& name, const std::string& filter, const core::Progress& progress) const {
    Figure figure{name, volume_.size(), request_.quick ? 3 : 5, 0.0, "reading and writing each voxel once",
                  0.0};
    std::vector<double> times;
    for (int run = 0; run < figure.runs; ++run)
      times.push_back(time_of(filter, request_.device, progress.part(0.2 * run, 0.2 * (run + 1))));
    figure.seconds = median(times);
    figure.baseline_seconds = 8.0 * static_cast<double>(volume_.size()) / (triad_gb_s_ * 1e9);
    return figure;
  }

  Figure handover(const std::string& name, const core::Progress& progress) const {
    std::error_code failed;
    std::string made = (std::filesystem::temp_directory_path(failed) / "palpate-bench-XXXXXX").string();
    if (failed || mkdtemp(made.data()) == nullptr)
      throw core::Error(core::ErrorKind::output, "no-folder",
                        "A scan to measure with cannot be written to " + made + ": " +
                            (failed ? failed.message() : std::strerror(errno)) +
                            ". Set TMPDIR to a folder with 400 MB to spare.");
    const std::filesystem::path folder = made;
    const struct Cleaner {
      std::filesystem::path path;
      ~Cleaner() {
        std::error_code ignored;
        std::filesystem::remove_all(path, ignored);
      }
    } cleaner{folder};
    const std::size_t bytes = is_small(name) ? 30'000'000 : 300'000'000;
    const auto timing = imaging::measure_handover(folder, bytes, progress);
    return {name,         timing.bytes / sizeof(float), 3, timing.handover_s, "parsing it in this process",
            timing.read_s};
  }

  const Request& request_;
  std::optional<compute::Device> device_;
  core::Progress progress_;
  core::Volume volume_;
  bool volume_is_small_ = false;
  double triad_gb_s_ = 0.0;
  std::vector<EngineFigure> engine_;
  std::vector<Figure> figures_;
};

int run_request(const Request& request, Console& console) {
  std::optional<compute::Device> device;
  if (!compute::is_reference_selector(request.device)) device = compute::open_device(request.device);
  Bench bench(request, device, console.progress());
  bench.run();
  const std::string name = device ? device->info().name : "reference";
  const std::string driver = device ? device->info().driver : "";
  Json object;
  object["device"] = name;
  object["driver"] = driver;
  object["cpu_flags"] = cpu_flags();
  object["triad_gb_s"] = number(bench.triad());
  object["quick"] = request.quick;
  object["cases"] = Json::array();
  for (const EngineFigure& figure : bench.engine()) object["cases"].push_back(to_json(figure));
  object["mapping"] = Json::array();
  object["imaging"] = Json::array();
  Table table{{"Device", name},
              {"Driver", driver},
              {"Processor", join(cpu_flags(), " ")},
              {"Memory (triad)", shown(bench.triad()) + " GB/s"}};
  for (const EngineFigure& figure : bench.engine()) table.emplace_back(figure.name, to_text(figure));
  for (const Figure& figure : bench.figures()) {
    object["imaging"].push_back(to_json(figure));
    table.emplace_back(figure.name, to_text(figure));
  }
  console.result(object, "Measured in one process, medians; other work on the machine shows in them.", table);
  return 0;
}

}  // namespace

int run_bench(const Call& call) {
  CommonOptions common;
  Request request;
  OptionSet options(
      "bench", "bench [options]",
      "Measures this program on one device: its engine against the published layout of the same "
      "model, run in turn; filters; the hand-over of a scan.");
  auto accepted = all_cases();
  accepted.insert(accepted.end(), small_cases.begin(), small_cases.end());
  options.flag("--quick", "smaller volumes and fewer runs", request.quick);
  options.value("--case", "NAME", "only this one: " + join(all_cases(), ", ") + " (repeatable)",
                [&](const std::string& name) { request.cases.push_back(parse_choice(name, accepted)); });
  add_common(options, common);
  options.example("palpate-cli bench --quick --json");
  if (parse_or_help(options, call)) return 0;
  request.device = common.device;
  return run_request(request, call.console);
}

}  // namespace palpate::cli
