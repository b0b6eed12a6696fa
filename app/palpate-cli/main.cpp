#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "values.hpp"

#include "palpate/compute/driver_threads.hpp"
#include "palpate/core/error.hpp"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <new>
#include <optional>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

namespace palpate::cli {
namespace {

using core::Error;
using core::ErrorKind;

struct Command {
  const char* name;
  const char* text;
  int (*run)(const Call&);
};
constexpr std::array<Command, 9> commands{{
    {"devices", "list the OpenCL devices", run_devices},
    {"info", "say what is in files and folders", run_info},
    {"filter", "filter a scan and write it", run_filter},
    {"phantom", "make the sample heart", run_phantom},
    {"model", "make tissue of a scan and count it", run_model},
    {"simulate", "simulate the tissue of a scan", run_simulate},
    {"render", "draw a scan and its tissue into a picture", run_render},
    {"bench", "measure this program on this machine", run_bench},
    {"experiment", "measure a figure of the thesis again", run_experiment},
}};

/// Turns SIGINT and SIGTERM into a cancelled token; a second one, where the
/// first could not be heeded (in a driver, say), ends the process. They are blocked in every
/// thread and so in the linkers that an OpenCL driver starts: a terminal sends
/// Ctrl-C to those too, and PoCL aborts the whole process when one dies of it.
class Interrupts {
 public:
  /// Before any other thread is started: threads inherit what is blocked.
  explicit Interrupts(const core::CancelToken& token) {
    sigemptyset(&waited_for_);
    sigaddset(&waited_for_, SIGTERM);
    // A shell starts what it puts in the background deaf to Ctrl-C; so it stays.
    struct sigaction before {};
    sigaction(SIGINT, nullptr, &before);
    if (before.sa_handler != SIG_IGN) sigaddset(&waited_for_, SIGINT);
    pthread_sigmask(SIG_BLOCK, &waited_for_, nullptr);
    thread_ = std::thread([this, &token] {
      int signal = 0;
      while (sigwait(&waited_for_, &signal) == 0 && !ended_) {
        if (token.cancelled()) _exit(static_cast<int>(ErrorKind::cancelled));
        token.cancel();
      }
    });
  }
  ~Interrupts() {
    ended_ = true;
    pthread_kill(thread_.native_handle(), SIGTERM);
    thread_.join();
  }
  Interrupts(const Interrupts&) = delete;
  Interrupts& operator=(const Interrupts&) = delete;

 private:
  sigset_t waited_for_{};
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

void ignore_write_signals() {
  struct sigaction action {};
  action.sa_handler = SIG_IGN;
  sigemptyset(&action.sa_mask);
  // A reader that went away is an error of write(), not the end of the process.
  sigaction(SIGPIPE, &action, nullptr);
  // So is a file that may not grow any more.
  sigaction(SIGXFSZ, &action, nullptr);
}

std::string version_text() { return std::string("palpate-cli ") + PALPATE_VERSION + "\n"; }

std::string overview() {
  std::string text =
      "Usage: palpate-cli COMMAND [options]\n\n"
      "Turns an ultrasound volume into tissue that can be pulled, without a display.\n\nCommands:\n";
  Table table;
  for (const auto& command : commands) table.emplace_back(command.name, command.text);
  return text + table_text(table) +
         "\nOptions:\n  --help     of a command: palpate-cli COMMAND --help\n  --version  prints the "
         "version\n"
         "\nExample:\n  palpate-cli render data/sample-heart.mha -o heart.png --size 1600x1200\n";
}

const Command& command_of(const std::string& name) {
  for (const auto& command : commands)
    if (name == command.name) return command;
  std::vector<std::string> names;
  for (const auto& command : commands) names.emplace_back(command.name);
  parse_choice(name, names);
  throw Error(ErrorKind::internal, "command", "The command " + name + " has no code.");
}

/// Before the first "--", where options end.
bool has(const std::vector<std::string>& arguments, const std::string& option) {
  const auto end = std::find(arguments.begin(), arguments.end(), "--");
  return std::find(arguments.begin(), end, option) != end;
}

int dispatch(const std::vector<std::string>& arguments, Console& console) {
  if (arguments.empty()) core::throw_usage("a command is needed.\n\n" + overview());
  const std::string& name = arguments.front();
  if (name == "--help" || name == "-h" || name == "help") {
    console.print(overview());
    return 0;
  }
  if (name == "--version") {
    console.print(version_text());
    return 0;
  }
  const Command& command = command_of(name);
  const std::vector<std::string> rest(arguments.begin() + 1, arguments.end());
  if (has(rest, "--version")) {
    console.print(version_text());
    return 0;
  }
  return command.run({rest, console, has(rest, "--help") || has(rest, "-h")});
}

/// What ended the work, as an Error. To be called in a handler.
Error current_error(const core::CancelToken& token) {
  // Whatever failed because of the stop is no fault of the file.
  if (token.cancelled())
    return {ErrorKind::cancelled, "cancelled", "Stopped before it was done; nothing half-written is left."};
  try {
    throw;
  } catch (const Error& error) {
    return error;
  } catch (const std::bad_alloc&) {
    return {ErrorKind::input, "too-large",
            "There is not enough memory for this. Take a larger --stride or a smaller --crop."};
  } catch (const std::exception& error) {
    return {ErrorKind::internal, "internal", std::string("A defect of this program: ") + error.what()};
  } catch (...) {
    return {ErrorKind::internal, "internal", "A defect of this program."};
  }
}

int run_program(int argc, char** argv) noexcept {
  const core::CancelToken token;
  ignore_write_signals();
  int code = static_cast<int>(ErrorKind::internal);
  try {
    const Interrupts interrupts(token);
    const std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
    Console console(take_outlets(), has(arguments, "--json"), has(arguments, "--progress"), token);
    try {
      code = dispatch(arguments, console);
    } catch (...) {
      const Error error = current_error(token);
      console.error(error);
      code = error.exit_code();
    }
  } catch (...) {  // no memory even to say so: the exit code tells
  }
  return code;
}

}  // namespace

void add_common(OptionSet& options, CommonOptions& common) {
  options.section("General");
  options.text("--device", "INDEX|NAME",
               "the OpenCL device, or reference (default: PALPATE_DEVICE, else the best)", common.device);
  options.flag("--json", "prints the result as one JSON object", common.json);
  options.flag("--progress", "prints progress to stderr even where it is no terminal", common.progress);
  options.value("--help", "", "prints this", [](const std::string&) {});
}

bool parse_or_help(const OptionSet& options, const Call& call) {
  if (call.help) {
    call.console.print(options.help());
    return true;
  }
  options.parse(call.arguments);
  return false;
}

}  // namespace palpate::cli

int main(int argc, char** argv) {
  palpate::compute::bind_driver_threads();
  return palpate::cli::run_program(argc, argv);
}
