// kernels/published.cl, the layout that the bench compares with, against the
// reference solver: a baseline that computed something else would flatter us.
#include "palpate/simulation/published.hpp"

#include "device_test.hpp"

#include "palpate/core/error.hpp"
#include "palpate/simulation/stability.hpp"
#include "palpate/testing/cube_tissue.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace simulation = palpate::simulation;
namespace testing_ = palpate::testing;

namespace {
class Published : public testing_::DeviceTest {};
}  // namespace

TEST_F(Published, MovesAsTheReferenceDoes) {
  const auto tissue = testing_::cube_tissue(8);
  const simulation::Parameters parameters;
  simulation::PublishedSimulation published(device(), *tissue, parameters);
  const auto reference = simulation::make_reference_solver(tissue, parameters);
  simulation::State state = reference->state();
  testing_::Numbers numbers(5);
  for (auto& v : state.velocities_mm_per_s) v = numbers.vector(30.0);
  published.set_state(state);
  reference->set_state(state);
  const double h = simulation::automatic_step_s(simulation::stable_step(*tissue, parameters));
  published.step(50, h);
  reference->step(50, h);
  const auto moved = published.state();
  const auto expected = reference->state();
  float furthest = 0.0F;
  float farthest_from_rest = 0.0F;
  for (std::size_t n = 0; n < expected.positions_mm.size(); ++n) {
    furthest = std::max(furthest, (moved.positions_mm[n] - expected.positions_mm[n]).norm());
    farthest_from_rest =
        std::max(farthest_from_rest, (expected.positions_mm[n] - state.positions_mm[n]).norm());
  }
  // Coordinates of up to 4 mm in float round to 2.4e-7 mm, twice a step and
  // fed back through k h^2 of order one: some hundred roundings of it.
  EXPECT_LT(furthest, 1e-4F);
  EXPECT_GT(farthest_from_rest, 0.1F);
  EXPECT_DOUBLE_EQ(moved.time_s, 50 * h);
}

TEST_F(Published, TakesTheBytesThatItsStructsHave) {
  const auto tissue = testing_::cube_tissue(3, 6);
  std::vector<std::size_t> links(tissue->points.size(), 0);
  for (const auto& pair : tissue->links.pairs)
    for (const auto end : pair) ++links[end];
  const std::size_t most = *std::max_element(links.begin(), links.end());
  const std::size_t point_bytes = (40 + 8 * most + 15) / 16 * 16;
  const simulation::PublishedSimulation published(device(), *tissue, {});
  EXPECT_EQ(published.bytes(), tissue->points.size() * (point_bytes + 4 * 32));
}

TEST_F(Published, RefusesWhatItsKernelsDoNotKnow) {
  simulation::Parameters falling;
  falling.gravity_mm_per_s2 = {0, 0, -9810};
  EXPECT_THROW(simulation::PublishedSimulation(device(), *testing_::cube_tissue(2), falling),
               palpate::core::Error);
}
