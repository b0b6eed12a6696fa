#include "palpate/core/atomic_output.hpp"

#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <array>
#include <csignal>
#include <fcntl.h>
#include <fstream>
#include <iterator>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

using namespace palpate;
using core::write_file;
using palpate::testing::TemporaryFolder;
namespace fs = std::filesystem;

namespace {

std::string content_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::size_t entries_in(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

/// The code of the Error(output), or what came instead.
std::string refusal_of(const fs::path& path, const std::string& bytes = "text") {
  try {
    write_file(path, bytes);
  } catch (const core::Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::output);
    EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos) << error.what();
    return error.code();
  }
  return "nothing";
}

/// Files of this process end after that many bytes, as on a full disk.
class ShortFiles {
 public:
  explicit ShortFiles(rlim_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit now = before_;
    now.rlim_cur = bytes;
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &now);
  }
  ~ShortFiles() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  ShortFiles(const ShortFiles&) = delete;
  ShortFiles& operator=(const ShortFiles&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int) = SIG_DFL;
};

}  // namespace

TEST(WriteFile, WritesAndReplacesAndLeavesNothingElse) {
  const TemporaryFolder folder;
  write_file(folder / "a", "first");
  write_file(folder / "a", "second");
  EXPECT_EQ(content_of(folder / "a"), "second");
  write_file(folder / "empty", "");
  EXPECT_EQ(fs::file_size(folder / "empty"), 0U);
  EXPECT_EQ(entries_in(folder.path()), 2U);
}

TEST(WriteFile, GivesTheRightsThatTheUsersMaskGives) {
  const TemporaryFolder folder;
  const mode_t mask = umask(027);
  write_file(folder / "a", "text");
  umask(mask);
  EXPECT_EQ(static_cast<unsigned>(fs::status(folder / "a").permissions()), 0640U);
}

TEST(WriteFile, ATargetAsLongAsNamesMayBeIsWritten) {
  const TemporaryFolder folder;
  const std::string longest(255, 'n');
  write_file(folder / longest, "text");
  EXPECT_EQ(content_of(folder / longest), "text");
  EXPECT_EQ(refusal_of(folder / (longest + "n")), "write-failed");
  EXPECT_EQ(entries_in(folder.path()), 1U);
}

TEST(WriteFile, ALinkStaysALinkAndItsFileIsReplaced) {
  const TemporaryFolder folder;
  write_file(folder / "file", "first");
  fs::create_symlink("file", folder / "link");
  write_file(folder / "link", "second");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(content_of(folder / "file"), "second");
}

TEST(WriteFile, ADiskThatIsFullLeavesTheOldFileAndNothingElse) {
  const TemporaryFolder folder;
  write_file(folder / "a", "first");
  {
    const ShortFiles full(1000);
    EXPECT_EQ(refusal_of(folder / "a", std::string(5000, 'x')), "write-failed");
  }
  EXPECT_EQ(content_of(folder / "a"), "first");
  EXPECT_EQ(entries_in(folder.path()), 1U);
}

TEST(WriteFile, FoldersAreNoFiles) {
  const TemporaryFolder folder;
  EXPECT_EQ(refusal_of(folder.path()), "is-a-folder");
  EXPECT_EQ(refusal_of(folder / "none" / "a"), "no-such-folder");
  write_file(folder / "file", "text");
  EXPECT_EQ(refusal_of(folder / "file" / "a"), "no-such-folder");
  EXPECT_EQ(refusal_of("/proc/a"), "no-permission");
}

TEST(WriteFile, ADeviceIsWrittenAndNotReplaced) {
  const TemporaryFolder folder;
  fs::create_symlink("/dev/full", folder / "full");
  EXPECT_EQ(refusal_of(folder / "full"), "write-failed");
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
  fs::create_symlink("/dev/null", folder / "null");
  EXPECT_EQ(refusal_of(folder / "null"), "nothing");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  EXPECT_EQ(entries_in(folder.path()), 2U);
}

TEST(WriteFile, APipeIsFedAndOneThatNobodyReadsIsNotWaitedFor) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(refusal_of(folder / "pipe"), "write-failed");
  const int reader = open((folder / "pipe").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  write_file(folder / "pipe", "text");
  std::array<char, 16> got{};
  EXPECT_EQ(read(reader, got.data(), got.size()), 4);
  EXPECT_EQ(std::string(got.data()), "text");
  close(reader);
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
}
