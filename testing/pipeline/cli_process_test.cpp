#include "cli_support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <signal.h>
#include <string>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

using namespace palpate::testing;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

/// A running palpate-cli whose stderr is read.
class Running {
 public:
  Running(Words arguments, int standard_output, std::string variable = {}) {
    std::array<int, 2> error{};
    if (pipe(error.data()) != 0) throw std::runtime_error("no pipe");
    arguments.insert(arguments.begin(), (program_folder() / "palpate-cli").string());
    std::vector<char*> argv;
    for (auto& word : arguments) argv.push_back(word.data());
    argv.push_back(nullptr);
    child_ = fork();
    if (child_ == 0) {
      dup2(standard_output, STDOUT_FILENO);
      dup2(error[1], STDERR_FILENO);
      close(error[0]);
      close(error[1]);
      if (!variable.empty()) putenv(variable.data());
      execv(argv[0], argv.data());
      _exit(127);
    }
    close(error[1]);
    error_ = error[0];
  }
  ~Running() {
    if (child_ > 0 && !ended_) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
    }
    close(error_);
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  /// Reads stderr until it holds the text; false when it ended before.
  bool said(const std::string& text) {
    while (error_text_.find(text) == std::string::npos)
      if (!read_some()) return false;
    return true;
  }
  void interrupt() const { kill(child_, SIGINT); }
  /// Threads that the signal can be delivered to now, and threads in all.
  std::pair<int, int> threads_open_to(int signal) const {
    std::pair<int, int> result{0, 0};
    for (const auto& task : fs::directory_iterator("/proc/" + std::to_string(child_) + "/task")) {
      std::ifstream status(task.path() / "status");
      for (std::string line; std::getline(status, line);)
        if (line.rfind("SigBlk:", 0) == 0) {
          const auto blocked = std::stoull(line.substr(7), nullptr, 16);
          ++result.second;
          if ((blocked >> (signal - 1) & 1U) == 0) ++result.first;
        }
    }
    return result;
  }
  /// The wait status, after the last word.
  int end() {
    while (read_some()) {
    }
    int status = 0;
    waitpid(child_, &status, 0);
    ended_ = true;
    return status;
  }
  const std::string& error_text() const { return error_text_; }

 private:
  bool read_some() {
    std::array<char, 4096> block{};
    const ssize_t count = read(error_, block.data(), block.size());
    if (count > 0) error_text_.append(block.data(), static_cast<std::size_t>(count));
    return count > 0;
  }

  pid_t child_ = -1;
  int error_ = -1;
  bool ended_ = false;
  std::string error_text_;
};

}  // namespace

TEST(CliProcess, CtrlCStopsALongRunAndLeavesNothing) {
  const TemporaryFolder folder;
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  Running run({"simulate", sample(), "--stride", "2", "--threshold", "80", "--device", "reference", "--steps",
               "100000000", "--progress", "-o", (folder / "points.vtp").string()},
              nothing);
  close(nothing);
  ASSERT_TRUE(run.said("Simulating")) << run.error_text();
  run.interrupt();
  const int status = run.end();
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 130) << run.error_text();
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(CliProcess, WhatADriverStartsIsDeafToCtrlC) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device";
  const TemporaryFolder folder;
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  Running run({"simulate", sample(), "--stride", "2", "--threshold", "80", "--steps", "100000000",
               "--progress", "-o", (folder / "points.vtp").string()},
              nothing);
  close(nothing);
  ASSERT_TRUE(run.said("Simulating")) << run.error_text();
  // PoCL's threads start linkers, which inherit what is blocked, and PoCL
  // aborts when one dies. Only the thread that waits for the signal shows it open.
  const auto [open_threads, threads] = run.threads_open_to(SIGINT);
  EXPECT_LE(open_threads, 1);
  EXPECT_GE(threads, 3);
  run.interrupt();
  const int status = run.end();
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 130) << run.error_text();
}

TEST(CliProcess, CtrlCStopsAnExperimentAndLeavesNothing) {
  const TemporaryFolder folder;
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  Running run({"experiment", "stability-stiffness", "--device", "reference", "--progress", "-o",
               (folder / "figures").string()},
              nothing);
  close(nothing);
  ASSERT_TRUE(run.said("explodes")) << run.error_text();
  run.interrupt();
  const int status = run.end();
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 130) << run.error_text();
  EXPECT_TRUE(fs::is_empty(folder.path())) << "the folder that was made goes too";
}

TEST(CliProcess, CtrlCStopsReadingAndNoReaderIsLeft) {
  const TemporaryFolder folder;
  const fs::path pipe = folder / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  write_file(folder / "scan.mha", "scan");
  // A reader that reads for ever; the pipe is open as long as it lives.
  write_file(folder / "reader",
             "#!/bin/sh\nexec 9> " + pipe.string() + "\necho started >&9\nexec sleep 1000\n");
  fs::permissions(folder / "reader", fs::perms::owner_all);
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  Running run({"model", (folder / "scan.mha").string(), "-o", (folder / "points.vtp").string()}, nothing,
              "PALPATE_READER=" + (folder / "reader").string());
  close(nothing);
  const int reader = open(pipe.c_str(), O_RDONLY | O_CLOEXEC);  // waits for it
  std::array<char, 64> block{};
  EXPECT_EQ(read(reader, block.data(), block.size()), 8) << "not \"started\"";
  run.interrupt();
  const int status = run.end();
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 130) << run.error_text();
  EXPECT_EQ(read(reader, block.data(), block.size()), 0) << "the pipe ends with the reader";
  close(reader);
  EXPECT_FALSE(fs::exists(folder / "points.vtp"));
}

TEST(CliProcess, CtrlCStopsTheSampleHeartToo) {
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  const TemporaryFolder folder;
  // A scan of a few hundred megabytes is being made when the signal comes.
  Running run(
      {"phantom", "-o", (folder / "big.mha").string(), "--size", "512", "--frames", "8", "--progress"},
      nothing);
  close(nothing);
  ASSERT_TRUE(run.said(" %")) << run.error_text();
  run.interrupt();
  const int status = run.end();
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 130) << run.error_text();
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(CliProcess, AStandardOutputThatIsGoneOrFullIsSaid) {
  std::array<int, 2> gone{};
  ASSERT_EQ(pipe(gone.data()), 0);
  close(gone[0]);
  const int full = open("/dev/full", O_WRONLY | O_CLOEXEC);
  for (const int output : {gone[1], full}) {
    Running run({"filter", "--list", "--json"}, output);
    const int status = run.end();
    ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
    EXPECT_EQ(WEXITSTATUS(status), 6);
    EXPECT_THAT(run.error_text(), HasSubstr("standard output"));
  }
  close(gone[1]);
  close(full);
}

TEST(CliProcess, AFileThatMayNotGrowIsSaidInOneSentenceAndLeavesNothing) {
  const TemporaryFolder folder;
  // MetaIO, the NIfTI library and NRRD each have words of their own for it; ulimit counts in kB.
  for (const char* name : {"heart.mha", "heart.nii.gz", "heart.nrrd"}) {
    const std::string path = (folder / name).string();
    const auto result = run_program(
        "/bin/bash", {"-c", "ulimit -f 4; exec \"$0\" \"$@\"", (program_folder() / "palpate-cli").string(),
                      "phantom", "--size", "32", "-o", path});
    EXPECT_EQ(result.exit_code, 6) << "signal " << result.signal;
    EXPECT_THAT(result.error, HasSubstr("palpate-cli: Cannot write " + path));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    // Where sanitizers report, the libraries' chatter is heard too.
    EXPECT_EQ(result.error.rfind("palpate-cli: Cannot write", 0), 0U) << result.error;
    EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
#endif
    EXPECT_TRUE(fs::is_empty(folder.path()));
  }
}

TEST(CliProcess, ClosedStandardDescriptorsDoNoHarm) {
  const TemporaryFolder folder;
  const fs::path closed = folder / "closed.mha";
  const auto result = run_program(
      "/bin/bash", {"-c", "exec \"$0\" \"$@\" <&- >&- 2>&-", (program_folder() / "palpate-cli").string(),
                    "phantom", "--size", "32", "-o", closed.string()});
  EXPECT_EQ(result.exit_code, 6) << "the result could not be said";
  EXPECT_EQ(cli({"info", closed.string()}).exit_code, 0);
}

TEST(CliProcess, ProgressGoesToStderrOnlyWhereItIsWanted) {
  const Words run = {"model", sample(), "--stride", "4", "--threshold", "80"};
  EXPECT_EQ(cli(run).error, "");
  Words loud = run;
  loud.push_back("--progress");
  EXPECT_THAT(cli(loud).error, HasSubstr(" %"));
}
