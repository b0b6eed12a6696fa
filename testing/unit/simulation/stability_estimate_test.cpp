#include "stability_limits.hpp"
#include "stability_model.hpp"

#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

namespace model = palpate::model;
namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::Integrator;
using simulation::Material;
using simulation::Parameters;
using simulation::StabilityCase;

namespace {

const std::vector<Integrator> with_a_limit{Integrator::euler, Integrator::symplectic_euler,
                                           Integrator::verlet, Integrator::velocity_verlet, Integrator::rk4};

struct Ratios {
  double least = INFINITY, most = 0.0, sum = 0.0;
  int count = 0;
  void add(double ratio) {
    least = std::min(least, ratio);
    most = std::max(most, ratio);
    sum += ratio;
    ++count;
  }
};
std::ostream& operator<<(std::ostream& out, const Ratios& r) {
  return out << "min " << r.least << ", mean " << r.sum / r.count << ", max " << r.most << " of " << r.count;
}

/// Estimate over true value, in omega^2: never below 1, and above by the stated margin at most.
double excess(const model::Tissue& tissue, const Parameters& parameters, const StabilityCase& at = {}) {
  const auto stable = simulation::estimated_stable_step(tissue, parameters, at);
  EXPECT_TRUE(stable.is_estimate);
  return stable.omega_per_s * stable.omega_per_s / testing_::dense_model(tissue, parameters, at).omega2();
}

/// The limit of the linear model by its dense amplification matrix.
double linear_limit(Integrator scheme, const testing_::DenseModel& dense, double near) {
  double calm = 0.0;
  double wild = 4.0 * near;
  // Rigid motions have the double eigenvalue 1, which Eigen finds to the root of the rounding, 1e-7.
  while (wild - calm > 1e-3 * near) {
    const double h = 0.5 * (calm + wild);
    const bool grows =
        testing_::spectral_radius(testing_::amplification(scheme, dense.a, dense.b, h)) > 1.0 + 1e-6;
    (grows ? wild : calm) = h;
  }
  return calm;
}

Material uneven(std::size_t points, std::uint32_t seed) {
  testing_::Numbers numbers(seed);
  Material material;
  for (std::size_t n = 0; n < points; ++n)
    material.factors.push_back(static_cast<float>(numbers.between(0.3, 2.0)));
  return material;
}

}  // namespace

TEST(StabilityLimits, EveryModeTurnsAtItsLimit) {
  // One mode of omega = 7: at 0.999 of the limit nothing grows, at 1.001 it does.
  const double omega = 7.0;
  for (const Integrator scheme : with_a_limit)
    for (const double zeta :
         {0.0, 0.01, 0.1, 0.25, 0.2887, 0.4, 0.5, 0.54, 0.6, 0.9, 0.999, 1.001, 1.5, 4.0, 50.0}) {
      const double b = 2.0 * zeta * omega;
      const double limit = simulation::limit_of_mode(scheme, omega * omega, b);
      if (scheme == Integrator::euler && zeta == 0.0) {
        EXPECT_EQ(limit, 0.0);
        continue;
      }
      const auto radius = [&](double h) {
        return testing_::spectral_radius(testing_::amplification(
            scheme, Eigen::MatrixXd::Constant(1, 1, omega * omega), Eigen::MatrixXd::Constant(1, 1, b), h));
      };
      // Undamped schemes stand on the circle: 1e-9 is the rounding of a double eigenvalue's neighbourhood.
      EXPECT_LE(radius(0.999 * limit), 1.0 + 1e-9) << to_string(scheme) << " zeta " << zeta;
      EXPECT_GT(radius(1.001 * limit), 1.0 + 1e-8) << to_string(scheme) << " zeta " << zeta;
    }
}

TEST(StabilityLimits, StatedConstants) {
  using simulation::limit_of_mode;
  EXPECT_NEAR(limit_of_mode(Integrator::rk4, 1.0, 0.0), std::sqrt(8.0), 1e-6);
  EXPECT_NEAR(limit_of_mode(Integrator::rk4, 1.0, 2.0 * 0.54), 2.616, 1e-3);
  EXPECT_NEAR(limit_of_mode(Integrator::rk4, 0.0, 1.0), 2.7853, 1e-4);
  EXPECT_DOUBLE_EQ(limit_of_mode(Integrator::verlet, 1.0, 0.0), 2.0);
  EXPECT_DOUBLE_EQ(limit_of_mode(Integrator::velocity_verlet, 1.0, 0.0), 2.0);
  // The worst of velocity Verlet: zeta = 1/sqrt(12), sqrt(3)/omega.
  EXPECT_NEAR(limit_of_mode(Integrator::velocity_verlet, 1.0, 2.0 / std::sqrt(12.0)), std::sqrt(3.0), 1e-12);
  EXPECT_EQ(limit_of_mode(Integrator::implicit_euler, 1e12, 1e6), INFINITY);
  EXPECT_EQ(limit_of_mode(Integrator::rk4, 0.0, 0.0), INFINITY);
}

TEST(StableStepEstimate, IsNeverBelowTheTrueEigenvalueAndAboveByItsMargin) {
  Ratios ratios;
  const auto models = static_cast<std::uint32_t>(testing_::repetitions(5, 50));
  for (std::uint32_t seed = 1; seed <= models; ++seed)
    ratios.add(excess(*testing_::random_model(300, seed), Parameters()));
  for (const int axes : {1, 2, 3}) {
    auto lattice = testing_::cube_points(6);
    testing_::link_lattice(lattice, axes);
    ratios.add(excess(lattice, Parameters()));
  }
  ratios.add(excess(*testing_::cube_tissue(7), Parameters()));
  std::cout << "omega^2, estimate over dense: " << ratios << "\n";
  EXPECT_GE(ratios.least, 1.0);
  EXPECT_LE(ratios.most, 1.026);  // the margin, and rounding of float vectors
}

TEST(StableStepEstimate, SeesStretchCutsMassesAndFactors) {
  const auto tissue = testing_::random_model(200, 3);
  auto stretched = tissue->points.positions_mm;
  for (auto& x : stretched) x = x.cwiseProduct(Eigen::Vector3f(1.6F, 1.1F, 1.2F));
  StabilityCase at;
  at.positions_mm = &stretched;
  // No link is shorter than at rest, so that the estimate's matrix is the true one.
  const double by_stretch = excess(*tissue, Parameters(), at);
  EXPECT_GE(by_stretch, 1.0);
  EXPECT_LE(by_stretch, 1.026);

  std::vector<std::uint8_t> alive(tissue->links.size(), 1);
  for (std::size_t n = 0; n < alive.size(); n += 3) alive[n] = 0;
  StabilityCase cut;
  cut.link_alive = &alive;
  EXPECT_GE(excess(*tissue, Parameters(), cut), 1.0);
  EXPECT_LE(excess(*tissue, Parameters(), cut), 1.026);
  EXPECT_LT(simulation::estimated_stable_step(*tissue, Parameters(), cut).omega_per_s,
            simulation::estimated_stable_step(*tissue, Parameters()).omega_per_s);

  Material material = uneven(tissue->points.size(), 8);
  for (int scaled = 1; scaled < 16; ++scaled) {
    material.scales_stiffness = (scaled & 1) != 0;
    material.scales_damping = (scaled & 2) != 0;
    material.scales_drag = (scaled & 4) != 0;
    material.scales_mass = (scaled & 8) != 0;
    Parameters parameters;
    parameters.mass = 2.5;
    StabilityCase with;
    with.material = &material;
    const double e = excess(*tissue, parameters, with);
    EXPECT_GE(e, 1.0) << scaled;
    EXPECT_LE(e, 1.026) << scaled;
    const auto stable = simulation::estimated_stable_step(*tissue, parameters, with);
    EXPECT_GE(stable.decay_per_s, testing_::dense_model(*tissue, parameters, with).decay() * (1.0 - 1e-6))
        << scaled;
  }
}

TEST(StableStepEstimate, ARestLengthOfZeroIsACut) {
  const auto tissue = testing_::random_model(150, 4);
  model::Tissue cut = *tissue;
  std::vector<std::uint8_t> alive(tissue->links.size(), 1);
  for (std::size_t n = 0; n < alive.size(); n += 2) {
    alive[n] = 0;
    cut.links.rest_lengths_mm[n] = 0.0F;
  }
  StabilityCase at;
  at.link_alive = &alive;
  EXPECT_EQ(simulation::stable_step(cut, Parameters()).step_s,
            simulation::stable_step(*tissue, Parameters(), at).step_s);
  EXPECT_EQ(simulation::estimated_stable_step(cut, Parameters()).step_s,
            simulation::estimated_stable_step(*tissue, Parameters(), at).step_s);
}

TEST(StableStepEstimate, TheShortestRestLengthsOfABeatCount) {
  const auto tissue = testing_::random_model(150, 4);
  Parameters beating;
  beating.beat_amplitude = 0.3;
  model::Tissue shortest = *tissue;
  for (auto& length : shortest.links.rest_lengths_mm) length *= 0.7F;
  EXPECT_NEAR(simulation::stable_step(*tissue, beating).omega_per_s,
              simulation::stable_step(shortest, Parameters()).omega_per_s,
              1e-6 * simulation::stable_step(shortest, Parameters()).omega_per_s);
}

TEST(StableStepEstimate, ASmallOddPlaceInALargeTissueIsNotMissed) {
  // One point of 27,000 is linked to twenty more: its mode is its own, and far above the others.
  auto tissue = testing_::cube_points(30, 0.05);
  std::set<std::array<std::uint32_t, 2>> pairs;
  for (std::uint32_t a = 0; a < tissue.points.size(); ++a)
    for (const std::uint32_t step : {1U, 30U, 900U})
      if (tissue.points.voxels[a][step == 1 ? 0 : (step == 30 ? 1 : 2)] < 29) pairs.insert({a, a + step});
  const std::uint32_t odd = 13 * 900 + 13 * 30 + 13;
  for (std::uint32_t n = 1; n <= 20; ++n) pairs.insert({odd, odd + 31 * n});
  testing_::set_links(tissue, pairs);
  const auto stable = simulation::estimated_stable_step(tissue, Parameters());
  EXPECT_EQ(stable.worst_point, odd);
  // Its links' directions are alike (i + j): lambda is at least k times their number.
  EXPECT_GT(stable.omega_per_s * stable.omega_per_s, 10000.0 * 20.0);
}

TEST(StableStepEstimate, TheModeOfTheLastCallShortensTheNextAndFindsTheSame) {
  const auto tissue = testing_::random_model(300, 2);
  std::vector<float> mode;
  const auto first = simulation::estimated_stable_step(*tissue, Parameters(), {}, {}, &mode);
  EXPECT_EQ(mode.size(), 3 * tissue->points.size());
  const auto again = simulation::estimated_stable_step(*tissue, Parameters(), {}, {}, &mode);
  // Both are within the margin above the true one.
  EXPECT_NEAR(again.omega_per_s, first.omega_per_s, 0.0125 * first.omega_per_s);
}

TEST(StableStepEstimate, CanBeCancelled) {
  const palpate::core::CancelToken cancel;
  cancel.cancel();
  EXPECT_THROW(simulation::estimated_stable_step(*testing_::cube_tissue(4), Parameters(), {},
                                                 palpate::core::Progress({}, cancel)),
               palpate::core::Error);
}

TEST(StableStepEstimate, HoldsForTheLinearModelOfEveryScheme) {
  // Dense amplification matrices of 24 points: with the dampers' c/k alike and
  // not, and with drag that is not of the masses.
  const auto tissue = testing_::random_model(24, 6);
  for (const Integrator scheme : with_a_limit) {
    Ratios alike;
    Ratios not_alike;
    for (const double damping : {3.0, 40.0, 400.0})
      for (const bool scaled : {false, true}) {
        Parameters parameters;
        parameters.integrator = scheme;
        parameters.damping_per_s = damping;
        parameters.drag_per_s = 2.0;
        Material material = uneven(tissue->points.size(), 9);
        material.scales_damping = material.scales_mass = scaled;
        StabilityCase at;
        at.material = &material;
        const double step = simulation::estimated_stable_step(*tissue, parameters, at).step_s;
        const double bound = simulation::stable_step(*tissue, parameters, at).step_s;
        const double limit = linear_limit(scheme, testing_::dense_model(*tissue, parameters, at), step);
        (scaled ? not_alike : alike).add(step / limit);
        EXPECT_LE(bound, step * 1.0001);
      }
    std::cout << to_string(scheme) << ", predicted over linear limit: " << alike
              << "; uneven c/k: " << not_alike << "\n";
    EXPECT_GE(alike.least, 0.90) << to_string(scheme);
    EXPECT_LE(alike.most, 1.0 + 1e-3) << to_string(scheme);
    EXPECT_LE(not_alike.most, 1.0 + 1e-3) << to_string(scheme);
  }
}

TEST(StableStepEstimate, IsWithinATenthOfMeasuredThresholds) {
  Ratios estimates;
  Ratios bounds;
  const auto models = static_cast<std::uint32_t>(testing_::repetitions(3, 50));
  for (std::uint32_t seed = 1; seed <= models; ++seed) {
    const auto tissue = testing_::random_model(300, 100 + seed);
    Parameters parameters;  // k, c and D as the thesis has them, and around
    testing_::Numbers numbers(seed);
    parameters.stiffness_per_s2 = std::pow(10.0, numbers.between(2.0, 6.0));
    parameters.damping_per_s = numbers.between(0.0, 6.0);
    const double step = simulation::estimated_stable_step(*tissue, parameters).step_s;
    const double limit = testing_::measured_limit(tissue, parameters, step);
    estimates.add(step / limit);
    bounds.add(simulation::stable_step(*tissue, parameters).step_s / limit);
  }
  std::cout << "RK4, predicted over measured: " << estimates << "; bound: " << bounds << "\n";
  EXPECT_GE(estimates.least, 0.90);
  EXPECT_LE(estimates.most, 1.00);
  EXPECT_GE(bounds.least, 0.70);
  EXPECT_LE(bounds.most, 1.00);
}

TEST(StableStepEstimate, IsWithinATenthOfMeasuredThresholdsOfEveryScheme) {
  const auto models = static_cast<std::uint32_t>(testing_::repetitions(1, 8));
  for (const Integrator scheme : with_a_limit) {
    Ratios ratios;
    for (std::uint32_t seed = 1; seed <= models; ++seed) {
      const auto tissue = testing_::random_model(200, 200 + seed);
      Parameters parameters;
      parameters.integrator = scheme;
      // Explicit Euler's runs grow by a ten-thousandth a step unless they are well damped.
      if (scheme == Integrator::euler) parameters.damping_per_s = 40.0;
      const double step = simulation::estimated_stable_step(*tissue, parameters).step_s;
      ratios.add(step / testing_::measured_limit(tissue, parameters, step));
    }
    std::cout << to_string(scheme) << ", predicted over measured: " << ratios << "\n";
    EXPECT_GE(ratios.least, 0.90) << to_string(scheme);
    EXPECT_LE(ratios.most, 1.00) << to_string(scheme);
  }
}
