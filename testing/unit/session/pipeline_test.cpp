#include "palpate/session/pipeline.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"
#include "palpate/imaging/writer.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

namespace palpate::session {
namespace {

namespace fs = std::filesystem;
using core::Error;
using core::ErrorKind;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using Voxel = std::array<int, 3>;

const core::ImageGeometry scan_geometry({12, 10, 8}, {0.5, 0.5, 1.0}, {-3, 4, 10});

/// Intensities of 10 + i.
core::Volume scan() {
  std::vector<float> voxels(scan_geometry.voxel_count());
  for (std::size_t n = 0; n < voxels.size(); ++n)
    voxels[n] = static_cast<float>(10 + scan_geometry.ijk_of(n)[0]);
  return core::Volume(scan_geometry, std::move(voxels));
}

void write_labels(const fs::path& path, const core::ImageGeometry& geometry,
                  const std::function<float(const Voxel&)>& label) {
  std::vector<float> voxels(geometry.voxel_count());
  for (std::size_t n = 0; n < voxels.size(); ++n) voxels[n] = label(geometry.ijk_of(n));
  imaging::write(path, {core::Volume(geometry, std::move(voxels))});
}

Recipe with_mask(const fs::path& path, std::optional<int> label = std::nullopt) {
  Recipe recipe;
  recipe.mask.path = path;
  recipe.mask.label = label;
  return recipe;
}

Error error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorKind::internal, "none", "nothing was thrown");
}

bool warned(const std::vector<core::Warning>& warnings, const std::string& code) {
  return std::any_of(warnings.begin(), warnings.end(),
                     [&](const core::Warning& warning) { return warning.code == code; });
}

}  // namespace

TEST(BuildTissue, TakesAMaskFromAFileInsteadOfAThreshold) {
  const TemporaryFolder folder;
  write_labels(folder / "mask.mha", scan_geometry, [](const Voxel& v) {
    return v[0] < 4 ? 1.0F : v[0] < 6 ? 2.0F : 0.0F;
  });
  const BuiltTissue all = build_tissue(scan(), with_mask(folder / "mask.mha"));
  EXPECT_EQ(all.tissue->points.size(), 6U * 80U);
  EXPECT_EQ(all.threshold_low, 10.0) << "the tissue's least intensity";
  ASSERT_NE(all.mask, nullptr);
  EXPECT_TRUE(all.warnings.empty());
  const BuiltTissue second = build_tissue(scan(), with_mask(folder / "mask.mha", 2));
  EXPECT_EQ(second.tissue->points.size(), 2U * 80U);
  Recipe both = with_mask(folder / "mask.mha");
  both.tissue.threshold_low = 13.0;
  const BuiltTissue bright = build_tissue(scan(), both);
  EXPECT_EQ(bright.tissue->points.size(), 3U * 80U);
  EXPECT_EQ(bright.threshold_low, 13.0);
  EXPECT_EQ(estimate_tissue(scan(), both).tissue.statistics.points, bright.tissue->points.size());
  EXPECT_EQ(build_tissue(scan(), Recipe()).mask, nullptr);
}

TEST(BuildTissue, LaysAMaskWithoutASpacingOverTheScan) {
  const TemporaryFolder folder;
  // A NIfTI or MetaImage always has a spacing; this text header leaves it out.
  std::string header =
      "ObjectType = Image\nNDims = 3\nDimSize = 12 10 8\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
  core::write_file(folder / "bare.mha", header + std::string(480, '\1') + std::string(480, '\0'));
  const BuiltTissue built = build_tissue(scan(), with_mask(folder / "bare.mha"));
  EXPECT_EQ(built.tissue->points.size(), 480U);
  EXPECT_TRUE(warned(built.warnings, "labels-placed"));
  for (const auto& voxel : built.tissue->points.voxels) EXPECT_LT(voxel[2], 4);
}

TEST(BuildTissue, OfAMaskGetsTheMasksSurface) {
  const TemporaryFolder folder;
  write_labels(folder / "mask.mha", scan_geometry, [](const Voxel& v) {
    return v[0] > 2 && v[0] < 9 && v[1] > 2 && v[1] < 8 && v[2] > 1 && v[2] < 6 ? 1.0F : 0.0F;
  });
  Recipe recipe = with_mask(folder / "mask.mha");
  for (const bool with_threshold : {false, true}) {
    if (with_threshold) recipe.tissue.threshold_low = 5.0;  // all of the scan lies above
    const BuiltTissue built = build_tissue(scan(), recipe);
    const BoundSurface surface = build_surface(scan(), built, recipe);
    ASSERT_NE(surface.mesh, nullptr);
    ASSERT_FALSE(surface.mesh->empty());
    Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9);
    Eigen::Vector3d high = -low;
    for (const auto& vertex : surface.mesh->vertices_mm) {
      const Eigen::Vector3d ijk = scan_geometry.to_ijk(vertex.cast<double>());
      low = low.cwiseMin(ijk);
      high = high.cwiseMax(ijk);
    }
    // The box's cells reach from 2.5 to 8.5, 2.5 to 7.5, 1.5 to 5.5; smoothing
    // and the threshold's slope move the surface by less than half a voxel.
    EXPECT_LT((low - Eigen::Vector3d(2.5, 2.5, 1.5)).cwiseAbs().maxCoeff(), 0.5) << low.transpose();
    EXPECT_LT((high - Eigen::Vector3d(8.5, 7.5, 5.5)).cwiseAbs().maxCoeff(), 0.5) << high.transpose();
    // Its colours are the scan's, not the mask's.
    ASSERT_EQ(surface.mesh->intensities.size(), surface.mesh->vertices_mm.size());
    for (const float intensity : surface.mesh->intensities) {
      EXPECT_GE(intensity, 12.0F);
      EXPECT_LE(intensity, 19.0F);
    }
  }
}

TEST(BuildTissue, SaysWhatIsWrongWithAMask) {
  const TemporaryFolder folder;
  write_labels(folder / "mask.mha", scan_geometry, [](const Voxel&) { return 1.0F; });
  const auto code = [&](const fs::path& path, std::optional<int> label = std::nullopt) {
    const Error error = error_of([&] { build_tissue(scan(), with_mask(path, label)); });
    EXPECT_EQ(error.kind(), ErrorKind::input) << path << ": " << error.what();
    return error.code();
  };
  EXPECT_EQ(code(folder / "none.mha"), "not-found");
  EXPECT_EQ(code(folder / "mask.mha", 4), "mask-empty");
  core::write_file(folder / "damaged.mha",
                   "ObjectType = Image\nNDims = 3\nDimSize = 12 10 8\n"
                   "ElementType = MET_UCHAR\nElementDataFile = LOCAL\nshort");
  EXPECT_EQ(code(folder / "damaged.mha"), "truncated");
  fs::create_directory(folder / "empty");
  code(folder / "empty");
  const core::ImageGeometry elsewhere({12, 10, 8}, {0.5, 0.5, 1.0}, {300, 4, 10});
  write_labels(folder / "elsewhere.mha", elsewhere, [](const Voxel&) { return 1.0F; });
  EXPECT_EQ(code(folder / "elsewhere.mha"), "mask-outside");
}

TEST(MaterialOf, FactorsGrowWithTheIntensityFromAHalfToThreeHalves) {
  Recipe recipe;
  recipe.tissue.threshold_low = 5.0;
  recipe.simulation.scaling.mass = true;
  recipe.simulation.scaling.drag = true;
  const BuiltTissue built = build_tissue(scan(), recipe);
  const auto& material = built.material;
  EXPECT_TRUE(material.scales_mass);
  EXPECT_TRUE(material.scales_drag);
  EXPECT_FALSE(material.scales_stiffness);
  EXPECT_FALSE(material.scales_damping);
  ASSERT_EQ(material.factors.size(), built.tissue->points.size());
  for (std::size_t p = 0; p < material.factors.size(); ++p) {
    // 10..21 become 0.5..1.5, rounded to float once.
    const double expected = 0.5 + (static_cast<double>(built.tissue->points.intensities[p]) - 10.0) / 11.0;
    EXPECT_NEAR(static_cast<double>(material.factors[p]), expected, 1e-7);
  }
  simulation::check(material, built.tissue->points.size());
  // Light points are quicker: the stable step knows of the factors.
  Recipe plain = recipe;
  plain.simulation.scaling = {};
  const BuiltTissue alike = build_tissue(scan(), plain);
  EXPECT_TRUE(alike.material.factors.empty());
  EXPECT_LT(built.stable_step.step_s, alike.stable_step.step_s);
}

TEST(MaterialOf, ConstantIntensitiesHaveFactorsOfOne) {
  const core::Volume volume(scan_geometry, std::vector<float>(scan_geometry.voxel_count(), 7.0F));
  Recipe recipe;
  recipe.tissue.threshold_low = 5.0;
  recipe.simulation.scaling.stiffness = true;
  const auto material = build_tissue(volume, recipe).material;
  EXPECT_TRUE(material.scales_stiffness);
  EXPECT_EQ(material.factors, std::vector<float>(volume.size(), 1.0F));
}

TEST(MaterialOf, BorderAnchorsAreTheOuterPlanesOfTheImageOrTheCrop) {
  Recipe recipe;
  recipe.tissue.threshold_low = 5.0;
  recipe.simulation.anchors.rule = AnchorSettings::Rule::border;
  EXPECT_EQ(build_tissue(scan(), recipe).material.anchors.size(), 12U * 10U * 8U - 10U * 8U * 6U);

  recipe.tissue.crop = model::CropBox{{1, 1, 1}, {8, 8, 6}};
  recipe.tissue.stride = 2;  // planes at 1, 3, 5, 7 along i and j, at 1, 3, 5 along k
  const BuiltTissue cropped = build_tissue(scan(), recipe);
  ASSERT_EQ(cropped.tissue->points.size(), 4U * 4U * 3U);
  EXPECT_EQ(cropped.material.anchors.size(), 48U - 2U * 2U * 1U);
  for (const std::uint32_t point : cropped.material.anchors) {
    const auto& voxel = cropped.tissue->points.voxels[point];
    EXPECT_TRUE(voxel[0] == 1 || voxel[0] == 7 || voxel[1] == 1 || voxel[1] == 7 || voxel[2] == 1 ||
                voxel[2] == 5);
  }

  // Two planes have no inside; that axis does not count.
  recipe.tissue.stride = 1;
  recipe.tissue.crop = model::CropBox{{0, 0, 3}, {12, 10, 5}};
  EXPECT_EQ(build_tissue(scan(), recipe).material.anchors.size(), 2U * (12U * 10U - 10U * 8U));

  // Without a lattice, a layer.
  recipe.tissue.crop.reset();
  recipe.tissue.points = model::PointRule::blue_noise;
  const BuiltTissue scattered = build_tissue(scan(), recipe);
  for (std::uint32_t point = 0; point < scattered.tissue->points.size(); ++point) {
    const auto& v = scattered.tissue->points.voxels[point];
    const bool outer = v[0] == 0 || v[0] == 11 || v[1] == 0 || v[1] == 9 || v[2] == 0 || v[2] == 7;
    EXPECT_EQ(std::binary_search(scattered.material.anchors.begin(), scattered.material.anchors.end(), point),
              outer);
  }
}

TEST(MaterialOf, SaysWhereTheBorderHoldsNothingOrEverything) {
  core::ImageGeometry geometry({9, 9, 9}, {1, 1, 1}, {0, 0, 0});
  std::vector<float> voxels(geometry.voxel_count(), 0.0F);
  voxels[geometry.index(4, 4, 4)] = voxels[geometry.index(4, 4, 5)] = 100.0F;
  Recipe recipe;
  recipe.tissue.threshold_low = 50.0;
  recipe.simulation.anchors.rule = AnchorSettings::Rule::border;
  const BuiltTissue inside = build_tissue(core::Volume(geometry, voxels), recipe);
  EXPECT_TRUE(inside.material.anchors.empty());
  EXPECT_TRUE(warned(inside.warnings, "no-anchors"));
  std::fill(voxels.begin(), voxels.end(), 0.0F);
  voxels[geometry.index(0, 4, 4)] = 100.0F;
  const BuiltTissue outside = build_tissue(core::Volume(geometry, voxels), recipe);
  EXPECT_EQ(outside.material.anchors.size(), 1U);
  EXPECT_TRUE(warned(outside.warnings, "all-anchored"));
}

TEST(MaterialOf, AnchorsOfAFileAreWhereItsLabelsMeetTissue) {
  const TemporaryFolder folder;
  // A coarser image that is turned round along i, painted over the first 2 mm.
  const core::ImageGeometry coarse({6, 5, 8}, {1, 1, 1}, scan_geometry.to_lps_mm({10.5, 0.5, 0.0}),
                                   Eigen::Vector3d(-1, 1, 1).asDiagonal());
  write_labels(folder / "fixed.mha", coarse, [](const Voxel& v) { return v[0] >= 4 ? -1.0F : 0.0F; });
  Recipe recipe;
  recipe.tissue.threshold_low = 5.0;
  recipe.simulation.anchors.rule = AnchorSettings::Rule::file;
  recipe.simulation.anchors.file = folder / "fixed.mha";
  const BuiltTissue built = build_tissue(scan(), recipe);
  // Its columns 4 and 5 lie over the scan's 3, 2 and 1, 0.
  EXPECT_EQ(built.material.anchors.size(), 4U * 80U);
  for (const std::uint32_t point : built.material.anchors)
    EXPECT_LT(built.tissue->points.voxels[point][0], 4);
  EXPECT_EQ(material_of(*built.tissue, recipe.simulation).anchors, built.material.anchors);

  recipe.simulation.anchors.painted = {
      {built.tissue->points.lps_mm(built.material.anchors.front()), 0.01, true}};
  EXPECT_EQ(build_tissue(scan(), recipe).material.anchors.size(), 4U * 80U - 1U)
      << "the brush goes over the file";

  write_labels(folder / "elsewhere.mha", core::ImageGeometry({3, 3, 3}, {1, 1, 1}, {500, 0, 0}),
               [](const Voxel&) { return 1.0F; });
  recipe.simulation.anchors.file = folder / "elsewhere.mha";
  const Error outside = error_of([&] { build_tissue(scan(), recipe); });
  EXPECT_EQ(outside.kind(), ErrorKind::input);
  EXPECT_EQ(outside.code(), "anchors-outside");
  EXPECT_THAT(outside.what(), HasSubstr("elsewhere.mha"));
  recipe.simulation.anchors.file = folder / "none.mha";
  EXPECT_EQ(error_of([&] { build_tissue(scan(), recipe); }).code(), "not-found");
}

}  // namespace palpate::session
