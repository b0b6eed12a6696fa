#include "palette.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::visualization {
namespace {

constexpr double pi = 3.14159265358979323846;

std::uint8_t srgb_byte(double linear) {
  const double c = std::clamp(linear, 0.0, 1.0);
  const double encoded = c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1.0 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(encoded * 255.0));
}

/// OKLCH (Ottosson 2020) to sRGB: lightness in [0, 1], hue in degrees.
Rgba from_oklch(double lightness, double chroma, double hue_deg) {
  const double a = chroma * std::cos(hue_deg * pi / 180.0);
  const double b = chroma * std::sin(hue_deg * pi / 180.0);
  const double l = std::pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3);
  const double m = std::pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3);
  const double s = std::pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3);
  return {srgb_byte(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
          srgb_byte(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
          srgb_byte(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s), 255};
}

double mix(double from, double to, double t) { return from + (to - from) * t; }

}  // namespace

Rgba plane_color(SlicePlane plane) {
  switch (plane) {
    case SlicePlane::axial:
      return {228, 88, 76, 255};
    case SlicePlane::sagittal:
      return {230, 200, 79, 255};
    case SlicePlane::coronal:
      break;
  }
  return {111, 182, 87, 255};
}

Rgba flesh_color(double t) {
  const double u = std::clamp(t, 0.0, 1.0);
  return from_oklch(mix(0.50, 0.85, u), mix(0.125, 0.065, u), mix(27.0, 58.0, u));
}

Rgba ember_color(double t) {
  const double u = std::clamp(t, 0.0, 1.0);
  // The hue turns from violet (-60 degrees) through red to sand; the chroma
  // is largest in the middle, where the screen's gamut is widest.
  return from_oklch(mix(0.36, 0.93, u), 0.08 + 0.10 * std::sin(pi * std::min(1.0, u * 1.02)),
                    mix(-62.0, 88.0, u));
}

float quantile(const float* values, std::size_t count, double fraction) {
  if (count == 0) return 0.0F;
  const std::size_t stride = std::max<std::size_t>(1, count / 1000000);
  std::vector<float> sample;
  sample.reserve(count / stride + 1);
  for (std::size_t n = 0; n < count; n += stride) sample.push_back(values[n]);
  const auto rank = static_cast<std::size_t>(fraction * static_cast<double>(sample.size() - 1));
  const auto place = sample.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(sample.begin(), place, sample.end());
  return *place;
}

std::vector<std::uint8_t> map_colors(const std::vector<float>& values, Rgba (*map)(double)) {
  const float low = quantile(values.data(), values.size(), 0.02);
  const float high = quantile(values.data(), values.size(), 0.98);
  std::array<Rgba, 256> table;
  for (std::size_t n = 0; n < table.size(); ++n) table[n] = map(static_cast<double>(n) / 255.0);
  std::vector<std::uint8_t> colors;
  colors.reserve(values.size() * 3);
  for (const float value : values) {
    const float t = high > low ? std::clamp((value - low) / (high - low), 0.0F, 1.0F) : 0.5F;
    const Rgba& color = table[static_cast<std::size_t>(std::lround(t * 255.0F))];
    colors.insert(colors.end(), {color.r, color.g, color.b});
  }
  return colors;
}

}  // namespace palpate::visualization
