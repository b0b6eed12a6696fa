#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "values.hpp"

#include "palpate/compute/device.hpp"
#include "palpate/core/error.hpp"
#include "palpate/simulation/self_test.hpp"

#include <algorithm>
#include <map>
#include <optional>

namespace palpate::cli {
namespace {

Json to_json(const compute::DeviceInfo& device) {
  Json object;
  object["index"] = device.index;
  object["name"] = device.name;
  object["platform"] = device.platform;
  object["driver"] = device.driver;
  object["type"] = compute::to_string(device.type);
  object["memory_bytes"] = device.memory_bytes;
  object["largest_buffer_bytes"] = device.largest_buffer_bytes;
  object["compute_units"] = device.compute_units;
  object["float_vector_width"] = device.float_vector_width;
  object["usable"] = device.usable;
  object["default"] = device.is_default;
  object["reason"] = device.reason;
  return object;
}

std::string to_text(const compute::DeviceInfo& device) {
  Table table;
  table.emplace_back("Platform", device.platform);
  table.emplace_back("Driver", device.driver);
  table.emplace_back("Type", compute::to_string(device.type) + ", " + std::to_string(device.compute_units) +
                                 " compute units, float vectors of " +
                                 std::to_string(device.float_vector_width));
  table.emplace_back("Memory", shown_bytes(static_cast<double>(device.memory_bytes)) + ", one buffer up to " +
                                   shown_bytes(static_cast<double>(device.largest_buffer_bytes)));
  if (!device.reason.empty())
    table.emplace_back(device.is_default ? "Default"
                       : device.usable   ? "Not the default"
                                         : "Not usable",
                       device.reason);
  return std::to_string(device.index) + ": " + device.name + (device.is_default ? "  (default)" : "") + "\n" +
         table_text(table);
}

Json to_json(const simulation::SelfTest& test) {
  Json cases = Json::array();
  for (const auto& one : test.cases) {
    Json object;
    object["layout"] = one.layout;
    object["integrator"] = one.integrator;
    object["points"] = one.points;
    object["links"] = one.links;
    object["steps"] = one.steps;
    object["step_s"] = one.step_s;
    object["motion_mm"] = number(one.motion_mm);
    object["max_difference_mm"] = number(one.max_difference_mm);
    object["tolerance_mm"] = one.tolerance_mm;
    object["ms_per_step"] = one.passed ? number(one.ms_per_step) : Json(nullptr);
    object["link_evaluations_per_s"] = one.passed ? number(one.link_evaluations_per_s) : Json(nullptr);
    object["passed"] = one.passed;
    object["failure"] = one.failure;
    cases.push_back(object);
  }
  return {{"passed", test.passed()}, {"cases", cases}};
}

std::string to_text(const simulation::SelfTest& test) {
  Table table;
  for (const auto& one : test.cases)
    table.emplace_back("Self-test, " + one.layout,
                       one.passed ? "passed: within " + shown(one.max_difference_mm, 2) +
                                        " mm of the reference (" + shown(one.tolerance_mm, 2) +
                                        " mm allowed), " + shown(one.link_evaluations_per_s / 1e6, 3) +
                                        " million link evaluations per second"
                                  : "FAILED: " + one.failure);
  return table_text(table);
}

/// What is wrong with a device as a whole is a failed case without a layout.
simulation::SelfTest tested(const compute::DeviceInfo& device, const core::Progress& progress) {
  constexpr int side = 27;  // about 20 thousand points
  try {
    return simulation::self_test(compute::open_device(std::to_string(device.index)), side, progress);
  } catch (const core::Error& error) {
    if (error.kind() == core::ErrorKind::cancelled) throw;
    simulation::SelfTest failed;
    failed.cases.emplace_back();
    failed.cases.back().layout = "none";
    failed.cases.back().failure = error.what();
    return failed;
  }
}

/// One after the other: two at once would share the machine.
class SelfTests {
 public:
  SelfTests(const std::vector<compute::DeviceInfo>& devices, const core::Progress& progress) {
    const auto usable = [](const auto& device) { return device.usable; };
    const auto count = static_cast<double>(std::count_if(devices.begin(), devices.end(), usable));
    double done = 0.0;
    for (const auto& device : devices) {
      if (!device.usable) continue;
      tests_.emplace(device.index, tested(device, progress.part(done / count, (done + 1.0) / count)));
      done += 1.0;
    }
  }
  const simulation::SelfTest* of(const compute::DeviceInfo& device) const {
    const auto found = tests_.find(device.index);
    return found == tests_.end() ? nullptr : &found->second;
  }
  /// Throws Error(device) that names the devices that failed.
  void require_passed(const std::vector<compute::DeviceInfo>& devices) const {
    std::string failed;
    for (const auto& device : devices)
      if (const auto* test = of(device); test != nullptr && !test->passed())
        for (const auto& one : test->cases)
          if (!one.passed)
            failed += (failed.empty() ? "" : " ") + std::to_string(device.index) + ": " + device.name + ", " +
                      one.layout + ": " + one.failure + ".";
    if (!failed.empty())
      throw core::Error(core::ErrorKind::device, "self-test",
                        "A device failed the self-test. " + failed +
                            " Choose another with --device or PALPATE_DEVICE, or update its driver.");
  }

 private:
  std::map<int, simulation::SelfTest> tests_;
};

}  // namespace

int run_devices(const Call& call) {
  CommonOptions common;
  OptionSet options("devices", "devices [options]",
                    "Lists the OpenCL devices and says which one is taken and why.");
  add_common(options, common);
  bool self_test = false;
  options.flag("--self-test",
               "runs each device for a moment, compares it with the CPU reference and times it", self_test);
  options.example("palpate-cli devices --json");
  options.example("palpate-cli devices --self-test");
  if (parse_or_help(options, call)) return 0;

  const auto devices = compute::list_devices();
  call.console.progress().cancel().check();  // trying drivers can take long
  std::optional<SelfTests> tests;
  if (self_test) tests.emplace(devices, call.console.progress());
  Json list = Json::array();
  std::string text;
  for (const auto& device : devices) {
    list.push_back(to_json(device));
    text += to_text(device);
    if (const auto* test = tests ? tests->of(device) : nullptr) {
      list.back()["self_test"] = to_json(*test);
      text += to_text(*test);
    }
  }
  text += "reference: the CPU reference, without OpenCL\n";
  Json object;
  object["devices"] = list;
  // The words of open_device() say what there is and how to install one.
  const auto chosen = [&]() -> Json {
    if (compute::is_reference_selector(common.device)) return "reference";
    return compute::open_device(common.device).info().index;
  };
  object["chosen"] = chosen();
  call.console.result(object, text);
  if (tests) tests->require_passed(devices);
  return 0;
}

}  // namespace palpate::cli
