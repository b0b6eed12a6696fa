#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::testing {

/// A folder that is removed with its contents at the end of the test.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const noexcept { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// A scan of the test data (PALPATE_TEST_DATA), or none where it is missing.
std::optional<std::filesystem::path> test_scan(const std::string& relative_path);

/// Exit code and what a program printed; `input` is what it reads.
struct ProgramResult {
  int exit_code = -1;  ///< -1 when a signal ended it
  int signal = 0;
  std::string out;
  std::string error;
};
/// Runs a program of this build (beside the test) or an absolute path.
ProgramResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          double time_limit_s = 120.0);
/// How often a test that grows with its count repeats: `full` under
/// `scripts/test --long`, else `reduced`.
int repetitions(int reduced, int full);
/// The folder that holds this build's programs.
std::filesystem::path program_folder();

}  // namespace palpate::testing

/// Skips a test, saying so, where a scan of the test data is missing.
#define PALPATE_TEST_SCAN(variable, relative)                                                           \
  const auto variable##_found = ::palpate::testing::test_scan(relative);                                \
  if (!variable##_found) GTEST_SKIP() << "test data missing: " << (relative) << " (PALPATE_TEST_DATA)"; \
  const std::filesystem::path& variable = *variable##_found
