#include "child.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <string_view>
#include <sys/wait.h>
#include <unistd.h>

// POSIX leaves its declaration to the program.
extern char** environ;  // NOLINT(readability-redundant-declaration)

namespace palpate::compute {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t longest_report = std::size_t{1} << 20;

struct Pipe {
  std::array<int, 2> ends{-1, -1};
  // Above report_fd, so that handing over never overwrites an end.
  Pipe() {
    std::array<int, 2> low{-1, -1};
    if (pipe2(low.data(), O_CLOEXEC) != 0) return;
    for (std::size_t n = 0; n < 2; ++n) {
      ends[n] = fcntl(low[n], F_DUPFD_CLOEXEC, report_fd + 7);
      close(low[n]);
    }
  }
  ~Pipe() {
    for (std::size_t n = 0; n < 2; ++n) shut(n);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  void shut(std::size_t n) {
    if (ends[n] >= 0) close(ends[n]);
    ends[n] = -1;
  }
};

/// posix_spawn's two objects, destroyed in any case.
struct SpawnSettings {
  posix_spawn_file_actions_t actions{};
  posix_spawnattr_t attributes{};
  explicit SpawnSettings(int report) {
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, report, report_fd);
    posix_spawn_file_actions_addclosefrom_np(&actions, report_fd + 1);
    sigset_t none;
    sigset_t all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(&attributes,
                             POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~SpawnSettings() {
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;
};

std::vector<std::string> environment_with(const std::vector<std::pair<std::string, std::string>>& changes) {
  std::vector<std::string> entries;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    const std::string_view text(*entry);
    const auto replaced = [text](const auto& change) {
      return text.substr(0, change.first.size() + 1) == change.first + "=";
    };
    if (std::none_of(changes.begin(), changes.end(), replaced)) entries.emplace_back(text);
  }
  for (const auto& [name, value] : changes) entries.push_back(name + "=" + value);
  return entries;
}

std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> list;
  list.reserve(words.size() + 1);
  for (auto& word : words) list.push_back(word.data());
  list.push_back(nullptr);
  return list;
}

/// Reads until the end of the report. False when the time is over first.
bool read_report(int number, Clock::time_point deadline, std::string& report) {
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    if (left.count() <= 0) return false;
    pollfd watched{number, POLLIN, 0};
    const int ready = poll(&watched, 1, static_cast<int>(left.count()));
    if (ready < 0 && errno != EINTR) return false;
    if (ready <= 0) continue;
    std::array<char, 4096> block{};
    const ssize_t count = read(number, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return true;
    if (report.size() < longest_report) report.append(block.data(), static_cast<std::size_t>(count));
  }
}

/// Waits for a child that closed its report; one that lingers is given its time.
bool ended_by(pid_t pid, Clock::time_point deadline) {
  for (;;) {
    siginfo_t info{};
    if (waitid(P_PID, static_cast<id_t>(pid), &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid == pid)
      return true;
    if (Clock::now() >= deadline) return false;
    poll(nullptr, 0, 2);
  }
}

}  // namespace

ChildEnd run_child(const std::filesystem::path& program, const std::vector<std::string>& arguments,
                   const std::vector<std::pair<std::string, std::string>>& environment, double time_limit_s) {
  ChildEnd end;
  Pipe pipe;
  if (pipe.ends[1] < 0) return end;
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<std::string> variables = environment_with(environment);
  const SpawnSettings settings(pipe.ends[1]);
  const auto deadline =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(time_limit_s));
  pid_t pid = -1;
  end.started = posix_spawn(&pid, program.c_str(), &settings.actions, &settings.attributes,
                            pointers(words).data(), pointers(variables).data()) == 0;
  if (!end.started) return end;
  pipe.shut(1);
  end.timed_out = !read_report(pipe.ends[0], deadline, end.report) || !ended_by(pid, deadline);
  // The whole group: what a driver started goes with it. The child itself is
  // not reaped yet, so the number is still its own.
  kill(-pid, SIGKILL);
  if (end.timed_out) kill(pid, SIGKILL);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) end.signal = WTERMSIG(status);
  if (WIFEXITED(status)) end.exit_code = WEXITSTATUS(status);
  return end;
}

}  // namespace palpate::compute
