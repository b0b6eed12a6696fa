// Runs of parameter sets drawn from all that the window and the command line
// offer, with gestures, on small tissues: nearly all must reach their end without a
// rollback, none may pause, and every state must be finite.
#include "tissue_for_tests.hpp"

#include "palpate/compute/device.hpp"
#include "palpate/core/error.hpp"
#include "palpate/session/pipeline.hpp"
#include "palpate/testing/cube_tissue.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <sstream>

namespace model = palpate::model;
namespace session = palpate::session;
namespace simulation = palpate::simulation;
using palpate::testing::Numbers;

namespace {

/// Draws; every one from the same seed.
class Dice {
 public:
  explicit Dice(std::uint32_t seed) : numbers_(seed) {
    for (int n = 0; n < 8; ++n) numbers_.between(0.0, 1.0);  // neighbouring seeds begin alike
  }
  double between(double low, double high) { return numbers_.between(low, high); }
  double by_magnitude(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  int whole(int low, int high) { return low + static_cast<int>(between(0.0, high - low + 1.0)); }
  bool chance(double share) { return between(0.0, 1.0) < share; }

 private:
  Numbers numbers_;
};

struct Case {
  session::BuiltTissue tissue;
  session::Recipe recipe;
  session::RunRequest request;
  double size_mm = 0.0;
};

/// A block or a ball of voxels whose intensities differ, 1 mm apart.
palpate::core::Volume volume_of(Dice& dice, int side) {
  const double corner = -0.5 * (side - 1);
  const palpate::core::ImageGeometry geometry({side, side, side}, Eigen::Vector3d::Ones(),
                                              {corner, corner, corner});
  const bool is_ball = dice.chance(0.4);
  std::vector<float> values;
  for (int k = 0; k < side; ++k)
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) {
        const bool inside =
            !is_ball || Eigen::Vector3d(i + corner, j + corner, k + corner).norm() <= 0.5 * side;
        values.push_back(inside ? static_cast<float>(dice.between(60.0, 200.0)) : 0.0F);
      }
  return {geometry, std::move(values)};
}

void draw_tissue(Dice& dice, model::TissueParameters& tissue) {
  tissue.threshold_low = 50.0;
  tissue.noise = dice.chance(0.5) ? 0.1 : dice.between(0.0, 0.5);
  tissue.seed = static_cast<std::uint64_t>(dice.whole(1, 1000));
  const int rule = dice.whole(0, 5);
  tissue.links = rule == 0   ? model::LinkRule::six
                 : rule == 1 ? model::LinkRule::lattice18
                 : rule == 2 ? model::LinkRule::lattice26
                             : model::LinkRule::nearest;
  tissue.max_links = dice.chance(0.3) ? 12 : dice.whole(1, 26);
  if (tissue.links == model::LinkRule::nearest && dice.chance(0.2))
    tissue.points = model::PointRule::blue_noise;
}

void draw_physics(Dice& dice, simulation::Parameters& p) {
  p.stiffness_per_s2 = dice.chance(0.8) ? dice.by_magnitude(1.0, 1e6) : dice.by_magnitude(1e6, 1e9);
  p.damping_per_s = dice.chance(0.1)   ? 0.0
                    : dice.chance(0.8) ? dice.by_magnitude(0.01, 100.0)
                                       : dice.by_magnitude(100.0, 1e6);
  p.drag_per_s = dice.chance(0.2)   ? 0.0
                 : dice.chance(0.8) ? dice.by_magnitude(0.01, 10.0)
                                    : dice.by_magnitude(10.0, 1e4);
  p.mass = dice.chance(0.6) ? 1.0 : dice.by_magnitude(1e-3, 1e3);
  if (dice.chance(0.25)) {
    p.beat_period_s = dice.by_magnitude(0.05, 60.0);
    p.beat_amplitude = dice.between(0.0, 0.5);
  }
  if (dice.chance(0.5))
    p.gravity_mm_per_s2[dice.whole(0, 2)] = -(dice.chance(0.6) ? 9810.0 : dice.by_magnitude(1.0, 1e5));
  p.integrator = simulation::all_integrators()[static_cast<std::size_t>(
      dice.whole(0, static_cast<int>(simulation::all_integrators().size()) - 1))];
}

/// Takes the tissue from above and drags it about, fast, then lets go before the end.
palpate::interaction::Gesture draw_gesture(Dice& dice, double seconds, double size_mm) {
  auto gesture = palpate::testing::pull(dice.between(-0.7, 0.7) * size_mm, 0.5 * seconds,
                                        dice.between(0.8, 0.5 * size_mm));
  auto& step = gesture.steps[0];
  step.selection = dice.chance(0.5) ? palpate::interaction::SelectionKind::fuzzy
                                    : palpate::interaction::SelectionKind::sphere;
  const double place_mm = dice.between(-0.2, 0.2) * size_mm;
  for (auto& point : step.path) {
    point.t_s += 0.05 * seconds;
    point.ray.origin_mm.x() += place_mm;
  }
  if (dice.chance(0.5)) {  // back and beyond
    auto last = step.path.back();
    last.t_s = 0.65 * seconds;
    last.ray.origin_mm.x() = dice.between(-0.7, 0.7) * size_mm;
    last.ray.origin_mm.y() = dice.between(-0.5, 0.5) * size_mm;
    step.path.push_back(last);
  }
  return gesture;
}

/// Everything that is asked, but for how long.
Case draw(std::uint32_t seed) {
  Dice dice(seed);
  Case drawn;
  const int side = dice.whole(4, 8);
  drawn.size_mm = side;
  const auto volume = volume_of(dice, side);
  draw_tissue(dice, drawn.recipe.tissue);
  auto& settings = drawn.recipe.simulation;
  draw_physics(dice, settings.parameters);
  if (dice.chance(0.3)) settings.anchors.rule = session::AnchorSettings::Rule::border;
  if (dice.chance(0.3))
    settings.scaling = {dice.chance(0.5), dice.chance(0.5), dice.chance(0.5), dice.chance(0.5)};
  if (dice.chance(0.4)) settings.step_s = dice.by_magnitude(1e-5, 0.1);
  // The lattice layout is for points on one.
  const int layout = dice.whole(0, drawn.recipe.tissue.points == model::PointRule::lattice ? 2 : 1);
  settings.layout = layout == 0   ? simulation::LayoutChoice::automatic
                    : layout == 1 ? simulation::LayoutChoice::explicit_links
                                  : simulation::LayoutChoice::lattice;
  drawn.tissue = session::build_tissue(volume, drawn.recipe);
  // As long as a second, as far as 1000 steps of the automatic size go.
  const simulation::StabilityCase at{nullptr, nullptr, &drawn.tissue.material};
  const auto limit = simulation::stable_step(*drawn.tissue.tissue, settings.parameters, at);
  const double step_s = std::min({limit.step_s, settings.step_s.value_or(1.0), 0.02});
  drawn.request.seconds = dice.between(0.3, 1.0) * std::min(1.0, 1000.0 * step_s);
  if (settings.step_s) settings.step_s = std::min(*settings.step_s, drawn.request.seconds);
  drawn.request.gesture = draw_gesture(dice, drawn.request.seconds, drawn.size_mm);
  return drawn;
}

std::string describe(const Case& drawn) {
  const auto& s = drawn.recipe.simulation;
  const auto& p = s.parameters;
  std::ostringstream text;
  text << to_string(p.integrator) << " k " << p.stiffness_per_s2 << " c " << p.damping_per_s << " D "
       << p.drag_per_s << " m " << p.mass << " g " << p.gravity_mm_per_s2.norm() << " beat "
       << p.beat_amplitude << '/' << p.beat_period_s << " links " << drawn.tissue.tissue->links.size()
       << " of " << drawn.tissue.tissue->points.size() << " points, layout " << to_string(s.layout)
       << ", step " << (s.step_s ? std::to_string(*s.step_s) : "auto") << ", anchors "
       << drawn.tissue.material.anchors.size() << (drawn.tissue.material.is_scaled() ? ", scaled" : "")
       << ", " << drawn.request.seconds << " s";
  return text.str();
}

bool is_finite(const simulation::State& state) {
  for (const auto& x : state.positions_mm)
    if (!x.allFinite()) return false;
  for (const auto& v : state.velocities_mm_per_s)
    if (!v.allFinite()) return false;
  return true;
}

}  // namespace

TEST(Soak, NearlyAllThatIsOfferedRunsWithoutARollbackAndNothingPauses) {
  if (palpate::compute::list_devices().empty()) GTEST_SKIP() << "no OpenCL device";
  const int wanted = palpate::testing::repetitions(16, 200);
  int runs = 0;
  int refused = 0;
  int rolled_back = 0;
  int sub_stepped = 0;
  for (std::uint32_t seed = 1; runs < wanted; ++seed) {
    const Case drawn = draw(seed);
    session::RunResult result;
    try {
      result = session::run(drawn.tissue, {}, drawn.recipe.simulation, drawn.request);
    } catch (const palpate::core::Error& error) {
      // Explicit Euler without damping has no automatic step, and says so before the run.
      ASSERT_EQ(error.kind(), palpate::core::ErrorKind::usage) << seed << ": " << error.what();
      ASSERT_EQ(drawn.recipe.simulation.parameters.integrator, simulation::Integrator::euler) << error.what();
      ++refused;
      continue;
    }
    ++runs;
    EXPECT_FALSE(result.diverged) << "seed " << seed << ": " << describe(drawn) << "\n" << result.message;
    EXPECT_TRUE(is_finite(result.state)) << "seed " << seed << ": " << describe(drawn);
    EXPECT_GE(result.seconds, drawn.request.seconds * (1.0 - 1e-6))
        << "seed " << seed << ": " << describe(drawn);
    if (result.substeps > 1) ++sub_stepped;
    if (result.recoveries == 0) continue;
    ++rolled_back;
    std::cout << "seed " << seed << " rolled back " << result.recoveries << " times: " << describe(drawn)
              << "\n  " << result.message << "\n";
  }
  std::cout << runs << " runs, " << rolled_back << " with a rollback, " << sub_stepped << " sub-stepped, "
            << refused << " refused beforehand\n";
  EXPECT_LE(rolled_back, std::max(1, runs / 20)) << "more than one in twenty";
}
