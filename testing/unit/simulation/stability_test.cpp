#include "palpate/simulation/stability.hpp"

#include "stability_model.hpp"

#include "palpate/simulation/solver.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace model = palpate::model;
namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;
using simulation::Parameters;

namespace {

Parameters undamped() {
  Parameters parameters;
  parameters.damping_per_s = 0.0;
  parameters.drag_per_s = 0.0;
  return parameters;
}

double true_omega2_over_k(const model::Tissue& tissue) {
  Parameters one = undamped();
  one.stiffness_per_s2 = 1.0;
  return testing_::dense_model(tissue, one).omega2();
}

}  // namespace

TEST(StableStep, IsExactOnLattices) {
  struct Case {
    int axes;
    double omega2_over_k;
  };
  for (const auto& [axes, expected] : {Case{1, 4.0}, Case{2, 12.0}, Case{3, 52.0 / 3.0}}) {
    // The true value, by Bloch waves of an endless lattice: the largest
    // eigenvalue of sum n n^T (1 - cos q.r) over the corners of the zone.
    double highest = 0.0;
    for (int corner = 1; corner < 8; ++corner) {
      Eigen::Matrix3d dynamical = Eigen::Matrix3d::Zero();
      for (int i = -1; i <= 1; ++i)
        for (int j = -1; j <= 1; ++j)
          for (int k = -1; k <= 1; ++k) {
            const int length2 = i * i + j * j + k * k;
            if (length2 == 0 || length2 > axes) continue;
            const int halves = i * (corner & 1) + j * ((corner >> 1) & 1) + k * ((corner >> 2) & 1);
            const Eigen::Vector3d r(i, j, k);
            dynamical += r * r.transpose() / length2 * (halves % 2 == 0 ? 0.0 : 2.0);
          }
      highest = std::max(highest, dynamical.selfadjointView<Eigen::Upper>().eigenvalues().maxCoeff());
    }
    EXPECT_NEAR(highest, expected, 1e-12);

    auto tissue = testing_::cube_points(5);
    testing_::link_lattice(tissue, axes);
    const auto bound = simulation::stable_step(tissue, undamped());
    // Sums of links are floats and rounded up by 4e-6; the closed form is good to
    // 1e-8 where the two largest eigenvalues coincide.
    EXPECT_NEAR(bound.omega_per_s * bound.omega_per_s / 10000.0, expected, 1e-5 * expected) << axes;
    // RK4 on the imaginary axis: |R(iy)| <= 1 up to y = 2 sqrt 2, found by halving to 1e-9.
    EXPECT_NEAR(bound.step_s, std::sqrt(8.0 / (expected * 10000.0)), 1e-5 * bound.step_s);
    if (axes > 1) {
      for (const int voxel : tissue.points.voxels[bound.worst_point]) {
        EXPECT_GT(voxel, 0);
        EXPECT_LT(voxel, 4);
      }
    }
  }
}

TEST(StableStep, StretchingStiffens) {
  // Stretched to twice its rest: S = k [sum n n^T + (1/2) sum (I - n n^T)] = k (2 + 4/2) I for six links.
  auto tissue = testing_::cube_points(5);
  testing_::link_lattice(tissue, 1);
  auto stretched = tissue.points.positions_mm;
  for (auto& x : stretched) x *= 2.0F;
  const auto bound = simulation::stable_step(tissue, undamped(), {&stretched});
  EXPECT_NEAR(bound.omega_per_s * bound.omega_per_s, 2.0 * 4.0 * 10000.0, 1e-5 * 8.0e4);
  // Compressed links do not stiffen, and the direction is the same.
  for (auto& x : stretched) x /= 4.0F;
  const auto compressed = simulation::stable_step(tissue, undamped(), {&stretched});
  EXPECT_NEAR(compressed.omega_per_s * compressed.omega_per_s, 4.0 * 10000.0,
              1e-5 * 4.0e4);  // as on lattices
}

TEST(StableStep, IsSafeAndNearTheTrueLimitOnRandomModels) {
  const auto models = static_cast<std::uint32_t>(testing_::repetitions(4, 50));
  for (std::uint32_t seed = 1; seed <= models; ++seed) {
    const auto tissue = testing_::random_model(300, seed);
    const auto bound = simulation::stable_step(*tissue, undamped());
    const double true_omega = std::sqrt(10000.0 * true_omega2_over_k(*tissue));
    const double share = true_omega / bound.omega_per_s;  // of the steps, bound over true
    EXPECT_GE(share, 0.70) << "seed " << seed;
    EXPECT_LE(share, 1.00) << "seed " << seed;
  }
}

TEST(StableStep, TheTrueLimitIsWhereRunsBlowUp) {
  const auto tissue = testing_::random_model(300, 1);
  const double limit = 2.828 / std::sqrt(10000.0 * true_omega2_over_k(*tissue));
  // Undamped, 3 % over the limit the highest mode grows by a fifth a step.
  EXPECT_LT(testing_::growth(tissue, undamped(), 0.97 * limit, 300), 5.0);
  EXPECT_GT(testing_::growth(tissue, undamped(), 1.03 * limit, 300), 1000.0);
}

TEST(StableStep, HoldsForEveryDamping) {
  const auto tissue = testing_::random_model(200, 5);
  for (const double damping : {0.0, 3.0, 60.0, 150.0, 1000.0}) {
    Parameters parameters;
    parameters.damping_per_s = damping;
    const double step = simulation::stable_step(*tissue, parameters).step_s;
    EXPECT_LT(testing_::growth(tissue, parameters, step, 300), 5.0) << "c = " << damping;
    const double limit = simulation::estimated_stable_step(*tissue, parameters).step_s;
    EXPECT_LT(testing_::growth(tissue, parameters, limit, 300), 5.0) << "c = " << damping;
    // The estimate is within a tenth of the true limit; 3 % beyond that nothing holds for 300 steps.
    EXPECT_GT(testing_::growth(tissue, parameters, 1.03 / 0.9 * limit, 300), 1000.0) << "c = " << damping;
  }
}

TEST(StableStep, NamesThePointThatLimitsIt) {
  auto tissue = testing_::cube_points(3);
  testing_::link_lattice(tissue, 1);
  const std::uint32_t hub = 13;  // the middle: link it to all others
  std::set<std::array<std::uint32_t, 2>> pairs(tissue.links.pairs.begin(), tissue.links.pairs.end());
  for (std::uint32_t other = 0; other < 27; ++other)
    if (other != hub) pairs.insert({std::min(hub, other), std::max(hub, other)});
  testing_::set_links(tissue, pairs);
  EXPECT_EQ(simulation::stable_step(tissue, undamped()).worst_point, hub);
  Parameters overdamped;
  overdamped.damping_per_s = 1e5;
  EXPECT_EQ(simulation::stable_step(tissue, overdamped).worst_point, hub);
}

TEST(StableStep, ManyThreadsFindWhatOneFinds) {
  // 64,000 points: several threads. The blocks of a lattice are alike, one point is not.
  auto tissue = testing_::cube_points(40);
  std::set<std::array<std::uint32_t, 2>> pairs;
  for (std::uint32_t a = 0; a + 1 < tissue.points.size(); ++a)
    if (a % 40 != 39) pairs.insert({a, a + 1});
  const std::uint32_t odd_one = 50021;
  pairs.insert({odd_one, odd_one + 2});
  testing_::set_links(tissue, pairs);
  const auto bound = simulation::stable_step(tissue, undamped());
  EXPECT_EQ(bound.worst_point, odd_one);
  EXPECT_NEAR(bound.omega_per_s * bound.omega_per_s, 2.0 * 3.0 * 10000.0, 1e-5 * 6.0e4);
}

TEST(StableStep, WithNothingStiffThereIsNoLimit) {
  const auto loose = testing_::loose_points({{0, 0, 0}, {1, 0, 0}});
  const auto bound = simulation::stable_step(*loose, undamped());
  EXPECT_TRUE(std::isinf(bound.step_s));
  EXPECT_EQ(bound.omega_per_s, 0.0);
  EXPECT_EQ(simulation::automatic_step_s(bound), 0.02);
  EXPECT_DOUBLE_EQ(simulation::automatic_step_s({0.01, 0.0, 0}), 0.009);
  // A scheme without a limit takes the thesis' own step, of tissue that is stiff.
  EXPECT_EQ(simulation::automatic_step_s({INFINITY, 300.0, 0}), 0.006);
  Parameters dragged = undamped();
  dragged.drag_per_s = 1000.0;
  EXPECT_NEAR(simulation::stable_step(*loose, dragged).step_s, 2.785 / 1000.0, 1e-6);
}
