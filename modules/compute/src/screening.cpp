// Which drivers may be loaded into this process: tried in child processes,
// since one that aborts or hangs takes its process along, and remembered.
#include "child.hpp"
#include "drivers.hpp"

#include "palpate/compute/cache_folder.hpp"
#include "palpate/core/checksum.hpp"

#include <nlohmann/json.hpp>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>
#include <unistd.h>

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

namespace palpate::compute {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::json;
using Overrides = std::vector<std::pair<std::string, std::string>>;

constexpr double usual_time_limit_s = 20.0;
// What went wrong may have been the machine's: a bad answer is not for ever.
constexpr std::int64_t bad_answer_lives_s = 24 * 3600;

std::optional<fs::path> probe_program() {
  const char* named = std::getenv("PALPATE_PROBE");
  fs::path program;
  if (named != nullptr && *named != '\0') {
    if (std::strcmp(named, "off") == 0) return std::nullopt;
    program = named;
  } else {
    std::error_code error;
    program = fs::read_symlink("/proc/self/exe", error).parent_path() / "palpate-probe";
  }
  if (access(program.c_str(), X_OK) != 0) return std::nullopt;
  return program;
}

double time_limit_s() {
  const char* named = std::getenv("PALPATE_PROBE_TIME_LIMIT_S");
  const double wanted = named == nullptr ? 0.0 : std::atof(named);
  return wanted > 0.0 ? wanted : usual_time_limit_s;
}

/// A folder of vendor files for the loader that names only these drivers;
/// understood by every loader. Gone with this.
class VendorFolder {
 public:
  explicit VendorFolder(const std::vector<DriverFile>& files) {
    std::error_code error;
    const fs::path temporary = fs::temp_directory_path(error);
    std::string pattern = (temporary / "palpate-drivers-XXXXXX").string();
    if (error || mkdtemp(pattern.data()) == nullptr) return;
    path_ = pattern;
    is_made_ = true;
    for (std::size_t n = 0; n < files.size(); ++n) {
      std::ofstream stream(path_ / (std::to_string(100 + n) + ".icd"));
      stream << files[n].library << "\n";
      stream.close();
      is_made_ = is_made_ && stream;
    }
  }
  ~VendorFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  VendorFolder(const VendorFolder&) = delete;
  VendorFolder& operator=(const VendorFolder&) = delete;
  /// Ends with a slash. Where no folder could be made, one that is not there:
  /// no driver at all is better than a bad one.
  std::string name() const { return is_made_ ? path_.string() + "/" : "/nonexistent/"; }
  /// With all its files.
  bool is_made() const noexcept { return is_made_; }

 private:
  fs::path path_;
  bool is_made_ = false;
};

Overrides only_these(const VendorFolder& folder) {
  return {{"OCL_ICD_VENDORS", folder.name()}, {"OCL_ICD_FILENAMES", ""}};
}

/// What one child said and how it ended.
struct Trial {
  bool enumerated = false;
  bool complete = false;
  Json devices = Json::array();
  std::map<int, std::string> failures;  ///< by device index
  int trying = -1;                      ///< the device that it was at when it ended
  std::string end;                      ///< for people, where it is not complete
};

std::string ending(const ChildEnd& end, double limit_s) {
  std::ostringstream text;
  if (end.timed_out) {
    text << "it did not answer within " << limit_s << " s";
  } else if (end.signal != 0) {
    const char* name = sigabbrev_np(end.signal);
    text << "it crashed ("
         << (name == nullptr ? "signal " + std::to_string(end.signal) : "SIG" + std::string(name)) << ")";
  } else {
    text << "it ended the program that tried it (exit code " << end.exit_code << ")";
  }
  return text.str();
}

Trial understood(const ChildEnd& end, double limit_s) {
  Trial trial;
  std::istringstream lines(end.report);
  for (std::string line; std::getline(lines, line);) {
    const Json message = Json::parse(line, nullptr, false);
    if (!message.is_object()) continue;
    if (message.contains("devices")) {
      trial.devices = message["devices"];
      trial.enumerated = true;
    }
    if (message.contains("trying")) trial.trying = message["trying"].get<int>();
    if (message.contains("tried")) {
      trial.failures[message["tried"].get<int>()] = message.value("failure", std::string());
      trial.trying = -1;
    }
    if (message.contains("done")) trial.complete = true;
  }
  // All was said; what a driver does while its process ends is its own affair.
  if (!trial.complete) trial.end = ending(end, limit_s);
  return trial;
}

class Prober {
 public:
  Prober(fs::path program, double limit_s) : program_(std::move(program)), limit_s_(limit_s) {}

  /// Without a word from the child: it could not be started, so nothing is known.
  std::optional<Screening> run(const std::vector<DriverFile>& files) {
    const Trial all = trial({});
    if (!started_) return std::nullopt;
    Screening screening;
    if (all.enumerated) {
      screening.devices = failing_devices(all, {});
      return screening;
    }
    std::vector<DriverFile> good;
    for (const auto& file : files) {
      const VendorFolder alone({file});
      const Trial one = files.size() == 1 ? all : trial(alone);
      if (!one.enumerated) {
        screening.drivers.push_back({file, reason("its driver was tried and " + one.end, file)});
        continue;
      }
      good.push_back(file);
      if (good.size() < 2) continue;
      // Each for itself is well; two may still not bear each other.
      const VendorFolder together(good);
      if (const Trial both = trial(together); !both.enumerated) {
        good.pop_back();
        screening.drivers.push_back(
            {file,
             reason("together with " + good.back().label + " its driver was tried and " + both.end, file)});
      }
    }
    const VendorFolder rest(good);
    if (!good.empty()) screening.devices = failing_devices(trial(rest), only_these(rest));
    return screening;
  }
  /// Whether every trial could be made; else the answer holds for this run only.
  bool is_whole() const noexcept { return is_whole_; }

 private:
  Trial trial(const VendorFolder& folder) {
    if (folder.is_made()) return trial(only_these(folder));
    is_whole_ = false;
    Trial none;
    none.end =
        "could not be told from others, since no temporary folder could be made (set TMPDIR to one "
        "that can be written)";
    return none;
  }
  Trial trial(const Overrides& environment, const std::string& skipped = {}) {
    const std::vector<std::string> arguments =
        skipped.empty() ? std::vector<std::string>{} : std::vector<std::string>{"--skip", skipped};
    const ChildEnd end = run_child(program_, arguments, environment, limit_s_);
    started_ = end.started;
    return understood(end, limit_s_);
  }

  static std::string reason(const std::string& what, const DriverFile& file) {
    return what + "; it is left out (" + file.label +
           (file.library == file.label ? "" : ", " + file.library) +
           "). Update or remove that driver; it is tried again when it changes, and every day";
  }

  /// A device that ends the child is skipped in the next one, until all are tried.
  std::vector<FailingDevice> failing_devices(Trial last, const Overrides& environment) {
    std::map<int, std::string> failures = last.failures;
    std::string skipped;
    const Json devices = last.devices;
    for (std::size_t n = 0; !last.complete && last.trying >= 0 && n < devices.size(); ++n) {
      failures[last.trying] = "a small kernel was tried on it and " + last.end;
      for (const auto& [index, unused] : failures)
        skipped += (skipped.empty() ? "" : ",") + std::to_string(index);
      last = trial(environment, skipped);
      failures.insert(last.failures.begin(), last.failures.end());
    }
    std::vector<FailingDevice> failing;
    std::map<std::string, int> seen;
    for (const auto& device : devices) {
      FailingDevice entry{device.value("platform", ""), device.value("name", ""), device.value("driver", ""),
                          0, ""};
      entry.twin = seen[entry.platform + "\n" + entry.name + "\n" + entry.driver]++;
      const auto failure = failures.find(device.value("index", -1));
      if (failure == failures.end() || failure->second.empty()) continue;
      entry.reason = failure->second;
      failing.push_back(entry);
    }
    return failing;
  }

  fs::path program_;
  double limit_s_;
  bool started_ = false;
  bool is_whole_ = true;
};

std::int64_t now_s() {
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

Json json_of(const Screening& screening, const std::string& fingerprint) {
  Json json{
      {"tried_at_s", now_s()}, {"seen", fingerprint}, {"drivers", Json::array()}, {"devices", Json::array()}};
  for (const auto& driver : screening.drivers)
    json["drivers"].push_back(
        {{"label", driver.file.label}, {"library", driver.file.library}, {"reason", driver.reason}});
  for (const auto& device : screening.devices)
    json["devices"].push_back({{"platform", device.platform},
                               {"name", device.name},
                               {"driver", device.driver},
                               {"twin", device.twin},
                               {"reason", device.reason}});
  return json;
}

/// None where nothing is remembered, or it is too old to be believed.
std::optional<Screening> remembered(const fs::path& file, const std::string& fingerprint) {
  const auto text = read_cached(file);
  if (!text) return std::nullopt;
  try {
    const Json json = Json::parse(*text);
    if (json.at("seen").get<std::string>() != fingerprint) return std::nullopt;
    Screening screening;
    for (const auto& driver : json.at("drivers"))
      screening.drivers.push_back(
          {{driver.at("label").get<std::string>(), driver.at("library").get<std::string>()},
           driver.at("reason").get<std::string>()});
    for (const auto& device : json.at("devices"))
      screening.devices.push_back({device.at("platform").get<std::string>(),
                                   device.at("name").get<std::string>(),
                                   device.at("driver").get<std::string>(), device.at("twin").get<int>(),
                                   device.at("reason").get<std::string>()});
    const std::int64_t age = now_s() - json.at("tried_at_s").get<std::int64_t>();
    const bool all_good = screening.drivers.empty() && screening.devices.empty();
    if (!all_good && (age < 0 || age > bad_answer_lives_s)) return std::nullopt;
    return screening;
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

/// Lets the loader load what is left. It reads its variables once, at the
/// first call; afterwards they are as they were.
void load_without(const Screening& screening, const std::vector<DriverFile>& files) {
  std::vector<DriverFile> good;
  for (const auto& file : files) {
    bool bad = false;
    for (const auto& driver : screening.drivers)
      bad = bad || (driver.file.label == file.label && driver.file.library == file.library);
    if (!bad) good.push_back(file);
  }
  const VendorFolder folder(good);
  std::vector<std::pair<std::string, std::optional<std::string>>> before;
  for (const auto& [name, value] : only_these(folder)) {
    const char* old = std::getenv(name.c_str());
    before.emplace_back(name, old == nullptr ? std::nullopt : std::optional<std::string>(old));
    setenv(name.c_str(), value.c_str(), 1);
  }
  cl_uint count = 0;
  clGetPlatformIDs(0, nullptr, &count);
  for (const auto& [name, value] : before) {
    if (value)
      setenv(name.c_str(), value->c_str(), 1);
    else
      unsetenv(name.c_str());
  }
}

Screening screen() {
  const auto program = probe_program();
  const auto files = driver_files();
  if (!program || files.empty()) return {};
  const std::string fingerprint = driver_fingerprint(files);
  const auto folder = cache_folder();
  const fs::path file =
      folder ? *folder / "drivers" / (core::sha256_of(fingerprint).substr(0, 32) + ".json") : fs::path();
  std::optional<Screening> screening;
  if (folder) screening = remembered(file, fingerprint);
  if (!screening) {
    Prober prober(*program, time_limit_s());
    screening = prober.run(files);
    if (!screening) return {};
    if (folder && prober.is_whole()) write_cached(file, json_of(*screening, fingerprint).dump(2));
  }
  if (!screening->drivers.empty()) load_without(*screening, files);
  return *screening;
}

}  // namespace

const Screening& screened_drivers() {
  // Once a process, since the loader loads its drivers once a process.
  static const Screening screening = screen();
  return screening;
}

}  // namespace palpate::compute
