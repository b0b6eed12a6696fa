// The estimate of how far tissue sags, against where the reference solver comes to rest.
#include "palpate/simulation/sag.hpp"

#include "palpate/core/volume.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/simulation/solver.hpp"

#include <gtest/gtest.h>

#include <numeric>

namespace core = palpate::core;
namespace model = palpate::model;
namespace simulation = palpate::simulation;

namespace {

constexpr int height = 16;

/// A column of 6 x 6 x 16 points, 0.5 mm apart.
std::shared_ptr<const model::Tissue> column(model::LinkRule links) {
  const core::ImageGeometry geometry({6, 6, height}, Eigen::Vector3d::Constant(0.5), Eigen::Vector3d::Zero());
  model::TissueParameters parameters;
  parameters.threshold_low = 50.0;
  parameters.links = links;
  if (links != model::LinkRule::nearest) parameters.noise = 0.0;
  return std::make_shared<const model::Tissue>(
      model::generate(core::Volume(geometry, std::vector<float>(6 * 6 * height, 100.0F)), parameters));
}

/// The highest plane.
std::vector<std::uint32_t> top_of(const model::Tissue& tissue) {
  std::vector<std::uint32_t> anchors;
  for (std::uint32_t point = 0; point < tissue.points.size(); ++point)
    if (tissue.points.voxels[point][2] == height - 1) anchors.push_back(point);
  return anchors;
}

simulation::Sag sag_of(const model::Tissue& tissue, const simulation::Parameters& parameters) {
  return simulation::sag_under_gravity(tissue, top_of(tissue), parameters);
}

/// How far the lowest plane has sunk where the highest is held, once all is at rest.
double sunk_mm(const std::shared_ptr<const model::Tissue>& tissue, simulation::Parameters parameters) {
  simulation::Material material;
  material.anchors = top_of(*tissue);
  parameters.drag_per_s = 20.0;
  const auto solver = simulation::make_reference_solver(tissue, parameters, material);
  solver->step(1000, 0.002);
  const auto state = solver->state();
  double sum = 0.0;
  int count = 0;
  for (std::size_t point = 0; point < tissue->points.size(); ++point) {
    if (tissue->points.voxels[point][2] != 0) continue;
    sum += static_cast<double>(tissue->points.positions_mm[point].z() - state.positions_mm[point].z());
    ++count;
  }
  return sum / count;
}

}  // namespace

TEST(Sag, IsWithinAFactorOfTwoOfTheSimulatedOne) {
  for (const auto links :
       {model::LinkRule::nearest, model::LinkRule::lattice18, model::LinkRule::lattice26}) {
    const auto tissue = column(links);
    simulation::Parameters parameters;
    parameters.stiffness_per_s2 = 20000.0;
    parameters.gravity_mm_per_s2 = {0.0, 0.0, -400.0};
    const auto sag = sag_of(*tissue, parameters);
    const double simulated = sunk_mm(tissue, parameters);
    EXPECT_FALSE(sag.is_too_soft());
    EXPECT_GT(sag.sag_mm / simulated, 0.5)
        << "rule " << static_cast<int>(links) << ": " << sag.sag_mm << " for " << simulated;
    EXPECT_LT(sag.sag_mm / simulated, 2.0)
        << "rule " << static_cast<int>(links) << ": " << sag.sag_mm << " for " << simulated;
  }
}

TEST(Sag, GrowsWithGravityAndMassAndFallsWithStiffness) {
  const auto tissue = column(model::LinkRule::lattice18);
  simulation::Parameters parameters;
  EXPECT_EQ(sag_of(*tissue, parameters).sag_mm, 0.0) << "no gravity";
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -400.0};
  const double once = sag_of(*tissue, parameters).sag_mm;
  ASSERT_GT(once, 0.0);
  parameters.mass = 2.0;
  EXPECT_NEAR(sag_of(*tissue, parameters).sag_mm, 2.0 * once, 1e-12);
  parameters.stiffness_per_s2 *= 4.0;
  EXPECT_NEAR(sag_of(*tissue, parameters).sag_mm, once / 2.0, 1e-12);
  parameters.stiffness_per_s2 = 0.0;
  EXPECT_TRUE(sag_of(*tissue, parameters).is_too_soft()) << "nothing holds it";
  std::vector<std::uint32_t> all(tissue->points.size());
  std::iota(all.begin(), all.end(), 0U);
  for (const auto& anchors : {all, {}})
    EXPECT_FALSE(simulation::sag_under_gravity(*tissue, anchors, parameters).is_too_soft())
        << anchors.size() << " anchors";
}

TEST(Sag, TheStiffnessThatIsSaidIsEnough) {
  const auto tissue = column(model::LinkRule::nearest);
  simulation::Parameters parameters;
  parameters.stiffness_per_s2 = 100.0;
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -9810.0};
  const auto soft = sag_of(*tissue, parameters);
  EXPECT_TRUE(soft.is_too_soft());
  parameters.stiffness_per_s2 = soft.stiffness_per_s2;
  const auto stiff = sag_of(*tissue, parameters);
  EXPECT_FALSE(stiff.is_too_soft());
  EXPECT_LE(stiff.strain, 0.2);
}

/// The fewer points hold, the more each of them carries.
TEST(Sag, GrowsWhereLessIsFixed) {
  const auto tissue = column(model::LinkRule::lattice18);
  simulation::Parameters parameters;
  parameters.gravity_mm_per_s2 = {0.0, 0.0, -400.0};
  auto anchors = top_of(*tissue);
  const double whole = simulation::sag_under_gravity(*tissue, anchors, parameters).strain;
  anchors.resize(anchors.size() / 6);  // one of six rows
  EXPECT_GT(simulation::sag_under_gravity(*tissue, anchors, parameters).strain, 2.0 * whole);
}
