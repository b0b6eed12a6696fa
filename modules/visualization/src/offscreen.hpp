#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

class vtkRenderer;

namespace palpate::visualization {

/// A GL context without a window or X server, current on the thread that made
/// it, and a VTK window that draws into memory. Made, used and ended on one
/// thread that has no other GL context (see on_own_thread).
class OffscreenCanvas {
 public:
  /// Throws Error(internal, "no-renderer") with the driver's words.
  OffscreenCanvas();
  ~OffscreenCanvas();
  OffscreenCanvas(const OffscreenCanvas&) = delete;
  OffscreenCanvas& operator=(const OffscreenCanvas&) = delete;

  /// GL_RENDERER of such a context, without a window.
  static std::string probe_renderer_name();
  /// Draws; RGBA, bottom row first, alpha premultiplied. What the renderer laid
  /// into the driver's memory stays there for its next drawing.
  std::vector<std::uint8_t> draw(vtkRenderer& renderer, int width_px, int height_px);
  /// Lets go of the renderer that was drawn last.
  void release();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Runs `work` on a thread of its own and waits: the caller's GL context, of
/// whatever kind, stays current for the caller. One at a time in the process.
void on_own_thread(const std::function<void()>& work);

}  // namespace palpate::visualization
