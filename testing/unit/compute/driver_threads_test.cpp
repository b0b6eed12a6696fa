#include "palpate/compute/driver_threads.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <sched.h>
#include <string>
#include <unistd.h>

namespace compute = palpate::compute;

namespace {

/// Gives back the process its processors and its variable.
class DriverThreads : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(sched_getaffinity(0, sizeof allowed_, &allowed_), 0);
    if (const char* value = std::getenv(name)) before_ = value;
    unsetenv(name);
  }
  void TearDown() override {
    sched_setaffinity(0, sizeof allowed_, &allowed_);
    if (before_)
      setenv(name, before_->c_str(), 1);
    else
      unsetenv(name);
  }
  static std::string asked() {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  }
  static constexpr const char* name = "POCL_AFFINITY";
  cpu_set_t allowed_{};

 private:
  std::optional<std::string> before_;
};

}  // namespace

TEST_F(DriverThreads, AreBoundWhereTheProcessMayRunOnEveryProcessor) {
  if (CPU_COUNT(&allowed_) != sysconf(_SC_NPROCESSORS_CONF))
    GTEST_SKIP() << "not all processors are ours here";
  compute::bind_driver_threads();
  EXPECT_EQ(asked(), "1");
}

TEST_F(DriverThreads, AreLeftAloneWhereAProcessorIsForbidden) {
  if (CPU_COUNT(&allowed_) < 2) GTEST_SKIP() << "there is one processor here";
  cpu_set_t fewer = allowed_;
  int first = 0;
  while (!CPU_ISSET(first, &fewer)) ++first;
  CPU_CLR(first, &fewer);
  ASSERT_EQ(sched_setaffinity(0, sizeof fewer, &fewer), 0);
  compute::bind_driver_threads();
  EXPECT_EQ(asked(), "") << "PoCL would end the program";
}

TEST_F(DriverThreads, AreAsTheUserSaid) {
  setenv(name, "0", 1);
  compute::bind_driver_threads();
  EXPECT_EQ(asked(), "0");
}
