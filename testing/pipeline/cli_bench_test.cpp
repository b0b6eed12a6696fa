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

TEST(CliBench, RefusesCasesThatAreNotThere) {
  const auto later = cli({"bench", "--case", "heart-708k"});
  EXPECT_EQ(later.exit_code, 2);
  EXPECT_THAT(later.error, HasSubstr("yet"));
  const auto wrong = cli({"bench", "--case", "everything"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.error, HasSubstr("adaptive-116x200x117"));
}

}  // namespace
}  // namespace palpate::testing
