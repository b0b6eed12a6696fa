#include "cli_support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace palpate::testing {
namespace {

using ::testing::HasSubstr;

// On the reference, so that it runs where there is no device too.
TEST(CliBench, GivesItsFiguresAsTheContractSays) {
  const auto object = cli_json({"bench", "--quick", "--device", "reference", "--case", "gaussian-58x100x58"});
  for (const char* const key : {"device", "driver", "cpu_flags", "triad_gb_s", "cases", "mapping", "imaging"})
    EXPECT_TRUE(object.contains(key)) << key;
  EXPECT_EQ(object["device"], "reference");
  EXPECT_GT(object["triad_gb_s"].get<double>(), 0.0);
  EXPECT_TRUE(object["cases"].empty());
  ASSERT_EQ(object["imaging"].size(), 1U);
  const auto& figure = object["imaging"][0];
  EXPECT_EQ(figure["name"], "gaussian-58x100x58");
  EXPECT_EQ(figure["voxels"], 58 * 100 * 58);
  EXPECT_GT(figure["seconds"].get<double>(), 0.0);
  EXPECT_FALSE(figure["baseline"].get<std::string>().empty());
  EXPECT_DOUBLE_EQ(figure["ratio"].get<double>(),
                   figure["seconds"].get<double>() / figure["baseline_seconds"].get<double>());
}

TEST(CliBench, SetsTheEngineBesideThePublishedLayout) {
  if (!opencl_present()) GTEST_SKIP() << "There is no OpenCL device.";
  const auto object = cli_json({"bench", "--quick", "--case", "jittered-20k"});
  ASSERT_EQ(object["cases"].size(), 1U);
  const auto& figure = object["cases"][0];
  EXPECT_EQ(figure["points"], 27 * 27 * 27);
  EXPECT_EQ(figure["integrator"], "rk4");
  EXPECT_GT(figure["links"].get<double>(), 4.0 * 27 * 27 * 27);  // some ten a point, each counted once
  const double ms = figure["ms_per_step"].get<double>();
  EXPECT_GT(ms, 0.0);
  EXPECT_NEAR(figure["speedup"].get<double>(), figure["baseline_ms_per_step"].get<double>() / ms, 1e-9 * ms);
  EXPECT_NEAR(figure["link_evaluations_per_s"].get<double>(),
              8.0 * figure["links"].get<double>() / (ms / 1000.0), 1.0);
  // Two ways to the same positions, ten steps of rounding at 13 mm: 1e-6 mm each
  // time, and rest lengths that may be kept in 16 bits (2e-5 of a link).
  EXPECT_LT(figure["max_difference_mm"].get<double>(), 1e-4);
  for (const char* const key : {"runs", "repeated_runs", "disturbed_runs", "core_round_trip_ns", "layout",
                                "bytes_per_step", "bandwidth_fraction", "realtime_factor", "build_s",
                                "device_bytes_per_point", "baseline_bytes_per_point", "compared_with"})
    EXPECT_TRUE(figure.contains(key)) << key;
}

TEST(CliBench, SaysHowFarTheProcessorsWereApart) {
  if (!opencl_present()) GTEST_SKIP() << "There is no OpenCL device.";
  const auto figure = cli_json({"bench", "--quick", "--case", "lattice18-20k-verlet"})["cases"][0];
  EXPECT_EQ(figure["repeated_runs"], 0) << "a quick bench waits for nothing";
  if (figure["core_round_trip_ns"].is_null()) GTEST_SKIP() << "one processor, or no processor is the device";
  const double ns = figure["core_round_trip_ns"].get<double>();
  EXPECT_GT(ns, 5.0) << "faster than any cache";
  EXPECT_EQ(figure["disturbed_runs"].get<int>() > 0, ns > 150.0);
}

TEST(CliBench, RefusesWhatItCannotMeasure) {
  const auto wrong = cli({"bench", "--case", "everything"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.error, HasSubstr("adaptive-116x200x117"));
  const auto no_device = cli({"bench", "--device", "reference", "--case", "jittered-20k"});
  EXPECT_EQ(no_device.exit_code, 2);
  EXPECT_THAT(no_device.error, HasSubstr("OpenCL device"));
  const auto one_of_two =
      cli({"bench", "--device", "reference", "--case", "gaussian-58x100x58", "--case", "jittered-20k"});
  EXPECT_EQ(one_of_two.exit_code, 2) << "what was asked for is not left out in silence";
}

}  // namespace
}  // namespace palpate::testing
