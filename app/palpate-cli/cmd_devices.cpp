#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "values.hpp"

#include "palpate/compute/device.hpp"
#include "palpate/core/error.hpp"

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
    table.emplace_back(device.is_default ? "Default" : "Not the default", device.reason);
  return std::to_string(device.index) + ": " + device.name + (device.is_default ? "  (default)" : "") + "\n" +
         table_text(table);
}

}  // namespace

int run_devices(const Call& call) {
  CommonOptions common;
  OptionSet options("devices", "devices [options]",
                    "Lists the OpenCL devices and says which one is taken and why.");
  add_common(options, common);
  options.later({"--self-test"});
  options.example("palpate-cli devices --json");
  if (parse_or_help(options, call)) return 0;

  const auto devices = compute::list_devices();
  Json list = Json::array();
  std::string text;
  for (const auto& device : devices) {
    list.push_back(to_json(device));
    text += to_text(device);
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
  return 0;
}

}  // namespace palpate::cli
