#include "palpate/simulation/parameters.hpp"

#include "palpate/core/error.hpp"
#include "palpate/simulation/solver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
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
      {"mass", [](auto& p, double v) { p.mass = v; }, {0.0, 9e-4, 1001.0, nan}, {1e-3, 1e3}},
      {"period", [](auto& p, double v) { p.beat_period_s = v; }, {0.0, 0.04, 61.0, nan}, {0.05, 60.0}},
      {"amplitude", [](auto& p, double v) { p.beat_amplitude = v; }, {-0.1, 0.51, nan}, {0.0, 0.5}},
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

TEST(Parameters, ABeatShortensByItsAmplitudeInTheMiddleOfItsPeriod) {
  simulation::Parameters parameters;
  EXPECT_EQ(simulation::rest_scale_at(parameters, 0.3), 1.0);
  parameters.beat_amplitude = 0.2;
  parameters.beat_period_s = 0.8;
  EXPECT_EQ(simulation::rest_scale_at(parameters, 0.0), 1.0);
  EXPECT_NEAR(simulation::rest_scale_at(parameters, 0.4), 0.8, 1e-15);  // rounding of the sine
  EXPECT_NEAR(simulation::rest_scale_at(parameters, 0.2), 0.9, 1e-15);
  EXPECT_NEAR(simulation::rest_scale_at(parameters, 8.0), 1.0, 1e-15);
}

TEST(Parameters, IntegratorsAndLayoutsAreNamed) {
  EXPECT_EQ(simulation::all_integrators().size(), 6U);
  for (const auto integrator : simulation::all_integrators())
    EXPECT_EQ(simulation::integrator_of(simulation::to_string(integrator)), integrator);
  for (const auto layout : {simulation::LayoutChoice::automatic, simulation::LayoutChoice::lattice,
                            simulation::LayoutChoice::explicit_links})
    EXPECT_EQ(simulation::layout_of(simulation::to_string(layout)), layout);
  const auto message_of = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const palpate::core::Error& error) {
      return error.exit_code() == 2 ? error.what() : "";
    }
    return {};
  };
  EXPECT_THAT(message_of([] { simulation::integrator_of("leapfrog"); }),
              ::testing::AllOf(::testing::HasSubstr("leapfrog"), ::testing::HasSubstr("velocity-verlet")));
  EXPECT_THAT(message_of([] { simulation::layout_of("planar"); }),
              ::testing::AllOf(::testing::HasSubstr("planar"), ::testing::HasSubstr("lattice")));
}

TEST(Material, FitsThePointsAndItsFactorsAreAboveZero) {
  simulation::Material material;
  EXPECT_NO_THROW(simulation::check(material, 3));
  EXPECT_FALSE(material.is_scaled());
  material.factors = {1.0F, 0.5F, 2.0F};
  material.anchors = {2, 0};
  EXPECT_FALSE(material.is_scaled()) << "nothing is said to be scaled";
  material.scales_mass = true;
  EXPECT_TRUE(material.is_scaled());
  EXPECT_NO_THROW(simulation::check(material, 3));
  EXPECT_THROW(simulation::check(material, 4), palpate::core::Error);
  for (const float wrong : {0.0F, -1.0F, std::numeric_limits<float>::infinity(), std::nanf("")}) {
    auto broken = material;
    broken.factors[1] = wrong;
    EXPECT_THROW(simulation::check(broken, 3), palpate::core::Error) << wrong;
  }
  material.anchors = {3};
  EXPECT_THROW(simulation::check(material, 3), palpate::core::Error);
}
