#include "palpate/testing/support.hpp"

#include <array>
#include <chrono>
#include <cstdlib>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdexcept>
#include <sys/wait.h>
#include <unistd.h>

namespace palpate::testing {

TemporaryFolder::TemporaryFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "palpate-test-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder: " + pattern);
  path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::optional<std::filesystem::path> test_scan(const std::string& relative_path) {
  const char* folder = std::getenv("PALPATE_TEST_DATA");
  if (folder == nullptr) return std::nullopt;
  const auto path = std::filesystem::path(folder) / relative_path;
  if (!std::filesystem::exists(path)) return std::nullopt;
  return path;
}

int repetitions(int reduced, int full) {
  const char* wanted = std::getenv("PALPATE_TEST_LONG");
  return wanted != nullptr && *wanted == '1' ? full : reduced;
}

std::filesystem::path program_folder() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path();
}

ProgramResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          double time_limit_s) {
  const std::filesystem::path path = program_folder() / program;  // an absolute `program` replaces it
  std::array<int, 2> out{};
  std::array<int, 2> error{};
  if (pipe(out.data()) != 0 || pipe(error.data()) != 0) throw std::runtime_error("no pipe");
  std::vector<std::string> words{path.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (auto& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no fork");
  if (child == 0) {
    dup2(out[1], STDOUT_FILENO);
    dup2(error[1], STDERR_FILENO);
    for (const int end : {out[0], out[1], error[0], error[1]}) close(end);
    execv(argv[0], argv.data());
    _exit(127);
  }
  close(out[1]);
  close(error[1]);
  ProgramResult result;
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(time_limit_s);
  std::array<pollfd, 2> watched{pollfd{out[0], POLLIN, 0}, pollfd{error[0], POLLIN, 0}};
  int open_ends = 2;
  while (open_ends > 0) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) {
      kill(child, SIGKILL);
      result.error += "\n[ended by the test: over its time limit]";
      break;
    }
    if (poll(watched.data(), watched.size(), static_cast<int>(left.count())) <= 0) continue;
    for (std::size_t n = 0; n < watched.size(); ++n) {
      if (watched[n].fd < 0 || watched[n].revents == 0) continue;
      std::array<char, 4096> block{};
      const ssize_t count = read(watched[n].fd, block.data(), block.size());
      if (count > 0) {
        (n == 0 ? result.out : result.error).append(block.data(), static_cast<std::size_t>(count));
      } else {
        watched[n].fd = -1;
        --open_ends;
      }
    }
  }
  close(out[0]);
  close(error[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
  return result;
}

}  // namespace palpate::testing
