#include "small_picture.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::imaging::reading {
namespace {

struct Window {
  float low = 0.0F, high = 0.0F;
};

/// Leaves out the rarest values at both ends, which would hide the rest.
Window window_of(const float* slice, std::size_t count) {
  constexpr std::size_t most_looked_at = 65536;
  const std::size_t step = std::max<std::size_t>(1, count / most_looked_at);
  std::vector<float> values;
  for (std::size_t n = 0; n < count; n += step) values.push_back(slice[n]);
  std::sort(values.begin(), values.end());
  const auto at = [&](double part) {
    return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
  };
  constexpr double rare = 0.005;
  const Window window{at(rare), at(1.0 - rare)};
  return window.low < window.high ? window : Window{values.front(), values.back()};
}

/// Pixels [from, to) of the slice that one pixel of the picture stands for.
struct Span {
  int from = 0, to = 1;
};

Span span_of(int pixel, int pixels, int voxels) {
  Span span;
  span.from = static_cast<int>(static_cast<long long>(pixel) * voxels / pixels);
  span.to = static_cast<int>(static_cast<long long>(pixel + 1) * voxels / pixels);
  span.to = std::max(span.to, span.from + 1);
  return span;
}

}  // namespace

SmallPicture small_picture(const float* voxels, const core::ImageGeometry& geometry) {
  const auto& dims = geometry.dims();
  const auto plane = static_cast<std::size_t>(dims[0]) * static_cast<std::size_t>(dims[1]);
  const float* slice = voxels + static_cast<std::size_t>(dims[2] / 2) * plane;
  const double wide = dims[0] * geometry.spacing_mm()[0];
  const double high = dims[1] * geometry.spacing_mm()[1];
  // Never larger than the finer axis gives, so that small pictures stay small.
  const double pixel_mm = std::max(std::max(wide, high) / SmallPicture::most_px,
                                   std::min(geometry.spacing_mm()[0], geometry.spacing_mm()[1]));
  SmallPicture picture;
  picture.width_px = std::clamp(static_cast<int>(std::lround(wide / pixel_mm)), 1, SmallPicture::most_px);
  picture.height_px = std::clamp(static_cast<int>(std::lround(high / pixel_mm)), 1, SmallPicture::most_px);
  const Window window = window_of(slice, plane);
  const double reach = static_cast<double>(window.high) - static_cast<double>(window.low);
  for (int y = 0; y < picture.height_px; ++y) {
    const Span rows = span_of(y, picture.height_px, dims[1]);
    for (int x = 0; x < picture.width_px; ++x) {
      const Span columns = span_of(x, picture.width_px, dims[0]);
      double sum = 0.0;
      for (int j = rows.from; j < rows.to; ++j)
        for (int i = columns.from; i < columns.to; ++i)
          sum += static_cast<double>(slice[static_cast<std::size_t>(j) * static_cast<std::size_t>(dims[0]) +
                                           static_cast<std::size_t>(i)]);
      const double mean =
          sum / (static_cast<double>(rows.to - rows.from) * static_cast<double>(columns.to - columns.from));
      const double bright = reach > 0.0 ? (mean - static_cast<double>(window.low)) / reach : 0.0;
      picture.grey.push_back(static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(bright, 0.0, 1.0))));
    }
  }
  return picture;
}

std::string hex_of(const std::vector<std::uint8_t>& bytes) {
  static constexpr char digits[] = "0123456789abcdef";
  std::string text;
  text.reserve(2 * bytes.size());
  for (const auto byte : bytes) {
    text.push_back(digits[byte >> 4]);
    text.push_back(digits[byte & 15]);
  }
  return text;
}

std::optional<std::vector<std::uint8_t>> bytes_of_hex(const std::string& text) {
  const auto value = [](char digit) {
    if (digit >= '0' && digit <= '9') return digit - '0';
    if (digit >= 'a' && digit <= 'f') return digit - 'a' + 10;
    return -1;
  };
  if (text.size() % 2 != 0) return std::nullopt;
  std::vector<std::uint8_t> bytes;
  for (std::size_t n = 0; n < text.size(); n += 2) {
    const int high = value(text[n]);
    const int low = value(text[n + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    bytes.push_back(static_cast<std::uint8_t>(16 * high + low));
  }
  return bytes;
}

}  // namespace palpate::imaging::reading
