// Devices as the command line shows them: found, tried, tested, lost.
#include "cli_support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

namespace palpate::testing {
namespace {

TEST(CliDevices, SelfTestComparesEachUsableDeviceWithTheReference) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device here";
  const auto plain = cli_json({"devices"});
  EXPECT_FALSE(plain["devices"][0].contains("self_test"));
  const auto object = cli_json({"devices", "--self-test"});
  int tested = 0;
  for (const auto& device : object["devices"]) {
    EXPECT_EQ(device.contains("self_test"), device["usable"].get<bool>());
    if (!device.contains("self_test")) continue;
    ++tested;
    const auto& test = device["self_test"];
    EXPECT_TRUE(test["passed"].get<bool>());
    ASSERT_EQ(test["cases"].size(), 2U);
    EXPECT_EQ(test["cases"][0]["layout"], "lattice");
    EXPECT_EQ(test["cases"][1]["layout"], "explicit");
    for (const auto& one : test["cases"]) {
      EXPECT_EQ(keys_of(one), (Words{"failure", "integrator", "layout", "link_evaluations_per_s", "links",
                                     "max_difference_mm", "motion_mm", "ms_per_step", "passed", "points",
                                     "step_s", "steps", "tolerance_mm"}));
      EXPECT_EQ(one["points"], 27 * 27 * 27);
      EXPECT_LE(one["max_difference_mm"].get<double>(), one["tolerance_mm"].get<double>());
      EXPECT_GT(one["motion_mm"].get<double>(), 100.0 * one["tolerance_mm"].get<double>());
      EXPECT_GT(one["link_evaluations_per_s"].get<double>(), 0.0);
    }
  }
  EXPECT_GT(tested, 0);
}

TEST(CliDevices, ADeviceThatFailsTheSelfTestIsNamedWithExitFour) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device here";
  // Lost after its first few kernels: neither layout comes to its end.
  const auto result = cli_with({"PALPATE_FAIL_AFTER_LAUNCHES=3"}, {"devices", "--self-test", "--json"});
  EXPECT_EQ(result.exit_code, 4);
  const auto object = nlohmann::json::parse(result.out, nullptr, false);
  ASSERT_TRUE(object.is_object()) << result.out;
  const auto& device = object["devices"][object["chosen"].get<std::size_t>()];
  EXPECT_FALSE(device["self_test"]["passed"].get<bool>());
  EXPECT_TRUE(device["self_test"]["cases"][0]["link_evaluations_per_s"].is_null());
  EXPECT_THAT(result.error, AllOf(HasSubstr("self-test"), HasSubstr(device["name"].get<std::string>()),
                                  HasSubstr("stopped working")));
}

TEST(CliDevices, ADriverThatAbortsIsListedAndTheRestWorks) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "vendors");
  std::ofstream(folder / "vendors/bad.icd")
      << (program_folder() / "fakes/fake_icd_abort.so").string() << "\n";
  const auto result = cli_with({"OCL_ICD_VENDORS=" + (folder / "vendors").string() + "/",
                                "PALPATE_CACHE_DIR=" + (folder / "cache").string(),
                                "PALPATE_PROBE=" + (program_folder() / "palpate-probe").string()},
                               {"devices", "--device", "reference", "--json"});
  EXPECT_EQ(result.signal, 0);
  EXPECT_EQ(result.exit_code, 0) << result.error;
  const auto object = nlohmann::json::parse(result.out, nullptr, false);
  ASSERT_TRUE(object.is_object()) << result.out;
  ASSERT_EQ(object["devices"].size(), 1U);
  EXPECT_FALSE(object["devices"][0]["usable"].get<bool>());
  EXPECT_THAT(object["devices"][0]["name"].get<std::string>(), HasSubstr("bad.icd"));
  EXPECT_THAT(object["devices"][0]["reason"].get<std::string>(), HasSubstr("SIGABRT"));
}

TEST(CliDevices, ADeviceThatIsLostInARunLeavesNothingHalfWritten) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device here";
  const TemporaryFolder folder;
  Words words{"simulate"};
  for (const auto& word : small_block()) words.push_back(word);
  for (const auto& word : Words{"--steps", "1000", "--step", "0.001", "-o", (folder / "points.vtp").string(),
                                "--surface", (folder / "surface.stl").string(), "--json"})
    words.push_back(word);
  const auto result = cli_with({"PALPATE_FAIL_AFTER_LAUNCHES=150"}, words);
  EXPECT_EQ(result.signal, 0);
  EXPECT_EQ(result.exit_code, 4);
  const auto object = nlohmann::json::parse(result.out, nullptr, false);
  ASSERT_TRUE(object.is_object()) << result.out;
  EXPECT_EQ(object["error"]["code"], "device-lost");
  EXPECT_THAT(object["error"]["text"].get<std::string>(), HasSubstr("reference"));
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace palpate::testing
