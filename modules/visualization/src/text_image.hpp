#pragma once

#include "palette.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::visualization {

/// A string as pixels: straight RGBA, bottom row first. `margin_px` of it on
/// each side belong to the halo, not to the text's box.
struct TextImage {
  int width_px = 0;
  int height_px = 0;
  int margin_px = 0;
  std::vector<std::uint8_t> rgba;
};

/// Draws a line of text `size_px` high with a dark halo, legible on bright
/// speckle. The size does not depend on the screen's dots per inch. The font
/// library is not safe for two threads; calls wait for each other here.
TextImage draw_text(const std::string& text, int size_px, Rgba color, bool bold, bool halo);

/// A plain sans serif of the system, or its bold face; empty where there is none.
std::string font_file(bool bold);

}  // namespace palpate::visualization
