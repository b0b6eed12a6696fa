#include "palpate/visualization/picture.hpp"

#include "offscreen.hpp"
#include "slice_scene.hpp"
#include "tissue_scene.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

namespace palpate::visualization {
namespace {

constexpr int largest_px = 8192;
constexpr int smallest_px = 16;
/// Larger views are drawn in tiles: it bounds the memory, and some drivers
/// have no larger targets.
constexpr int tile_px = 2048;

enum class Pane { axial, coronal, sagittal, three_d };

/// A view's place in the picture, from its upper left corner.
struct Place {
  Pane pane;
  int x, y, width, height;
};

std::vector<Place> layout_of(const PictureRequest& request) {
  const int w = request.width_px;
  const int h = request.height_px;
  const int gap = std::max(2, static_cast<int>(std::lround(std::min(w, h) / 400.0)));
  const int left = (w - gap) / 2;
  const int right = w - gap - left;
  const int upper = (h - gap) / 2;
  const int lower = h - gap - upper;
  switch (request.view) {
    case PictureView::four_up:
      return {{Pane::axial, 0, 0, left, upper},
              {Pane::three_d, left + gap, 0, right, upper},
              {Pane::sagittal, 0, upper + gap, left, lower},
              {Pane::coronal, left + gap, upper + gap, right, lower}};
    case PictureView::side_by_side:
      return {{Pane::axial, 0, 0, left, h}, {Pane::three_d, left + gap, 0, right, h}};
    case PictureView::three_d:
      return {{Pane::three_d, 0, 0, w, h}};
    case PictureView::axial:
      return {{Pane::axial, 0, 0, w, h}};
    case PictureView::coronal:
      return {{Pane::coronal, 0, 0, w, h}};
    case PictureView::sagittal:
      break;
  }
  return {{Pane::sagittal, 0, 0, w, h}};
}

void check(const PictureRequest& request) {
  for (const int size : {request.width_px, request.height_px})
    if (size < smallest_px || size > largest_px)
      core::throw_usage("A picture of " + std::to_string(request.width_px) + "x" +
                        std::to_string(request.height_px) +
                        " pixels was asked for; width and height must be " + std::to_string(smallest_px) +
                        " to " + std::to_string(largest_px) + ".");
}

SlicePlane plane_of(Pane pane) {
  if (pane == Pane::axial) return SlicePlane::axial;
  return pane == Pane::coronal ? SlicePlane::coronal : SlicePlane::sagittal;
}

/// 1 for a view 500 pixels high; a narrow view goes by its width, so that its
/// corner texts do not run into each other.
double text_scale_of(const Place& place) { return std::min(place.height, place.width) / 500.0; }

template <typename Scene>
void prepare(Scene& scene, const SceneContent& content, const ViewSettings& settings, const Place& place) {
  scene.set_text_scale(text_scale_of(place));
  scene.set_content(content);
  scene.set_settings(settings);
}

/// Runs `use` with the scene of a pane.
template <typename Use>
void with_scene(const Place& place, const SceneContent& content, const ViewSettings& settings,
                const Use& use) {
  if (place.pane == Pane::three_d) {
    TissueScene scene;
    prepare(scene, content, settings, place);
    use(scene);
  } else {
    SliceScene scene(plane_of(place.pane));
    prepare(scene, content, settings, place);
    use(scene);
  }
}

/// Premultiplied pixels, bottom row first, into a picture's straight ones.
void put(core::Picture& picture, const std::vector<std::uint8_t>& rgba, int width, int height, int x0, int y0,
         bool keep_alpha) {
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* from = rgba.data() + static_cast<std::size_t>(height - 1 - y) * width * 4;
    std::uint8_t* to = picture.rgba.data() + (static_cast<std::size_t>(y0 + y) * picture.width_px + x0) * 4;
    for (int x = 0; x < width; ++x, from += 4, to += 4) {
      const int alpha = keep_alpha ? from[3] : 255;
      for (int c = 0; c < 3; ++c) {
        const int straight = alpha > 0 ? (from[c] * 255 + alpha / 2) / alpha : 0;
        to[c] = static_cast<std::uint8_t>(keep_alpha ? std::min(255, straight) : from[c]);
      }
      to[3] = static_cast<std::uint8_t>(alpha);
    }
  }
}

template <typename Scene>
void draw_pane(OffscreenCanvas& canvas, Scene& scene, const Place& place, bool keep_alpha,
               const core::Progress& progress, core::Picture& picture) {
  const double pixels = static_cast<double>(place.width) * place.height;
  double drawn = 0.0;
  for (int y = 0; y < place.height; y += tile_px) {
    for (int x = 0; x < place.width; x += tile_px) {
      progress.report(drawn / pixels, "Drawing");
      Tile tile;
      tile.width = std::min(tile_px, place.width - x);
      tile.height = std::min(tile_px, place.height - y);
      tile.x = x;
      tile.y = place.height - y - tile.height;
      tile.view_width = place.width;
      tile.view_height = place.height;
      scene.set_tile(tile);
      const auto rgba = canvas.draw(*scene.renderer(), tile.width, tile.height);
      put(picture, rgba, tile.width, tile.height, place.x + x, place.y + y, keep_alpha);
      drawn += static_cast<double>(tile.width) * tile.height;
    }
  }
  canvas.release();
}

core::Picture blank(const PictureRequest& request, bool transparent) {
  core::Picture picture;
  picture.width_px = request.width_px;
  picture.height_px = request.height_px;
  const auto pixels =
      static_cast<std::size_t>(request.width_px) * static_cast<std::size_t>(request.height_px);
  picture.rgba.assign(pixels * 4, 0);
  if (transparent) return picture;
  for (std::size_t n = 0; n < pixels; ++n) {
    picture.rgba[4 * n + 0] = gap_color.r;
    picture.rgba[4 * n + 1] = gap_color.g;
    picture.rgba[4 * n + 2] = gap_color.b;
    picture.rgba[4 * n + 3] = 255;
  }
  return picture;
}

}  // namespace

PictureView picture_view_from(const std::string& word) {
  if (word == "four-up") return PictureView::four_up;
  if (word == "side-by-side") return PictureView::side_by_side;
  if (word == "3d") return PictureView::three_d;
  if (word == "axial") return PictureView::axial;
  if (word == "coronal") return PictureView::coronal;
  if (word == "sagittal") return PictureView::sagittal;
  core::throw_usage("There is no view \"" + word +
                    "\"; choose four-up, side-by-side, 3d, axial, coronal or sagittal.");
}

core::Picture draw_picture(const SceneContent& content, const ViewSettings& settings,
                           const PictureRequest& request, const core::Progress& progress) {
  check(request);
  progress.cancel().check();
  core::Picture picture = blank(request, settings.transparent);
  on_own_thread([&] {
    OffscreenCanvas canvas;
    const auto places = layout_of(request);
    for (std::size_t n = 0; n < places.size(); ++n) {
      const Place& place = places[n];
      const auto count = static_cast<double>(places.size());
      const auto part = progress.part(static_cast<double>(n) / count, static_cast<double>(n + 1) / count);
      const bool keep_alpha = settings.transparent && place.pane == Pane::three_d;
      with_scene(place, content, settings,
                 [&](auto& scene) { draw_pane(canvas, scene, place, keep_alpha, part, picture); });
    }
  });
  return picture;
}

std::vector<std::string> burned_in_text(const SceneContent& content, const ViewSettings& settings,
                                        const PictureRequest& request) {
  check(request);
  std::vector<std::string> texts;
  for (const Place& place : layout_of(request)) {
    with_scene(place, content, settings, [&](auto& scene) {
      scene.set_tile({0, 0, place.width, place.height, place.width, place.height});
      scene.lay_out();
      texts.insert(texts.end(), scene.texts().begin(), scene.texts().end());
    });
  }
  return texts;
}

RendererInfo offscreen_renderer() {
  RendererInfo info;
  on_own_thread([&] { info.name = OffscreenCanvas::probe_renderer_name(); });
  for (const char* word : {"llvmpipe", "softpipe", "swrast", "Software", "SWR"})
    if (info.name.find(word) != std::string::npos) info.software = true;
  return info;
}

}  // namespace palpate::visualization
