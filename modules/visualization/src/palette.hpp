#pragma once

#include "palpate/visualization/scene.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::visualization {

struct Rgba {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
  std::uint8_t a = 255;
};

inline constexpr Rgba text_color{230, 232, 235, 255};
inline constexpr Rgba quiet_text_color{178, 186, 195, 255};
inline constexpr Rgba accent_color{47, 179, 166, 255};
inline constexpr Rgba held_color{232, 64, 52, 255};
inline constexpr Rgba grab_color{232, 240, 246, 255};
inline constexpr Rgba anchor_color{112, 184, 255, 255};
inline constexpr Rgba anchor_rim_color{8, 22, 38, 255};
inline constexpr Rgba mark_color{255, 208, 64, 255};
inline constexpr Rgba gap_color{12, 14, 16, 255};

constexpr Rgba with_alpha(Rgba color, std::uint8_t alpha) { return {color.r, color.g, color.b, alpha}; }

/// Axial red, sagittal yellow, coronal green, as in the field's programs.
Rgba plane_color(SlicePlane plane);

/// Colour maps of t in [0, 1]; lightness grows evenly with t, so that they
/// keep their order in grey print and for colour-blind eyes.
Rgba flesh_color(double t);  ///< dark muscle to pale tissue: the surface
Rgba ember_color(double t);  ///< violet over coral to sand: points and links

/// Values mapped once to RGB triples. The ends of the map are the 2 % and
/// 98 % quantiles of `values`, so that single specks do not flatten it.
std::vector<std::uint8_t> map_colors(const std::vector<float>& values, Rgba (*map)(double));

/// The value below which a fraction of `values` lies, from at most a million
/// of them evenly spread. 0 for none.
float quantile(const float* values, std::size_t count, double fraction);

}  // namespace palpate::visualization
