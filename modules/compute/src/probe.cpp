#include "palpate/compute/probe.hpp"

#include "child.hpp"
#include "enumerate.hpp"

#include "palpate/compute/kernel_library.hpp"

#include <nlohmann/json.hpp>

#include <cstdint>
#include <cstdlib>
#include <exception>
#include <fcntl.h>
#include <set>
#include <signal.h>
#include <sstream>
#include <string>
#include <string_view>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>
#include <vector>

namespace palpate::compute {

namespace {

using Json = nlohmann::json;

/// A line at once: what was said before a crash has been heard.
void say(const Json& message) {
  const int number = fcntl(report_fd, F_GETFD) == -1 ? STDOUT_FILENO : report_fd;
  const std::string line = message.dump(-1, ' ', true, Json::error_handler_t::replace) + "\n";
  for (std::size_t done = 0; done < line.size();) {
    const ssize_t count = write(number, line.data() + done, line.size() - done);
    if (count <= 0) std::exit(1);  // nobody listens
    done += static_cast<std::size_t>(count);
  }
}

Json described(const DeviceInfo& info) {
  return {{"index", info.index},
          {"name", info.name},
          {"platform", info.platform},
          {"driver", info.driver},
          {"type", to_string(info.type)},
          {"memory_bytes", info.memory_bytes},
          {"compute_units", info.compute_units},
          {"usable", info.usable},
          {"reason", info.reason}};
}

/// Empty when the device did as it was told.
std::string try_device(const Found& found) {
  constexpr std::uint32_t count = 1000;
  try {
    const Device device = open_found(found);
    KernelLibrary library(device);
    Kernel kernel = library.build("probe.cl", "probe");
    std::vector<std::uint32_t> values(count, 0);
    Buffer buffer = Buffer::copy_of(device, values.data(), count * sizeof(std::uint32_t));
    kernel.set_all(buffer, count);
    kernel.run(count);
    buffer.read(values.data(), count * sizeof(std::uint32_t));
    for (std::uint32_t n = 0; n < count; ++n)
      if (values[n] != 2 * n + 1) return "it computes wrong numbers";
    return {};
  } catch (const std::exception& error) {
    return error.what();
  }
}

std::set<int> numbers(const std::string& list) {
  std::set<int> found;
  std::istringstream stream(list);
  for (std::string word; std::getline(stream, word, ',');) found.insert(std::atoi(word.c_str()));
  return found;
}

}  // namespace

int probe_main(int argc, char** argv) {
  // A driver that crashes is no news to the system, and ends with who asked.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  std::set<int> skipped;
  for (int n = 1; n + 1 < argc; ++n)
    if (std::string_view(argv[n]) == "--skip") skipped = numbers(argv[n + 1]);
  setenv("PALPATE_KERNEL_CACHE", "off", 1);

  const std::vector<Found> devices = enumerate();
  Json list = Json::array();
  for (const auto& device : devices) list.push_back(described(device.info));
  say({{"devices", list}});
  for (const auto& device : devices) {
    if (!device.info.usable || skipped.count(device.info.index) != 0) continue;
    say({{"trying", device.info.index}});
    say({{"tried", device.info.index}, {"failure", try_device(device)}});
  }
  say({{"done", true}});
  return 0;
}

}  // namespace palpate::compute
