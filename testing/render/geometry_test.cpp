// One place, four ways to show it: voxel, slice pixel, surface, point. They
// coincide under any direction matrix.
#include "drawing.hpp"

#include "palpate/visualization/slice_view.hpp"
#include "palpate/visualization/tissue_view.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>

using namespace palpate;
using namespace palpate::visualization;
using palpate::testing::center_of;
using palpate::testing::draw;
using palpate::testing::octahedron;

namespace {

struct Direction {
  const char* name;
  Eigen::Matrix3d matrix;
};

std::vector<Direction> directions() {
  Eigen::Matrix3d permuted;
  permuted << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Eigen::Matrix3d oblique =
      (Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-0.4, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  Eigen::Matrix3d sheared = oblique;
  sheared.col(2) = (sheared.col(2) + 0.3 * sheared.col(1)).normalized();
  return {{"identity", Eigen::Matrix3d::Identity()},
          {"flipped", Eigen::Vector3d(-1, 1, -1).asDiagonal()},
          {"mirrored", Eigen::Vector3d(1, 1, -1).asDiagonal()},
          {"permuted", permuted},
          {"oblique", oblique},
          {"sheared", sheared}};
}

constexpr std::array<int, 3> bright{6, 17, 9};

core::Volume one_bright_voxel(const Eigen::Matrix3d& direction) {
  const core::ImageGeometry geometry({21, 25, 17}, {0.6, 0.9, 1.7}, {31, -12, 55}, direction);
  std::vector<float> voxels(geometry.voxel_count(), 0.0F);
  voxels[geometry.index(bright[0], bright[1], bright[2])] = 100.0F;
  return {geometry, std::move(voxels)};
}

Eigen::Vector3d bright_place(const core::Volume& volume) {
  return volume.geometry().to_lps_mm({bright[0], bright[1], bright[2]});
}

ViewSettings bare_settings(const Eigen::Vector3d& crosshair) {
  ViewSettings settings;
  settings.crosshair_mm = crosshair;
  settings.show_crosshair = false;
  settings.annotations = false;
  settings.window = 100.0;
  settings.level = 50.0;
  return settings;
}

double luminance(const std::uint8_t* pixel) { return pixel[1]; }
/// Middle of the area that an outline encloses, of a convex shape. The
/// outline's colour has far more green than red.
Eigen::Vector2d middle_inside_outline(palpate::testing::Drawing drawing) {
  for (int y = 0; y < drawing.height; ++y) {
    std::uint8_t* row =
        drawing.rgba.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(drawing.width) * 4;
    int first = drawing.width;
    int last = -1;
    for (int x = 4; x < drawing.width - 4; ++x) {
      if (row[4 * x + 1] < row[4 * x] + 60) continue;
      first = std::min(first, x);
      last = x;
    }
    for (int x = 0; x < drawing.width; ++x) row[4 * x + 1] = x >= first && x <= last ? 255 : 0;
  }
  return center_of(drawing, luminance);
}

double pixel_mm(const SliceView& view) { return (view.place_at(1, 0) - view.place_at(0, 0)).norm(); }

double distance_to(const interaction::Ray& ray, const Eigen::Vector3d& place) {
  return (place - ray.origin_mm).cross(ray.direction).norm();
}

}  // namespace

TEST(Geometry, AVoxelAndItsSlicePixelCoincide) {
  for (const Direction& direction : directions()) {
    const core::Volume volume = one_bright_voxel(direction.matrix);
    const Eigen::Vector3d place = bright_place(volume);
    for (const SlicePlane plane : {SlicePlane::axial, SlicePlane::coronal, SlicePlane::sagittal}) {
      SliceView view(plane);
      SceneContent content;
      content.volume = volume;
      view.set_content(content);
      view.set_settings(bare_settings(place));
      view.zoom(1.3);
      view.pan(11, -7);
      const auto drawing = draw(view.renderer(), 400, 300);
      const Eigen::Vector2d pixel = center_of(drawing, luminance);
      ASSERT_GT(pixel.x(), 0.0) << direction.name << " plane " << static_cast<int>(plane);
      // Linear interpolation is symmetric about the voxel's centre. Half a pixel is what an eye can tell.
      EXPECT_LT((view.place_at(pixel.x(), pixel.y()) - place).norm(), 0.5 * pixel_mm(view))
          << direction.name << " plane " << static_cast<int>(plane);
    }
  }
}

TEST(Geometry, TheSurfacesOutlineLiesWhereTheVoxelIs) {
  for (const Direction& direction : directions()) {
    const core::Volume volume = one_bright_voxel(direction.matrix);
    const Eigen::Vector3d place = bright_place(volume);
    for (const SlicePlane plane : {SlicePlane::axial, SlicePlane::coronal, SlicePlane::sagittal}) {
      SliceView view(plane);
      SceneContent content;
      content.volume = {volume.geometry(), std::vector<float>(volume.size(), 0.0F)};
      content.mesh = octahedron(place, 3.0);
      view.set_content(content);
      view.set_settings(bare_settings(place));
      const Eigen::Vector2d pixel = middle_inside_outline(draw(view.renderer(), 400, 300));
      ASSERT_GT(pixel.x(), 0.0) << direction.name << " plane " << static_cast<int>(plane);
      EXPECT_LT((view.place_at(pixel.x(), pixel.y()) - place).norm(), 0.5 * pixel_mm(view))
          << direction.name << " plane " << static_cast<int>(plane);
    }
  }
}

TEST(Geometry, SurfaceAndPointProjectToTheVoxelsPlaceIn3D) {
  for (const Direction& direction : directions()) {
    const Eigen::Vector3d place = bright_place(one_bright_voxel(direction.matrix));
    const Eigen::Vector3d center(30, -10, 50);
    interaction::Camera camera;
    camera.position_mm = center + Eigen::Vector3d(40, -90, 30);
    camera.focal_point_mm = center;
    ViewSettings settings;
    settings.camera = camera;
    settings.annotations = false;
    settings.transparent = true;
    // The oracle: a pinhole camera by hand.
    const Eigen::Vector3d toward = (camera.position_mm - camera.focal_point_mm).normalized();
    const Eigen::Vector3d right = camera.view_up.cross(toward).normalized();
    const Eigen::Vector3d offset = place - camera.position_mm;
    const double scale = 150.0 / std::tan(15.0 * M_PI / 180.0) / -offset.dot(toward);
    const Eigen::Vector2d expected(200 + scale * offset.dot(right),
                                   150 + scale * offset.dot(toward.cross(right)));

    for (const Show show : {Show::points, Show::surface}) {
      TissueView view;
      SceneContent content;
      if (show == Show::surface) {
        content.mesh = octahedron(place, 0.8);
      } else {
        auto tissue = std::make_shared<model::Tissue>();
        tissue->points.center_mm = center;
        tissue->points.positions_mm = {(place - center).cast<float>()};
        tissue->points.intensities = {1.0F};
        tissue->spacing_mm.setConstant(3.0);  // drawn some 13 pixels wide
        content.tissue = tissue;
      }
      settings.show = show;
      view.set_content(content);
      view.set_settings(settings);
      const auto drawing = draw(view.renderer(), 400, 300);
      const Eigen::Vector2d pixel =
          center_of(drawing, [](const std::uint8_t* p) { return static_cast<double>(p[3]); });
      // Half a pixel. Drivers may put a point's square on whole pixels: half a pixel along x and y.
      const double tolerance = show == Show::surface ? 0.5 : std::sqrt(0.5) + 0.01;
      EXPECT_LT((pixel - expected).norm(), tolerance) << direction.name << " show " << static_cast<int>(show);
      EXPECT_LT(distance_to(view.ray_at(pixel.x(), pixel.y()), place), tolerance / scale) << direction.name;
    }
  }
}

TEST(Geometry, ThePatientsRightIsOnTheScreensLeft) {
  // Low x is the patient's right, low y the front, high z the head (LPS).
  const core::ImageGeometry geometry({20, 20, 20}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  std::vector<float> voxels(geometry.voxel_count(), 0.0F);
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const auto ijk = geometry.ijk_of(n);
    if (ijk[0] < 6 && ijk[1] < 6 && ijk[2] > 13) voxels[n] = 100.0F;
  }
  SceneContent content;
  content.volume = {geometry, voxels};
  for (const SlicePlane plane : {SlicePlane::axial, SlicePlane::coronal, SlicePlane::sagittal}) {
    SliceView view(plane);
    view.set_content(content);
    view.set_settings(bare_settings({3, 3, 16}));
    const Eigen::Vector2d pixel = center_of(draw(view.renderer(), 300, 300), luminance);
    // Axial: right and front are left and up. Coronal: right and head. Sagittal: front and head.
    EXPECT_LT(pixel.x(), 120.0) << static_cast<int>(plane);
    EXPECT_GT(pixel.y(), 180.0) << static_cast<int>(plane);
  }
}

TEST(Geometry, TheCrosshairChoosesTheSlice) {
  const core::Volume volume = one_bright_voxel(directions()[4].matrix);
  SliceView view(SlicePlane::axial);
  SceneContent content;
  content.volume = volume;
  view.set_content(content);
  view.set_settings(bare_settings(bright_place(volume)));
  const int shown = view.slice();
  EXPECT_EQ(shown, bright[static_cast<std::size_t>(volume.geometry().axis_closest_to(2))]);
  ViewSettings next = bare_settings(view.crosshair_at_slice(shown + 3));
  view.set_settings(next);
  EXPECT_EQ(view.slice(), shown + 3);
  // Three slices on, nothing of the bright voxel is left.
  EXPECT_LT(center_of(draw(view.renderer(), 300, 300), luminance).x(), 0.0);
}

TEST(Geometry, TurningPanningAndZoomingKeepWhatTheyShould) {
  TissueView view;
  SceneContent content;
  content.volume = one_bright_voxel(Eigen::Matrix3d::Identity());
  view.set_content(content);
  const interaction::Camera start = view.camera();
  const double distance = (start.position_mm - start.focal_point_mm).norm();
  view.rotate(35, 20);
  const interaction::Camera turned = view.camera();
  EXPECT_TRUE(turned.focal_point_mm.isApprox(start.focal_point_mm));
  EXPECT_NEAR((turned.position_mm - turned.focal_point_mm).norm(), distance, 1e-9 * distance);
  for (int n = 0; n < 200; ++n) view.rotate(3, 40);  // against the pole, never over it
  EXPECT_GT(view.camera().view_up.z(), 0.0);
  view.zoom(2.0);
  EXPECT_NEAR((view.camera().position_mm - view.camera().focal_point_mm).norm(), 0.5 * distance,
              1e-9 * distance);
  // A pan moves what lies in the focal plane with the mouse.
  const Eigen::Vector3d before = view.camera().focal_point_mm;
  const auto drawing = draw(view.renderer(), 400, 300);
  ASSERT_EQ(drawing.width, 400);
  view.pan(50, -30);
  EXPECT_LT(distance_to(view.ray_at(250, 120), before), 1e-6 * distance);
  view.fit();
  EXPECT_TRUE(view.camera().focal_point_mm.isApprox(start.focal_point_mm));
}
