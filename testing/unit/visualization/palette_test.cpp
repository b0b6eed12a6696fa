#include "palette.hpp"

#include "palpate/visualization/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

using namespace palpate;
using namespace palpate::visualization;

namespace {

double linear(std::uint8_t byte) {
  const double c = byte / 255.0;
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

/// CIE lightness L*, from the definition of sRGB: not what the maps are made with.
double lightness(Rgba color) {
  const double y = 0.2126 * linear(color.r) + 0.7152 * linear(color.g) + 0.0722 * linear(color.b);
  return y > 0.008856 ? 116.0 * std::cbrt(y) - 16.0 : 903.3 * y;
}

core::Volume volume_of(std::vector<float> voxels) {
  const int count = static_cast<int>(voxels.size());
  return {core::ImageGeometry({count, 1, 1}, {2, 1, 1}, {10, 20, 30}), std::move(voxels)};
}

}  // namespace

TEST(Palette, LightnessGrowsWithTheValue) {
  for (auto* map : {flesh_color, ember_color}) {
    for (int n = 1; n <= 64; ++n) {
      // Bytes are rounded: a step of 1/64 may lose at most a fraction of one level of lightness.
      EXPECT_GT(lightness(map(n / 64.0)), lightness(map((n - 1) / 64.0)) - 0.2) << n;
    }
    EXPECT_GT(lightness(map(1.0)) - lightness(map(0.0)), 30.0);
  }
}

TEST(Palette, OneSpeckDoesNotFlattenTheMap) {
  std::vector<float> values(1000);
  for (std::size_t n = 0; n < values.size(); ++n) values[n] = static_cast<float>(n % 100);
  const auto without = map_colors(values, ember_color);
  values[7] = 1e9F;
  const auto with = map_colors(values, ember_color);
  ASSERT_EQ(with.size(), 3000U);
  // The ends of the map move by one of a hundred values: three steps of the
  // table of 256, each at most 4 levels of a channel.
  for (std::size_t n = 60; n < with.size(); ++n) EXPECT_NEAR(with[n], without[n], 12) << n;
}

TEST(Palette, EqualValuesGetTheMiddle) {
  const auto colors = map_colors({5.0F, 5.0F}, flesh_color);
  EXPECT_EQ(colors[0], flesh_color(128.0 / 255.0).r);
  EXPECT_TRUE(map_colors({}, flesh_color).empty());
}

TEST(StandardSettings, SpansTheQuantilesFromTheMiddle) {
  std::vector<float> voxels(1001);
  for (std::size_t n = 0; n < voxels.size(); ++n) voxels[n] = static_cast<float>(n);
  voxels[500] = 1e6F;  // one speck beyond the 99.5 % quantile
  const ViewSettings settings = standard_settings(volume_of(voxels));
  // The quantiles of 0..1000 are 5 and 995; the speck moves them by one rank at most.
  EXPECT_NEAR(settings.window, 990.0, 2.0);
  EXPECT_NEAR(settings.level, 500.0, 2.0);
  EXPECT_TRUE(settings.crosshair_mm.isApprox(Eigen::Vector3d(10 + 1000, 20, 30)));
}

TEST(StandardSettings, NearlyEmptyAndConstantVolumesStillShow) {
  std::vector<float> speck(1000, 0.0F);
  speck[3] = 8.0F;
  EXPECT_DOUBLE_EQ(standard_settings(volume_of(speck)).window, 8.0);
  EXPECT_GT(standard_settings(volume_of({3.0F, 3.0F})).window, 0.0);
  EXPECT_GT(standard_settings({}).window, 0.0);
}
