#include "palpate/model/mask.hpp"

#include "build.hpp"
#include "model_shapes.hpp"

#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

using namespace palpate::model;
using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::core::ImageGeometry;
using palpate::core::Volume;
using palpate::testing::full_box;
using palpate::testing::shape;

namespace {

using Voxel = std::array<int, 3>;

/// Values of i + 10 j + 100 k.
Volume numbered(const ImageGeometry& geometry) {
  std::vector<float> voxels(geometry.voxel_count());
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const auto [i, j, k] = geometry.ijk_of(n);
    voxels[n] = static_cast<float>(i + 10 * j + 100 * k);
  }
  return Volume(geometry, std::move(voxels));
}

std::shared_ptr<const Volume> labels(const ImageGeometry& geometry,
                                     const std::function<float(const Voxel&)>& label) {
  std::vector<float> voxels(geometry.voxel_count());
  for (std::size_t n = 0; n < voxels.size(); ++n) voxels[n] = label(geometry.ijk_of(n));
  return std::make_shared<const Volume>(geometry, std::move(voxels));
}

TissueParameters masked(std::shared_ptr<const Volume> mask, std::optional<int> label = std::nullopt) {
  TissueParameters parameters;
  parameters.mask = std::move(mask);
  parameters.mask_label = label;
  return parameters;
}

std::vector<Voxel> voxels_of(const Tissue& tissue) {
  return {tissue.points.voxels.begin(), tissue.points.voxels.end()};
}

/// What tissue must be, by the words of the header: nearest voxel by LPS.
std::vector<Voxel> expected(const Volume& volume, const Volume& mask,
                            const std::function<bool(float value, float label)>& keep) {
  std::vector<Voxel> voxels;
  const auto& dims = mask.dims();
  for (std::size_t n = 0; n < volume.size(); ++n) {
    const Voxel voxel = volume.geometry().ijk_of(n);
    const Eigen::Vector3d at =
        mask.geometry().to_ijk(volume.geometry().to_lps_mm(Eigen::Vector3d(voxel[0], voxel[1], voxel[2])));
    // By the distance to every voxel along each axis, without rounding rules.
    Voxel nearest{};
    bool inside = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double place = at[static_cast<Eigen::Index>(axis)];
      for (int v = 1; v < dims[axis]; ++v)
        if (std::abs(v - place) < std::abs(nearest[axis] - place)) nearest[axis] = v;
      inside = inside && std::abs(nearest[axis] - place) <= 0.5;
    }
    if (inside && keep(volume.data()[n], mask.at(nearest[0], nearest[1], nearest[2])))
      voxels.push_back(voxel);
  }
  return voxels;
}

Error error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorKind::internal, "none", "nothing was thrown");
}

}  // namespace

TEST(Mask, AloneIsAllOfItsLabelWhateverTheIntensities) {
  const ImageGeometry geometry({6, 5, 4}, {1, 2, 3}, {1, 2, 3});
  const Volume volume = numbered(geometry);
  const auto mask = labels(geometry, [](const Voxel& v) { return v[0] < 2 ? 0.0F : v[0] < 4 ? 1.0F : 2.0F; });
  EXPECT_EQ(generate(volume, masked(mask)).points.size(), 4U * 5U * 4U);
  const Tissue second = generate(volume, masked(mask, 2));
  EXPECT_EQ(second.points.size(), 2U * 5U * 4U);
  for (const auto& voxel : second.points.voxels) EXPECT_GE(voxel[0], 4);
  // Label 0 can be asked for: what the labels leave out.
  EXPECT_EQ(generate(volume, masked(mask, 0)).points.size(), 2U * 5U * 4U);
}

TEST(Mask, WithAThresholdIsBoth) {
  const ImageGeometry geometry({6, 5, 4}, {1, 1, 1}, {0, 0, 0});
  const Volume volume = numbered(geometry);
  const auto mask = labels(geometry, [](const Voxel& v) { return v[0] == 3 ? 1.0F : 0.0F; });
  TissueParameters parameters = masked(mask);
  parameters.threshold_low = 100.0;
  parameters.threshold_high = 223.0;
  const Tissue tissue = generate(volume, parameters);
  EXPECT_EQ(voxels_of(tissue), expected(volume, *mask, [](float value, float label) {
              return label != 0.0F && value >= 100.0F && value <= 223.0F;
            }));
  EXPECT_EQ(tissue.points.size(), 5U + 3U);  // slice 1 whole, slice 2 up to j = 2
  // An upper threshold alone counts too.
  parameters.threshold_low.reset();
  EXPECT_EQ(generate(volume, parameters).points.size(), 5U + 5U + 3U);
}

TEST(Mask, HoldsLabelsThatAreNegativeNoWholeNumbersOrNotNumbersAtAll) {
  const ImageGeometry geometry({6, 1, 1}, {1, 1, 1}, {0, 0, 0});
  const std::vector<float> values{-3.0F, 0.0F, std::nanf(""), std::numeric_limits<float>::infinity(),
                                  1.9F,  0.25F};
  const auto mask = labels(geometry, [&](const Voxel& v) { return values[static_cast<std::size_t>(v[0])]; });
  const Volume volume = shape({6, 1, 1}, {1, 1, 1}, [](int, int, int) { return true; });
  const Volume there(geometry, volume.shared_voxels());
  const auto kept = [&](std::optional<int> label) {
    std::vector<int> columns;
    for (const auto& voxel : generate(there, masked(mask, label)).points.voxels) columns.push_back(voxel[0]);
    return columns;
  };
  EXPECT_EQ(kept(std::nullopt), (std::vector<int>{0, 4, 5})) << "anything but 0 that is a number";
  EXPECT_EQ(kept(-3), std::vector<int>{0});
  EXPECT_EQ(kept(2), std::vector<int>{4}) << "1.9 rounds to 2";
  EXPECT_EQ(kept(0), (std::vector<int>{1, 5})) << "so does 0.25 to 0";
}

TEST(Mask, WithAGeometryOfItsOwnIsLookedUpByPlace) {
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.37, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
  const Eigen::Matrix3d flipped = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  const Volume volume =
      numbered(ImageGeometry({13, 11, 9}, {0.7, 0.9, 1.3}, {-3.1, 2.2, 5.5}, turned * flipped));
  const Eigen::Vector3d middle = volume.geometry().center_mm();
  for (const double spacing : {0.53, 1.0, 3.7})
    for (const Eigen::Matrix3d& axes : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), flipped}) {
      const ImageGeometry own({7, 6, 8}, Eigen::Vector3d(spacing, 1.1 * spacing, 0.9 * spacing),
                              middle - axes * Eigen::Vector3d::Constant(3.05 * spacing), axes);
      const auto mask =
          labels(own, [](const Voxel& v) { return static_cast<float>((v[0] + v[1] + v[2]) % 3); });
      const auto wanted = expected(volume, *mask, [](float, float label) { return label == 2.0F; });
      ASSERT_FALSE(wanted.empty());
      ASSERT_LT(wanted.size(), volume.size());
      EXPECT_EQ(voxels_of(generate(volume, masked(mask, 2))), wanted) << spacing;
      TissueParameters strided = masked(mask, 2);
      strided.stride = 2;
      std::vector<Voxel> every_second;
      for (const Voxel& voxel : wanted)
        if (voxel[0] % 2 == 0 && voxel[1] % 2 == 0 && voxel[2] % 2 == 0) every_second.push_back(voxel);
      if (!every_second.empty()) {
        EXPECT_EQ(voxels_of(generate(volume, strided)), every_second) << spacing;
      }
    }
}

TEST(Mask, OfOnePlaneGivesAThinTissue) {
  const ImageGeometry flat({20, 20, 1}, {1, 1, 1}, {-3, 5, 17});  // the volume's slice 10
  const auto mask = labels(flat, [](const Voxel&) { return 1.0F; });
  const Tissue tissue = generate(full_box(20), masked(mask));
  EXPECT_EQ(tissue.points.size(), 400U);
  for (const auto& voxel : tissue.points.voxels) EXPECT_EQ(voxel[2], 10);
}

TEST(Mask, ThatLiesElsewhereOrMarksNothingIsSaid) {
  const Volume volume = full_box(8);  // its first voxel is at (-3, 5, 7)
  const auto ones = [](const Voxel&) { return 1.0F; };
  const auto refusal = [&](const TissueParameters& parameters) {
    const Error built = error_of([&] { generate(volume, parameters); });
    EXPECT_EQ(error_of([&] { estimate(volume, parameters); }).code(), built.code());
    EXPECT_EQ(built.kind(), ErrorKind::input);
    return built;
  };
  const auto elsewhere = labels(ImageGeometry({8, 8, 8}, {1, 1, 1}, {50, 5, 7}), ones);
  EXPECT_EQ(refusal(masked(elsewhere)).code(), "mask-outside");
  const auto here = labels(volume.geometry(), [](const Voxel& v) { return v[0] < 4 ? 3.0F : -2.0F; });
  const Error other_label = refusal(masked(here, 7));
  EXPECT_EQ(other_label.code(), "mask-empty");
  EXPECT_NE(std::string(other_label.what()).find("label 7"), std::string::npos) << other_label.what();
  EXPECT_NE(std::string(other_label.what()).find("from -2 to 3"), std::string::npos) << other_label.what();
  const auto zeros = labels(volume.geometry(), [](const Voxel&) { return 0.0F; });
  EXPECT_EQ(refusal(masked(zeros)).code(), "mask-empty");
  TissueParameters cropped = masked(here, 3);
  cropped.crop = CropBox{{4, 0, 0}, {8, 8, 8}};
  EXPECT_EQ(refusal(cropped).code(), "mask-empty") << "the label is there, but not in the crop";
  TissueParameters dark = masked(here, 3);
  dark.threshold_low = 1000.0;
  EXPECT_EQ(refusal(dark).code(), "no-tissue") << "here the threshold is to blame";
  EXPECT_EQ(error_of([&] { generate(volume, masked(std::make_shared<const Volume>())); }).kind(),
            ErrorKind::usage);
}

TEST(Mask, GivesTheSameForAnyNumberOfThreadsAndAnExactEstimate) {
  const Volume volume = palpate::testing::shell({60, 60, 60}, {1, 1, 1}, 0.3);
  const ImageGeometry coarse({20, 20, 20}, {3, 3, 3}, {-2, 6, 8});
  const auto mask = labels(coarse, [](const Voxel& v) { return v[2] < 12 ? 1.0F : 0.0F; });
  const TissueParameters parameters = masked(mask, 1);
  const Tissue one = generate_with(volume, parameters, 1, {});
  const Tissue three = generate_with(volume, parameters, 3, {});
  EXPECT_EQ(one.points.voxels, three.points.voxels);
  EXPECT_EQ(one.links.pairs, three.links.pairs);
  EXPECT_EQ(one.points.size(), 60U * 60U * 36U);
  const TissueEstimate guess = estimate(volume, parameters);
  EXPECT_TRUE(guess.sampled);
  EXPECT_EQ(guess.statistics.points, one.points.size());
}
