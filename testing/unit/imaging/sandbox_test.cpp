// What the reader may no longer do once it parses, and that it still reads.
#include "reading/sandbox.hpp"

#include "reader_files.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <functional>
#include <netinet/in.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace {

using palpate::imaging::reading::enter_sandbox;
using palpate::imaging::reading::sandbox_state;
using namespace palpate::testing;

/// Runs it in a child that has entered the sandbox; what it returned, or -1
/// where the child ended otherwise. 100 stands for a kernel without seccomp.
int within(const std::function<int()>& work) {
  constexpr int no_seccomp = 100;
  const pid_t child = fork();
  if (child == 0) {
    enter_sandbox();
    _exit(sandbox_state() == "seccomp" ? work() : no_seccomp);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// The error number of a call that returned `result`; 0 where it did not fail.
int failure(long result) { return result < 0 ? errno : 0; }

class Sandbox : public ::testing::Test {
 protected:
  void SetUp() override {
    if (within([] { return 0; }) == 100) GTEST_SKIP() << "the kernel lets no filter in (seccomp)";
    write_bytes(file_, "here");
  }
  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "file";
};

TEST_F(Sandbox, RefusesWhatAReaderDoesNotNeed) {
  const std::string file = file_.string();
  const std::string other = (folder_ / "other").string();
  const pid_t parent = getpid();
  const std::vector<std::pair<std::string, std::function<int()>>> tries{
      {"socket", [] { return failure(socket(AF_INET, SOCK_STREAM, 0)); }},
      {"local socket", [] { return failure(socket(AF_UNIX, SOCK_STREAM, 0)); }},
      {"connect",
       [] {
         sockaddr_in address{};
         address.sin_family = AF_INET;
         return failure(connect(0, reinterpret_cast<const sockaddr*>(&address), sizeof(address)));
       }},
      {"fork", [] { return failure(fork()); }},
      {"vfork through posix_spawn",
       [] {
         std::array<char*, 2> words{const_cast<char*>("true"), nullptr};
         pid_t started = 0;
         return posix_spawn(&started, "/bin/true", nullptr, nullptr, words.data(), nullptr);
       }},
      {"exec",
       [] {
         std::array<char*, 2> words{const_cast<char*>("true"), nullptr};
         return failure(execv("/bin/true", words.data()));
       }},
      {"open for writing", [&] { return failure(open(file.c_str(), O_WRONLY)); }},
      {"open for both", [&] { return failure(open(file.c_str(), O_RDWR)); }},
      {"create", [&] { return failure(open(other.c_str(), O_CREAT | O_RDONLY, 0600)); }},
      {"open and empty", [&] { return failure(open(file.c_str(), O_RDONLY | O_TRUNC)); }},
      {"truncate", [&] { return failure(truncate(file.c_str(), 0)); }},
      {"unlink", [&] { return failure(unlink(file.c_str())); }},
      {"rename", [&] { return failure(rename(file.c_str(), other.c_str())); }},
      {"link", [&] { return failure(link(file.c_str(), other.c_str())); }},
      {"symlink", [&] { return failure(symlink(file.c_str(), other.c_str())); }},
      {"chmod", [&] { return failure(chmod(file.c_str(), 0777)); }},
      {"mkdir", [&] { return failure(mkdir(other.c_str(), 0700)); }},
      {"kill parent", [&] { return failure(kill(parent, 0)); }},
      {"kill all", [] { return failure(kill(-1, 0)); }},
      {"ptrace", [&] { return failure(ptrace(PTRACE_ATTACH, parent, nullptr, nullptr)); }},
      {"more memory files", [] { return failure(memfd_create("x", 0)); }}};
  for (const auto& [what, attempt] : tries) EXPECT_EQ(within(attempt), EPERM) << what;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  // A descriptor beyond those that the parent gave; sanitizers have a pipe of their own, of any number.
  EXPECT_EQ(within([] { return failure(write(fcntl(1, F_DUPFD, 50), "x", 1)); }), EPERM) << "write elsewhere";
#endif
  std::ifstream still(file_);
  std::string word;
  still >> word;
  EXPECT_EQ(word, "here");
  EXPECT_FALSE(std::filesystem::exists(other));
}

TEST_F(Sandbox, LeavesWhatAReaderNeeds) {
  const std::string file = file_.string();
  EXPECT_EQ(within([&] { return failure(open(file.c_str(), O_RDONLY)); }), 0);
  EXPECT_EQ(within([] {
              int seen = 1;
              std::thread([&] { seen = 0; }).join();
              return seen;
            }),
            0);
  EXPECT_EQ(within([] { return failure(write(1, "", 0)); }), 0);
  // abort() still ends it by its signal: it is what a crash is told by.
  EXPECT_EQ(within([]() -> int { abort(); }), -1);
}

TEST_F(Sandbox, AScanIsReadInIt) {
  const auto scan = folder_ / "scan.mha";
  write_mha(scan, "2 2 1", "MET_UCHAR", "abcd");
  SmallImage image;
  image.write(folder_ / "scan.dcm");
  for (const auto& path : {scan, folder_ / "scan.dcm"})
    EXPECT_EQ(within([&]() -> int {
                try {
                  const auto sequence = palpate::imaging::parse_unprotected(path, {}, {});
                  return sequence.frames.size() == 1 ? 0 : 1;
                } catch (const std::exception&) {
                  return 2;
                }
              }),
              0)
        << path;
}

TEST_F(Sandbox, TheReaderSaysThatItIsInIt) { EXPECT_EQ(palpate::imaging::reader_sandbox(), "seccomp"); }

TEST_F(Sandbox, AReaderThatEndsAtOnceSaysNothingOfIt) {
  setenv("PALPATE_READER", "/bin/false", 1);
  const std::string state = palpate::imaging::reader_sandbox();
  unsetenv("PALPATE_READER");
  EXPECT_EQ(state, "none");
}

/// A line of /proc/PID/status of the only child of this process.
std::string status_of_child(const std::string& key) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream status(entry.path() / "status");
    std::string word;
    std::string parent;
    while (status >> word) {
      if (word == "PPid:") status >> parent;
      if (word == key && parent == std::to_string(getpid()) && status >> word) return word;
    }
  }
  return "";
}

TEST_F(Sandbox, TheReaderIsInItWhileItParses) {
  // Seen from outside, by the kernel's word, when the reader reports that it is at the voxels.
  const auto scan = folder_ / "scan.mha";
  write_mha(scan, "256 256 64", "MET_UCHAR", std::string(256 * 256 * 64, 'a'));
  std::string filter;
  std::string privileges;
  const palpate::core::Progress look(
      [&](double, const std::string&) {
        if (!filter.empty()) return;
        filter = status_of_child("Seccomp:");
        privileges = status_of_child("NoNewPrivs:");
      },
      {});
  palpate::imaging::read(scan, {}, look);
  EXPECT_EQ(filter, "2");  // SECCOMP_MODE_FILTER
  EXPECT_EQ(privileges, "1");
}

}  // namespace
