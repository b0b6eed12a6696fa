// Fixed points and the point that is pointed out, by where their pixels lie.
#include "drawing.hpp"
#include "palette.hpp"

#include "palpate/visualization/slice_view.hpp"
#include "palpate/visualization/tissue_view.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>

using namespace palpate;
using namespace palpate::visualization;
using palpate::testing::center_of;
using palpate::testing::draw;
using palpate::testing::Drawing;

namespace {

constexpr int side_px = 400;

/// Two points in an empty scan, 6 mm apart along z, neither in its middle.
SceneContent two_points() {
  const core::ImageGeometry geometry({40, 40, 40}, {1.0, 1.0, 1.0}, {-20.0, -20.0, -20.0});
  SceneContent content;
  content.volume = {geometry, std::vector<float>(geometry.voxel_count(), 0.0F)};
  auto tissue = std::make_shared<model::Tissue>();
  tissue->points.positions_mm = {{7.0F, -4.0F, 2.0F}, {7.0F, -4.0F, 8.0F}};
  tissue->points.voxels = {{27, 16, 22}, {27, 16, 28}};
  tissue->points.intensities = {1.0F, 1.0F};
  tissue->geometry = geometry;
  content.tissue = tissue;
  return content;
}

ViewSettings at_slice_of(const SceneContent& content, std::uint32_t point) {
  ViewSettings settings;
  settings.annotations = false;
  settings.show_crosshair = false;
  settings.crosshair_mm = *place_of(content, point);
  return settings;
}

std::function<double(const std::uint8_t*)> like(Rgba color) {
  return [color](const std::uint8_t* rgba) {
    const int apart = std::abs(rgba[0] - color.r) + std::abs(rgba[1] - color.g) + std::abs(rgba[2] - color.b);
    return apart < 30 ? 1.0 : 0.0;
  };
}

Eigen::Vector2d seen(const SceneContent& content, std::uint32_t slice_of, Rgba color, SliceView& view) {
  view.set_content(content);
  view.set_settings(at_slice_of(content, slice_of));
  return center_of(draw(view.renderer(), side_px, side_px), like(color));
}

}  // namespace

TEST(Marks, AnAnchorIsASquareInItsSliceOnly) {
  SceneContent content = two_points();
  SliceView view(SlicePlane::axial);
  EXPECT_LT(seen(content, 0, anchor_color, view).x(), 0.0) << "nothing is fixed yet";
  content.anchors = std::make_shared<const std::vector<std::uint32_t>>(std::vector<std::uint32_t>{0});
  const Eigen::Vector2d at = seen(content, 0, anchor_color, view);
  ASSERT_GT(at.x(), 0.0);
  const Eigen::Vector3d place = view.place_at(at.x(), at.y());
  // A pixel of this view is about 0.1 mm; the square is drawn to whole ones.
  EXPECT_LT((place - *place_of(content, 0)).norm(), 0.2);
  EXPECT_LT(seen(content, 1, anchor_color, view).x(), 0.0) << "six slices away";
}

TEST(Marks, APointIsPointedOutWhereItLiesNow) {
  SceneContent content = two_points();
  content.mark = PointMark{1, ""};
  SliceView view(SlicePlane::coronal);
  const Eigen::Vector2d at = seen(content, 1, mark_color, view);
  ASSERT_GT(at.x(), 0.0);
  EXPECT_LT((view.place_at(at.x(), at.y()) - *place_of(content, 1)).norm(), 0.2);
  content.positions_mm = std::make_shared<const std::vector<Eigen::Vector3f>>(
      std::vector<Eigen::Vector3f>{{7.0F, -4.0F, 2.0F}, {1.0F, -4.0F, 12.0F}});
  const Eigen::Vector2d moved = seen(content, 1, mark_color, view);
  EXPECT_LT((view.place_at(moved.x(), moved.y()) - Eigen::Vector3d(1.0, -4.0, 12.0)).norm(), 0.2);
}

TEST(Marks, BothAreSeenInThreeD) {
  SceneContent content = two_points();
  content.anchors = std::make_shared<const std::vector<std::uint32_t>>(std::vector<std::uint32_t>{0});
  content.mark = PointMark{1, ""};
  TissueView view;
  view.set_content(content);
  ViewSettings settings;
  settings.annotations = false;
  view.set_settings(settings);
  const Drawing drawing = draw(view.renderer(), side_px, side_px);
  const std::pair<std::uint32_t, Rgba> marks[] = {{0, anchor_color}, {1, mark_color}};
  for (const auto& [point, color] : marks) {
    const Eigen::Vector2d at = center_of(drawing, like(color));
    ASSERT_GT(at.x(), 0.0) << point;
    const auto ray = view.ray_at(at.x(), at.y());
    const Eigen::Vector3d offset = *place_of(content, point) - ray.origin_mm;
    const double aside = (offset - offset.dot(ray.direction) * ray.direction).norm();
    // Anchors are drawn 1.1 mm nearer to the eye; at the edge of a view of 30
    // degrees that is 1.1 tan 15 = 0.29 mm aside, and a pixel is 0.02 mm.
    EXPECT_LT(aside, 0.32) << point;
  }
}
