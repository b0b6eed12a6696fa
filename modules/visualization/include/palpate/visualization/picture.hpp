#pragma once

#include "palpate/core/picture.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/visualization/scene.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::visualization {

enum class PictureView { four_up, side_by_side, three_d, axial, coronal, sagittal };
/// "four-up", "side-by-side", "3d", "axial", "coronal", "sagittal"; Error(usage) else.
PictureView picture_view_from(const std::string& word);

struct PictureRequest {
  int width_px = 1600;  ///< 16..8192
  int height_px = 1200;
  PictureView view = PictureView::four_up;
};

/// Draws offscreen, at the real size (never enlarged), without an X server:
/// a surfaceless EGL context, software or not. Text, lines and the scale bar
/// grow with the picture. Throws Error(usage) for a size out of range,
/// Error(internal, "no-renderer") with the driver's words where there is none.
/// Any thread, one at a time per process. Before each tile of at most 2048
/// pixels it reports its progress, from the thread that draws while the caller
/// waits, and there it can be cancelled: Error(cancelled).
core::Picture draw_picture(const SceneContent& content, const ViewSettings& settings,
                           const PictureRequest& request, const core::Progress& progress = {});
/// Every string that the picture burns in, for the export dialog.
std::vector<std::string> burned_in_text(const SceneContent& content, const ViewSettings& settings,
                                        const PictureRequest& request);

/// PNG; written beside its target and renamed. Throws Error(output).
void save_png(const std::filesystem::path& path, const core::Picture& picture);
/// "llvmpipe (LLVM 15...)" or the GPU's name, and whether it is software.
struct RendererInfo {
  std::string name;
  bool software = false;
};
RendererInfo offscreen_renderer();

}  // namespace palpate::visualization
