#include "palpate/visualization/picture.hpp"

#include "drawing.hpp"

#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"
#include "palpate/visualization/tissue_view.hpp"

#include <gtest/gtest.h>

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>
#include <thread>

using namespace palpate;
using namespace palpate::visualization;
using palpate::testing::octahedron;

namespace {

SceneContent content() {
  const core::ImageGeometry geometry({30, 40, 35}, {1.0, 0.8, 1.2}, {-15, -16, -21});
  std::vector<float> voxels(geometry.voxel_count());
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const Eigen::Vector3d place = geometry.to_lps_mm(
        Eigen::Map<const Eigen::Array3i>(geometry.ijk_of(n).data()).cast<double>().matrix());
    voxels[n] = static_cast<float>(20.0 + 120.0 * std::exp(-std::pow(place.norm() - 9.0, 2) / 8.0));
  }
  SceneContent content;
  content.volume = {geometry, std::move(voxels)};
  content.spacing_badge = "stated";
  content.orientation_known = true;
  content.mesh = octahedron(Eigen::Vector3d::Zero(), 10.0);
  return content;
}

const std::uint8_t* pixel(const core::Picture& picture, int x, int y) {
  return picture.rgba.data() + 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width_px) +
                                    static_cast<std::size_t>(x));
}

std::size_t different_pixels(const core::Picture& a, const core::Picture& b) {
  std::size_t count = 0;
  for (std::size_t n = 0; n < a.rgba.size(); n += 4)
    if (!std::equal(a.rgba.begin() + static_cast<std::ptrdiff_t>(n),
                    a.rgba.begin() + static_cast<std::ptrdiff_t>(n) + 4,
                    b.rgba.begin() + static_cast<std::ptrdiff_t>(n)))
      ++count;
  return count;
}

core::Picture picture_of(const SceneContent& content, const ViewSettings& settings, PictureView view,
                         int width = 320, int height = 240) {
  return draw_picture(content, settings, {width, height, view});
}

/// Rows that the title "Axial" takes: red letters in the upper left corner.
int title_height(const core::Picture& picture) {
  const int inset = picture.height_px / 100;  // beyond the red frame
  int first = -1;
  int last = -1;
  for (int y = inset; y < picture.height_px / 8; ++y) {
    for (int x = inset; x < picture.width_px / 8; ++x) {
      const std::uint8_t* p = pixel(picture, x, y);
      if (p[0] < 150 || p[1] > 130) continue;
      if (first < 0) first = y;
      last = y;
    }
  }
  return first < 0 ? 0 : last - first + 1;
}

}  // namespace

TEST(Picture, StopsBetweenTilesWhenItIsCancelled) {
  const SceneContent scene = content();
  const core::CancelToken cancel;
  std::vector<double> reports;
  const core::Progress progress(
      [&](double fraction, const std::string&) {
        reports.push_back(fraction);
        if (reports.size() == 2) cancel.cancel();  // while the second of four tiles is begun
      },
      cancel);
  // One view of two by two tiles.
  const PictureRequest request{2050, 2050, PictureView::axial};
  try {
    draw_picture(scene, standard_settings(scene.volume), request, progress);
    ADD_FAILURE() << "it was drawn to the end";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::cancelled);
  }
  ASSERT_EQ(reports.size(), 2U) << "the third tile was not begun";
  EXPECT_EQ(reports[0], 0.0);
  EXPECT_GT(reports[1], 0.5) << "a tile of 2048 of 2050 pixels square is half and more";
}

TEST(Picture, HasTheAskedSizeAndIsNotBlank) {
  const SceneContent scene = content();
  const ViewSettings settings = standard_settings(scene.volume);
  for (const auto& [width, height] :
       {std::pair{640, 480}, {1600, 1200}, {8192, 512}, {16, 16}, {301, 1999}}) {
    const core::Picture picture = draw_picture(scene, settings, {width, height, PictureView::four_up});
    EXPECT_EQ(picture.width_px, width);
    EXPECT_EQ(picture.height_px, height);
    ASSERT_EQ(picture.rgba.size(), static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 4);
    std::set<int> colors;
    for (std::size_t n = 0; n < picture.rgba.size(); n += 4) {
      colors.insert(picture.rgba[n] << 16 | picture.rgba[n + 1] << 8 | picture.rgba[n + 2]);
      ASSERT_EQ(picture.rgba[n + 3], 255);
    }
    EXPECT_GT(colors.size(), 20U) << width << "x" << height;
  }
}

TEST(Picture, IsTheSameTwice) {
  const SceneContent scene = content();
  const ViewSettings settings = standard_settings(scene.volume);
  EXPECT_EQ(picture_of(scene, settings, PictureView::four_up).rgba,
            picture_of(scene, settings, PictureView::four_up).rgba);
}

TEST(Picture, DrawnInTilesIsOnePicture) {
  // 2400 pixels take two tiles. The same view in one tile, 1200 pixels, has
  // the same things at the same places: halved, they agree but at thin lines.
  const SceneContent scene = content();
  ViewSettings settings = standard_settings(scene.volume);
  settings.annotations = false;
  for (const PictureView view : {PictureView::axial, PictureView::three_d}) {
    const core::Picture large = picture_of(scene, settings, view, 2400, 2400);
    const core::Picture small = picture_of(scene, settings, view, 1200, 1200);
    std::size_t far = 0;
    for (int y = 0; y < 1200; ++y) {
      for (int x = 0; x < 1200; ++x) {
        const int mean = (pixel(large, 2 * x, 2 * y)[1] + pixel(large, 2 * x + 1, 2 * y)[1] +
                          pixel(large, 2 * x, 2 * y + 1)[1] + pixel(large, 2 * x + 1, 2 * y + 1)[1]) /
                         4;
        if (std::abs(mean - pixel(small, x, y)[1]) > 12) ++far;
      }
    }
    // Edges, crosshair and frame: some 20 lines of 1200 pixels out of 1.4 million.
    EXPECT_LT(far, 24000U) << static_cast<int>(view);
  }
}

TEST(Picture, TextGrowsWithIt) {
  const SceneContent scene = content();
  const ViewSettings settings = standard_settings(scene.volume);
  const double at_600 = title_height(picture_of(scene, settings, PictureView::axial, 800, 600)) / 600.0;
  const double at_1200 = title_height(picture_of(scene, settings, PictureView::axial, 1600, 1200)) / 1200.0;
  const double at_3000 = title_height(picture_of(scene, settings, PictureView::axial, 4000, 3000)) / 3000.0;
  ASSERT_GT(at_600, 0.01);
  EXPECT_NEAR(at_1200 / at_600, 1.0, 0.1);
  EXPECT_NEAR(at_3000 / at_600, 1.0, 0.1);
}

TEST(Picture, IsTransparentAround3D) {
  const SceneContent scene = content();
  ViewSettings settings = standard_settings(scene.volume);
  settings.transparent = true;
  settings.annotations = false;
  const core::Picture picture = picture_of(scene, settings, PictureView::three_d);
  EXPECT_EQ(pixel(picture, 2, 2)[3], 0);
  const std::uint8_t* middle = pixel(picture, 160, 120);
  EXPECT_EQ(middle[3], 255);
  EXPECT_GT(middle[0], middle[2]);  // flesh, not ground
  settings.transparent = false;
  settings.use_gradient = false;
  settings.background = {1.0F, 1.0F, 1.0F};
  EXPECT_EQ(pixel(picture_of(scene, settings, PictureView::three_d), 2, 2)[1], 255);
}

TEST(Picture, WindowAndLevelChangeTheGreyLinearly) {
  SceneContent scene = content();
  scene.mesh = nullptr;
  std::vector<float> flat(scene.volume.size(), 80.0F);
  scene.volume = {scene.volume.geometry(), flat};
  ViewSettings settings;
  settings.show_crosshair = settings.annotations = false;
  const auto grey = [&](double window, double level) {
    settings.window = window;
    settings.level = level;
    return static_cast<int>(pixel(picture_of(scene, settings, PictureView::axial), 160, 120)[0]);
  };
  // (80 - (level - window / 2)) / window of 255, to one level of rounding.
  EXPECT_NEAR(grey(160, 80), 128, 1);
  EXPECT_NEAR(grey(100, 100), 77, 1);
  EXPECT_EQ(grey(20, 200), 0);
  EXPECT_EQ(grey(20, 20), 255);
}

TEST(Picture, TheCrosshairMovesWithItsPlace) {
  const SceneContent scene = content();
  ViewSettings settings = standard_settings(scene.volume);
  settings.annotations = false;
  const auto yellow_column = [&](double x_mm) {
    settings.crosshair_mm.x() = x_mm;
    const core::Picture picture = picture_of(scene, settings, PictureView::axial);
    int best = -1;
    int most = 0;
    for (int x = 4; x < 316; ++x) {
      int count = 0;
      for (int y = 4; y < 236; ++y) {
        const std::uint8_t* p = pixel(picture, x, y);
        if (p[0] > p[2] + 50 && p[1] > p[2] + 40) ++count;
      }
      if (count > most) {
        most = count;
        best = x;
      }
    }
    return best;
  };
  const int left = yellow_column(-5.0);
  const int right = yellow_column(5.0);
  ASSERT_GT(left, 0);
  // The slice is 32 mm high (40 rows of 0.8 mm) and fills 240 pixels with a margin of 4 %.
  EXPECT_NEAR(right - left, 10.0 * 240.0 / (32.0 * 1.04), 1.5);
}

TEST(Picture, HeldPointsAndTheGrabAreShown) {
  SceneContent scene = content();
  const ViewSettings settings = standard_settings(scene.volume);
  const core::Picture before = picture_of(scene, settings, PictureView::four_up);
  scene.grab = GrabMarker{Eigen::Vector3d(8, -8, 6), 4.0};
  EXPECT_GT(different_pixels(before, picture_of(scene, settings, PictureView::four_up)), 100U);
  auto tissue = std::make_shared<model::Tissue>();
  tissue->points.positions_mm = {{0, 0, 0}, {8, 0, 0}, {0, 0, 9}};
  tissue->points.intensities = {1, 2, 3};
  tissue->links.pairs = {{0, 1}, {0, 2}};
  scene.grab.reset();
  scene.tissue = tissue;
  ViewSettings points = settings;
  for (const Show show : {Show::points, Show::links}) {
    points.show = show;
    scene.held_points = {};
    const core::Picture loose = picture_of(scene, points, PictureView::three_d);
    scene.held_points = {1, 77};  // 77 does not exist
    EXPECT_GT(different_pixels(loose, picture_of(scene, points, PictureView::three_d)), 4U);
    EXPECT_GT(different_pixels(loose, before), 4U);
  }
}

TEST(Picture, TheDeformedSurfacesMemoryIsDrawnItself) {
  SceneContent scene = content();
  const auto fill = [&](surface::DeformedSurface& surface, const Eigen::Vector3f& shift) {
    for (std::size_t n = 0; n < surface.vertex_count(); ++n) {
      Eigen::Map<Eigen::Vector3f>(surface.vertices() + 3 * n) = scene.mesh->vertices_mm[n] + shift;
      Eigen::Map<Eigen::Vector3f>(surface.normals() + 3 * n) = scene.mesh->normals[n];
    }
  };
  const std::size_t count = scene.mesh->vertices_mm.size();
  const auto draw_tissue = [](TissueView& view) {
    return palpate::testing::draw(view.renderer(), 200, 150).rgba;
  };
  const auto rest = std::make_shared<surface::DeformedSurface>(count);
  fill(*rest, Eigen::Vector3f::Zero());
  const auto moved = std::make_shared<surface::DeformedSurface>(count);
  fill(*moved, {4, 0, 0});

  TissueView view;
  scene.deformed = rest;
  view.set_content(scene);
  const auto at_rest = draw_tissue(view);
  scene.deformed = moved;
  view.set_content(scene);
  const auto after = draw_tissue(view);
  EXPECT_NE(after, at_rest);

  // Written after set_content and before the first drawing: a copy would not know.
  TissueView other;
  scene.deformed = rest;
  other.set_content(scene);
  fill(*rest, {4, 0, 0});
  EXPECT_EQ(draw_tissue(other), after);
}

TEST(Picture, ASurfaceOfAnotherMeshIsNotDrawn) {
  SceneContent scene = content();
  const ViewSettings settings = standard_settings(scene.volume);
  const core::Picture rest = picture_of(scene, settings, PictureView::four_up);
  scene.deformed = std::make_shared<surface::DeformedSurface>(scene.mesh->vertices_mm.size() + 5);
  EXPECT_EQ(picture_of(scene, settings, PictureView::four_up).rgba, rest.rgba);
}

TEST(Picture, NothingToDrawIsNoError) {
  const core::Picture picture = picture_of({}, {}, PictureView::four_up);
  EXPECT_EQ(picture.width_px, 320);
}

TEST(Picture, AFlatImageIsShownInEveryView) {
  SceneContent scene;
  scene.volume = {core::ImageGeometry({40, 30, 1}, {0.5, 0.5, 1.0}, {0, 0, 0}),
                  std::vector<float>(1200, 90.0F)};
  ViewSettings settings;
  settings.crosshair_mm = scene.volume.geometry().center_mm();
  settings.annotations = settings.show_crosshair = false;
  for (const PictureView view : {PictureView::axial, PictureView::coronal, PictureView::sagittal}) {
    const core::Picture picture = picture_of(scene, settings, view);
    EXPECT_NEAR(pixel(picture, 160, 120)[0], 90, 1) << static_cast<int>(view);
  }
}

TEST(Picture, LeavesTheCallersContextAloneAndSaysNothing) {
  EGLDisplay display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  ASSERT_EQ(eglInitialize(display, nullptr, nullptr), EGL_TRUE);
  ASSERT_EQ(eglBindAPI(EGL_OPENGL_API), EGL_TRUE);
  const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  ASSERT_EQ(eglChooseConfig(display, wanted, &config, 1, &count), EGL_TRUE);
  EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, nullptr);
  ASSERT_EQ(eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context), EGL_TRUE);
  const SceneContent scene = content();
  ::testing::internal::CaptureStderr();
  picture_of(scene, standard_settings(scene.volume), PictureView::four_up);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(eglGetCurrentContext(), context);
  eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display, context);
}

TEST(Picture, CanBeDrawnFromAnyThread) {
  const SceneContent scene = content();
  const ViewSettings settings = standard_settings(scene.volume);
  const core::Picture here = picture_of(scene, settings, PictureView::side_by_side);
  core::Picture one;
  core::Picture two;
  std::thread first([&] { one = picture_of(scene, settings, PictureView::side_by_side); });
  std::thread second([&] { two = picture_of(scene, settings, PictureView::side_by_side); });
  first.join();
  second.join();
  EXPECT_EQ(one.rgba, here.rgba);
  EXPECT_EQ(two.rgba, here.rgba);
}

TEST(Renderer, IsNamed) {
  const RendererInfo info = offscreen_renderer();
  EXPECT_FALSE(info.name.empty());
  EXPECT_EQ(info.software || info.name.find("llvmpipe") == std::string::npos, true) << info.name;
}

TEST(Renderer, SaysWhatIsMissingWhereNothingDraws) {
  // This program again, with no EGL driver to be found: the test above then fails with the message.
  const auto result = palpate::testing::run_program(
      "/usr/bin/env",
      {"__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent",
       (palpate::testing::program_folder() / "test_render").string(), "--gtest_filter=Renderer.IsNamed"});
  EXPECT_EQ(result.signal, 0);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.out.find("no OpenGL driver"), std::string::npos) << result.out;
}
