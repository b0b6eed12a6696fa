#include "palpate/simulation/self_test.hpp"

#include "device_test.hpp"

#include "palpate/compute/kernel_library.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>

namespace simulation = palpate::simulation;

namespace {

class SelfTest : public palpate::testing::DeviceTest {};

}  // namespace

TEST_F(SelfTest, PassesInEachLayoutWellBelowTheMotionThatItCompares) {
  const auto result = simulation::self_test(device(), 12);
  ASSERT_EQ(result.cases.size(), 2U);
  EXPECT_TRUE(result.passed());
  for (const auto& one : result.cases) {
    EXPECT_TRUE(one.passed) << one.layout << ": " << one.failure;
    EXPECT_EQ(one.points, 12U * 12U * 12U);
    EXPECT_GT(one.motion_mm, 100.0 * one.tolerance_mm) << "what does not move proves nothing";
    EXPECT_LE(one.max_difference_mm, one.tolerance_mm);
    EXPECT_GT(one.link_evaluations_per_s, 0.0);
  }
}

TEST_F(SelfTest, FindsADeviceThatComputesWrongNumbers) {
  // A driver whose square roots are off by two parts in a hundred.
  const palpate::testing::TemporaryFolder folder;
  std::string text = palpate::compute::KernelLibrary::source("explicit.cl");
  const std::string right = "rsqrt(";
  const std::string wrong_root = "1.02f * rsqrt(";
  int changed = 0;
  for (auto at = text.find(right); at != std::string::npos; at = text.find(right, at + wrong_root.size())) {
    text.replace(at, right.size(), wrong_root);
    ++changed;
  }
  ASSERT_GT(changed, 0) << "the kernel takes no root that could be wrong";
  std::ofstream(folder / "explicit.cl") << text;
  setenv("PALPATE_KERNEL_DIR", folder.path().c_str(), 1);
  const auto result = simulation::self_test(device(), 6);
  unsetenv("PALPATE_KERNEL_DIR");
  EXPECT_FALSE(result.passed());
  ASSERT_EQ(result.cases.size(), 2U);
  const auto& wrong = result.cases.back();
  EXPECT_EQ(wrong.layout, "explicit");
  EXPECT_FALSE(wrong.passed);
  EXPECT_GT(wrong.max_difference_mm, wrong.tolerance_mm);
  EXPECT_NE(wrong.failure.find("differ from the reference"), std::string::npos) << wrong.failure;
}

TEST_F(SelfTest, NamesAKernelThatDoesNotBuild) {
  const palpate::testing::TemporaryFolder folder;
  std::ofstream(folder / "explicit.cl") << "#error a driver that cannot build it\n";
  setenv("PALPATE_KERNEL_DIR", folder.path().c_str(), 1);
  const auto result = simulation::self_test(device(), 6);
  unsetenv("PALPATE_KERNEL_DIR");
  EXPECT_FALSE(result.passed());
  ASSERT_EQ(result.cases.size(), 2U);
  EXPECT_NE(result.cases.back().failure.find("could not build"), std::string::npos)
      << result.cases.back().failure;
}
