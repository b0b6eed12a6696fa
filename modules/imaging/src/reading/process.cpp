#include "process.hpp"

#include "parsed.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

// POSIX leaves its declaration to the program.
extern char** environ;  // NOLINT(readability-redundant-declaration)

namespace palpate::imaging::reading {

void Descriptor::reset() {
  if (number_ >= 0) close(number_);
  number_ = -1;
}

namespace {

using Clock = std::chrono::steady_clock;
using core::Error;
using core::ErrorKind;

constexpr std::size_t longest_talk = std::size_t{16} << 20;  // bytes of messages from one child

[[noreturn]] void fail_system(const std::string& what) {
  throw Error(ErrorKind::internal, "reader-start",
              "The reader process cannot be started: " + what + ": " + std::strerror(errno) + ".");
}

/// Above the numbers that the child uses, so that handing over never overwrites one.
Descriptor moved_up(Descriptor low) {
  constexpr int above = 10;
  Descriptor high(fcntl(low.number(), F_DUPFD_CLOEXEC, above));
  if (high.number() < 0) fail_system("no free file descriptor");
  return high;
}

Descriptor memory_file(const char* name) {
  Descriptor file(memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (file.number() < 0) fail_system("no shared memory");
  return moved_up(std::move(file));
}

void write_all(int number, const std::string& bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = write(number, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail_system("the request cannot be written");
    done += static_cast<std::size_t>(count);
  }
}

std::string bytes_of(const ReaderRequest& request) {
  const ReadOptions& options = request.options;
  nlohmann::json json{{"series_uid", options.series_uid},   {"allow_truncated", options.allow_truncated},
                      {"orientation", options.orientation}, {"frame_count", options.frame_count},
                      {"entries", request.entries},         {"thumbnails", request.thumbnails}};
  if (options.frame) json["frame"] = *options.frame;
  if (options.grid_spacing_mm) json["grid_spacing_mm"] = *options.grid_spacing_mm;
  if (options.spacing_mm) json["spacing_mm"] = *options.spacing_mm;
  std::string bytes = json.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n";
  for (const auto& path : request.paths) {
    bytes += path.native();
    bytes.push_back('\0');
  }
  return bytes;
}

std::filesystem::path reader_program() {
  if (const char* named = std::getenv("PALPATE_READER"); named != nullptr && *named != '\0') return named;
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  return self.parent_path() / "palpate-reader";
}

/// A started child; it and whatever it started are ended and reaped with this.
class Child {
 public:
  explicit Child(pid_t pid) : pid_(pid) {}
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() { end(); }

  /// True once the child has ended by itself; it stays to be reaped.
  bool ended() const {
    siginfo_t info{};
    if (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) != 0)
      return errno == ECHILD;
    return info.si_pid == pid_;
  }
  /// Ends it if need be and returns how it ended, as waitpid says.
  int end() {
    if (pid_ < 0) return status_;
    // The whole group: a reader that started something takes it along.
    kill(-pid_, SIGKILL);
    if (!ended()) kill(pid_, SIGKILL);
    while (waitpid(pid_, &status_, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    return status_;
  }

 private:
  pid_t pid_;
  int status_ = 0;
};

/// posix_spawn's two objects, destroyed in any case.
struct SpawnSettings {
  posix_spawn_file_actions_t actions{};
  posix_spawnattr_t attributes{};
  SpawnSettings() {
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
  }
  ~SpawnSettings() {
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;
};

pid_t start(ReaderTask task, const ReaderLimits& limits, int request, int messages, int voxels) {
  const std::string program = reader_program().string();
  SpawnSettings settings;
  // The libraries' chatter is nothing for the user; what matters comes as a message.
  posix_spawn_file_actions_addopen(&settings.actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&settings.actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&settings.actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&settings.actions, request, request_fd);
  posix_spawn_file_actions_adddup2(&settings.actions, messages, message_fd);
  posix_spawn_file_actions_adddup2(&settings.actions, voxels, voxels_fd);
  posix_spawn_file_actions_addclosefrom_np(&settings.actions, voxels_fd + 1);
  sigset_t none;
  sigset_t all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&settings.attributes, &none);
  posix_spawnattr_setsigdefault(&settings.attributes, &all);
  posix_spawnattr_setpgroup(&settings.attributes, 0);
  posix_spawnattr_setflags(&settings.attributes,
                           POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  const char* const task_word = task == ReaderTask::read   ? "--read"
                                : task == ReaderTask::scan ? "--scan"
                                                           : "--describe";
  std::vector<std::string> words{program, task_word, std::to_string(limits.memory_bytes),
                                 std::to_string(static_cast<long long>(std::ceil(limits.time_s)) + 1),
                                 std::to_string(getpid())};
  std::vector<char*> argv;
  for (auto& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t pid = -1;
  const int failure =
      posix_spawn(&pid, program.c_str(), &settings.actions, &settings.attributes, argv.data(), environ);
  if (failure != 0)
    throw Error(ErrorKind::input, "reader-missing",
                "The program that reads files, " + program + ", cannot be started (" +
                    std::strerror(failure) + "). Install Palpate again, or set PALPATE_READER to it.");
  return pid;
}

/// What the child said so far, line by line.
class Talk {
 public:
  explicit Talk(int number) : number_(number) {}

  /// Takes what is there. False at the end of the talk.
  bool take() {
    std::array<char, 65536> block{};
    for (;;) {
      const ssize_t count = ::read(number_, block.data(), block.size());
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return errno == EAGAIN;
      if (count == 0) return false;
      text_.append(block.data(), static_cast<std::size_t>(count));
      total_ += static_cast<std::size_t>(count);
      if (total_ > longest_talk) throw std::length_error("too long a talk");
    }
  }
  /// The next whole line, or false.
  bool next(std::string& line) {
    const auto end = text_.find('\n');
    if (end == std::string::npos) return false;
    line = text_.substr(0, end);
    text_.erase(0, end + 1);
    return true;
  }

 private:
  int number_;
  std::string text_;
  std::size_t total_ = 0;
};

std::string plain(std::string text, std::size_t longest) {
  if (text.size() > longest) text.resize(longest);
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 && c != '\n') c = ' ';
  return text;
}

const char* advice = " Nothing was opened. Export the scan again, uncompressed, or as MetaImage or NRRD.";

[[noreturn]] void fail_crashed(const std::filesystem::path& shown, const std::string& how) {
  fail("reader-crashed", shown,
       "ended the program that reads files (" + how +
           "): it is damaged, or holds something that cannot be decoded." + advice,
       how);
}

/// What was heard from a child, message by message.
struct Heard {
  bool answered = false;
  nlohmann::json result;
  std::string risk;  ///< what an abort would mean: the file and what is the matter with it
};

/// Deals with one message.
void understand(const std::string& line, const std::filesystem::path& shown, const core::Progress& progress,
                const TakeItem& take_item, Heard& heard) {
  nlohmann::json message;
  double fraction = 0.0;
  std::string what;
  try {
    message = nlohmann::json::parse(line);
    if (message.contains("error")) throw error_of(message.at("error"), shown);
    if (message.contains("result")) {
      heard.result = std::move(message.at("result"));
      heard.answered = true;
      return;
    }
    if (message.contains("risk")) {
      heard.risk = plain(message.at("risk").get<std::string>(), 4000);
      return;
    }
    if (message.contains("item") && take_item) {
      take_item(message.at("item"));
      return;
    }
    fraction = message.at("progress").get<double>();
    what = plain(message.at("what").get<std::string>(), 200);
  } catch (const nlohmann::json::exception&) {
    fail_crashed(shown, "an answer that makes no sense");
  }
  if (std::isfinite(fraction)) progress.report(fraction, what);
}

[[noreturn]] void explain_end(int status, const std::filesystem::path& shown, const std::string& risk) {
  if (WIFSIGNALED(status)) {
    const int signal_number = WTERMSIG(status);
    if (signal_number == SIGXCPU)
      fail("reader-timeout", shown, std::string("took too long to read.") + advice);
    if (signal_number == SIGKILL)
      fail("reader-memory", shown,
           std::string("could not be read: the system ended the reader, most likely for want of memory.") +
               advice);
    const char* name = sigabbrev_np(signal_number);
    if (!risk.empty())
      throw Error(
          ErrorKind::input, "unsupported", risk,
          "The decoder was ended by " +
              (name == nullptr ? "signal " + std::to_string(signal_number) : "SIG" + std::string(name)) +
              ".");
    fail_crashed(shown,
                 name == nullptr ? "signal " + std::to_string(signal_number) : "SIG" + std::string(name));
  }
  fail_crashed(shown, "exit code " + std::to_string(WEXITSTATUS(status)) + " without an answer");
}

}  // namespace

core::Error error_of(const nlohmann::json& error, const std::filesystem::path& shown) {
  static const std::array<const char*, 11> known{
      "not-found", "unsupported", "truncated",      "bad-header", "too-large",    "no-image",
      "no-volume", "usage",       "several-series", "cancelled",  "reader-memory"};
  const auto code = error.at("code").get<std::string>();
  const auto text = plain(error.at("text").get<std::string>(), 4000);
  const auto details = plain(error.value("details", std::string()), 4000);
  if (std::find(known.begin(), known.end(), code) == known.end()) fail_crashed(shown, "an unknown answer");
  if (code == "usage") return {ErrorKind::usage, code, text};
  if (code == "reader-memory")
    return {
        ErrorKind::input, code,
        shown.string() +
            " needs more memory to read than the reader may use. Read a single frame, or export a smaller "
            "part of the scan."};
  return {ErrorKind::input, code, text, details};
}

ReaderReply run_reader(const ReaderRequest& request, const core::Progress& progress,
                       const ReaderLimits& limits, const TakeItem& take_item) {
  progress.cancel().check();
  const std::filesystem::path& shown = request.shown;
  Descriptor question = memory_file("palpate-request");
  write_all(question.number(), bytes_of(request));
  lseek(question.number(), 0, SEEK_SET);
  ReaderReply reply;
  reply.voxels = memory_file("palpate-voxels");
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0) fail_system("no pipe");
  Descriptor from_child(ends[0]);
  Descriptor to_parent = moved_up(Descriptor(ends[1]));
  // The writer may wait; only this side must never.
  fcntl(to_parent.number(), F_SETFL, 0);

  const auto deadline = Clock::now() + std::chrono::duration<double>(limits.time_s);
  Child child(start(request.task, limits, question.number(), to_parent.number(), reply.voxels.number()));
  to_parent.reset();
  Talk talk(from_child.number());
  Heard heard;
  bool open = true;
  try {
    for (bool alive = true; alive;) {
      constexpr int pause_ms = 20;  // how late a cancellation may be seen
      pollfd watched{open ? from_child.number() : -1, POLLIN, 0};
      poll(&watched, 1, open ? pause_ms : 2);
      progress.cancel().check();
      alive = !child.ended();  // before the last look, so that nothing it said is missed
      if (open) open = talk.take();
      for (std::string line; talk.next(line);) understand(line, shown, progress, take_item, heard);
      if (alive && Clock::now() > deadline)
        fail("reader-timeout", shown,
             "was not read within " + std::to_string(static_cast<long long>(limits.time_s)) + " s." + advice);
    }
  } catch (const std::length_error&) {
    fail_crashed(shown, "an endless answer");
  }
  const int status = child.end();
  if (!heard.answered || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    explain_end(status, shown, heard.risk);
  reply.result = std::move(heard.result);
  return reply;
}

}  // namespace palpate::imaging::reading
