#include "palpate/imaging/filters.hpp"

#include <gtest/gtest.h>

TEST(Filters, ThereAreMedianAndGaussian) {
  const auto& all = palpate::imaging::filters();
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].name, "median");
  EXPECT_EQ(all[1].name, "gaussian");
}
