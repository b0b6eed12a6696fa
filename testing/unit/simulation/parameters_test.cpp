#include "palpate/simulation/parameters.hpp"

#include "palpate/core/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace simulation = palpate::simulation;

TEST(Parameters, ThoseOfTheThesisAreTheDefault) {
  const simulation::Parameters parameters;
  EXPECT_NO_THROW(simulation::check(parameters));
  EXPECT_EQ(parameters.stiffness_per_s2, 10000.0);
  EXPECT_EQ(parameters.damping_per_s, 3.0);
  EXPECT_EQ(simulation::to_string(parameters.integrator), "rk4");
}

TEST(Parameters, WhatIsOutOfRangeIsNamedWithItsRange) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Case {
    const char* word;
    std::function<void(simulation::Parameters&, double)> set;
    std::vector<double> wrong;
    std::vector<double> right;
  };
  const std::vector<Case> cases{
      {"stiffness", [](auto& p, double v) { p.stiffness_per_s2 = v; }, {-1.0, 1.1e9, nan}, {0.0, 1e9}},
      {"damping", [](auto& p, double v) { p.damping_per_s = v; }, {-0.1, 1.1e6, nan}, {0.0, 1e6}},
      {"drag", [](auto& p, double v) { p.drag_per_s = v; }, {-0.1, 1.1e4, nan}, {0.0, 1e4}},
      {"Gravity", [](auto& p, double v) { p.gravity_mm_per_s2.y() = v; }, {-2e6, 2e6, nan}, {-9810.0}},
  };
  for (const auto& [word, set, wrong, right] : cases) {
    for (const double value : right) {
      simulation::Parameters parameters;
      set(parameters, value);
      EXPECT_NO_THROW(simulation::check(parameters)) << word << " " << value;
    }
    for (const double value : wrong) {
      simulation::Parameters parameters;
      set(parameters, value);
      try {
        simulation::check(parameters);
        ADD_FAILURE() << word << " " << value << " must be refused";
      } catch (const palpate::core::Error& error) {
        EXPECT_EQ(error.exit_code(), 2);
        EXPECT_THAT(error.what(),
                    ::testing::AllOf(::testing::HasSubstr(word), ::testing::HasSubstr("between")));
      }
    }
  }
}
