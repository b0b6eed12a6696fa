#pragma once

#include "palette.hpp"

#include <Eigen/Core>

#include <memory>
#include <string>
#include <vector>

class vtkRenderer;

namespace palpate::visualization {

/// Where a viewport lies in the whole view, in pixels from its lower left
/// corner. A view larger than a window is drawn tile by tile.
struct Tile {
  int x = 0;
  int y = 0;
  int width = 500;
  int height = 500;
  int view_width = 500;
  int view_height = 500;
};

/// Letters of `at_scale_one` pixels in a view of this scale: never below 9, the
/// smallest that can be read, and 0 (none) where the view has no room for those.
int legible_px(double at_scale_one, double scale, const Tile& tile);

enum class Align { start, middle, end };

class Overlay;
/// A ring and what it says, dark under light, so that it shows on any ground.
void draw_mark(Overlay& overlay, const Eigen::Vector2d& place, const std::string& words, double scale,
               const Tile& tile);

/// Flat things drawn over a view, in pixels of the whole view, y up: filled
/// shapes first, then text. Laid out anew as a whole between begin() and end();
/// text that did not change keeps its pixels.
class Overlay {
 public:
  explicit Overlay(vtkRenderer& renderer);
  ~Overlay();

  void begin(const Tile& tile);
  void polygon(const std::vector<Eigen::Vector2d>& convex, Rgba color);
  void rectangle(double x0, double y0, double x1, double y1, Rgba color);
  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width_px, Rgba color);

  struct TextStyle {
    int size_px = 13;
    Rgba color = text_color;
    bool bold = false;
    Align horizontal = Align::start;
    Align vertical = Align::start;
    bool halo = true;
  };
  /// Returns the text's width and height.
  Eigen::Vector2d text(const std::string& words, const Eigen::Vector2d& place, const TextStyle& style);
  /// Text whose pixels lie along `across` and `upward` (vectors for one pixel),
  /// its middle at `middle`.
  void text_on_face(const std::string& words, const Eigen::Vector2d& middle, const Eigen::Vector2d& across,
                    const Eigen::Vector2d& upward, const TextStyle& style);
  void end();

  /// Every string of the last layout.
  const std::vector<std::string>& texts() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::visualization
