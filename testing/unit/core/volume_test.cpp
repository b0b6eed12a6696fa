#include "palpate/core/volume.hpp"

#include "palpate/core/error.hpp"
#include "palpate/core/latest_value.hpp"
#include "palpate/core/mesh.hpp"
#include "palpate/core/progress.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace core = palpate::core;

TEST(Volume, RangeIsOverFiniteVoxels) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const core::Volume volume({{4, 1, 1}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()},
                            {nan, -2.0F, 4.0F, nan});
  EXPECT_EQ(volume.range().min, -2.0F);
  EXPECT_EQ(volume.range().max, 4.0F);
  EXPECT_EQ(volume.range().mean, 1.0);
}

TEST(Volume, RefusesAWrongNumberOfVoxels) {
  EXPECT_THROW(core::Volume({{2, 2, 2}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()}, {1.0F}),
               core::Error);
}

TEST(Volume, SamplesALinearFieldExactly) {
  std::vector<float> voxels;
  for (int k = 0; k < 3; ++k)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 5; ++i) voxels.push_back(static_cast<float>(i + 10 * j + 100 * k));
  const core::Volume volume({{5, 4, 3}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()}, voxels);
  EXPECT_FLOAT_EQ(volume.sample({1.5, 2.25, 0.5}), 1.5F + 22.5F + 50.0F);
  EXPECT_FLOAT_EQ(volume.sample({-3, 99, 0}), 30.0F);  // clamped
}

TEST(Provenance, WordsGoThereAndBack) {
  for (const auto* word : {"stated", "private", "derived", "assumed", "user", "absent"})
    EXPECT_EQ(core::to_string(core::provenance_from(word)), word);
  EXPECT_THROW(core::provenance_from("guessed"), core::Error);
}

TEST(VolumeInfo, SpacingOfAnAxisWithOneVoxelDoesNotCount) {
  core::VolumeInfo info;
  info.spacing_provenance = {core::Provenance::stated, core::Provenance::stated, core::Provenance::assumed};
  info.geometry = {{5, 4, 1}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()};
  EXPECT_FALSE(info.spacing_is_assumed());
  info.geometry = {{5, 4, 2}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()};
  EXPECT_TRUE(info.spacing_is_assumed());
}

TEST(Mesh, NormalsOfATetrahedronPointOutwards) {
  core::TriangleMesh mesh;
  mesh.vertices_mm = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const auto normals = core::vertex_normals(mesh);
  const Eigen::Vector3f center(0.25F, 0.25F, 0.25F);
  for (std::size_t n = 0; n < 4; ++n) {
    EXPECT_NEAR(normals[n].norm(), 1.0F, 1e-6F);
    EXPECT_GT(normals[n].dot(mesh.vertices_mm[n] - center), 0.0F);
  }
}

TEST(Progress, PartsMapIntoTheWholeAndCancelThrows) {
  std::vector<double> seen;
  const core::CancelToken token;
  const core::Progress whole([&](double fraction, const std::string&) { seen.push_back(fraction); }, token);
  const core::Progress second_half = whole.part(0.5, 1.0);
  second_half.report(0.5, "half of the second half");
  second_half.part(0.0, 0.5).report(1.0, "the same place");
  EXPECT_EQ(seen, (std::vector<double>{0.75, 0.75}));
  token.cancel();
  try {
    second_half.report(0.6, "stopped");
    FAIL() << "a cancelled report must throw";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.exit_code(), 130);
  }
}

TEST(LatestValue, KeepsOnlyTheNewest) {
  core::LatestValue<int> latest;
  EXPECT_FALSE(latest.take().has_value());
  EXPECT_TRUE(latest.publish(1));
  EXPECT_FALSE(latest.publish(2));
  EXPECT_EQ(latest.take(), std::optional<int>(2));
  EXPECT_FALSE(latest.take().has_value());
}
