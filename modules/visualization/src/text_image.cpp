#include "text_image.hpp"

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkStdString.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>

#include <algorithm>
#include <filesystem>
#include <mutex>

namespace palpate::visualization {
namespace {

/// How much of each pixel the letters cover, 0..255.
struct Coverage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> value;
};

/// A plain sans serif where the system has one; VTK's own face is too light
/// and too round to be read at this size.
const std::string& plain_font_file() {
  static const std::string file = [] {
    for (const char* candidate :
         {"/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
          "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf", "/usr/share/fonts/TTF/DejaVuSans.ttf",
          "/usr/share/fonts/truetype/liberation/LiberationSans-Regular.ttf"}) {
      std::error_code ignored;
      if (std::filesystem::is_regular_file(candidate, ignored)) return std::string(candidate);
    }
    return std::string();
  }();
  return file;
}

/// The bold face beside a plain one, else the plain one.
std::string bold_of(const std::string& plain) {
  const std::filesystem::path path(plain);
  std::string stem = path.stem().string();
  if (const auto cut = stem.find("-Regular"); cut != std::string::npos) stem.erase(cut);
  const std::filesystem::path bold = path.parent_path() / (stem + "-Bold" + path.extension().string());
  std::error_code ignored;
  return std::filesystem::is_regular_file(bold, ignored) ? bold.string() : plain;
}

Coverage letters_of(const std::string& text, int size_px, bool bold) {
  static std::mutex one_at_a_time;
  const std::lock_guard<std::mutex> lock(one_at_a_time);
  vtkNew<vtkTextProperty> property;
  property->SetFontFamilyToArial();
  if (const std::string file = font_file(bold); !file.empty()) {
    property->SetFontFamily(VTK_FONT_FILE);
    property->SetFontFile(file.c_str());
  }
  property->SetFontSize(size_px);
  property->SetBold(bold ? 1 : 0);
  property->SetColor(1.0, 1.0, 1.0);
  vtkNew<vtkImageData> image;
  int dims[2] = {0, 0};
  constexpr int dots_per_inch = 72;  // a point is then a pixel
  vtkTextRenderer* renderer = vtkTextRenderer::GetInstance();
  if (renderer == nullptr ||
      !renderer->RenderString(property, vtkStdString(text), image, dims, dots_per_inch))
    return {};
  Coverage coverage;
  const int* extent = image->GetExtent();
  coverage.width = std::min(dims[0], extent[1] - extent[0] + 1);
  coverage.height = std::min(dims[1], extent[3] - extent[2] + 1);
  if (coverage.width <= 0 || coverage.height <= 0 || image->GetNumberOfScalarComponents() != 4) return {};
  for (int y = 0; y < coverage.height; ++y) {
    for (int x = 0; x < coverage.width; ++x) {
      const auto* pixel =
          static_cast<const std::uint8_t*>(image->GetScalarPointer(extent[0] + x, extent[2] + y, 0));
      coverage.value.push_back(pixel[3]);
    }
  }
  return coverage;
}

/// Box blur along one axis, `stride` apart; the ends count as empty.
void blur(std::vector<int>& values, int count, int lines, int stride, int line_stride, int radius) {
  std::vector<int> line(static_cast<std::size_t>(count));
  for (int l = 0; l < lines; ++l) {
    int* start = values.data() + l * line_stride;
    for (int n = 0; n < count; ++n) {
      int sum = 0;
      for (int m = std::max(0, n - radius); m <= std::min(count - 1, n + radius); ++m)
        sum += start[m * stride];
      line[static_cast<std::size_t>(n)] = sum / (2 * radius + 1);
    }
    for (int n = 0; n < count; ++n) start[n * stride] = line[static_cast<std::size_t>(n)];
  }
}

}  // namespace

std::string font_file(bool bold) {
  const std::string& plain = plain_font_file();
  return bold && !plain.empty() ? bold_of(plain) : plain;
}

TextImage draw_text(const std::string& text, int size_px, Rgba color, bool bold, bool halo) {
  const Coverage letters = letters_of(text, size_px, bold);
  TextImage image;
  if (letters.value.empty()) return image;
  const int radius = std::max(1, size_px / 9);
  image.margin_px = 2 * radius;
  image.width_px = letters.width + 2 * image.margin_px;
  image.height_px = letters.height + 2 * image.margin_px;
  const auto pixels = static_cast<std::size_t>(image.width_px) * static_cast<std::size_t>(image.height_px);
  std::vector<int> cover(pixels, 0);
  for (int y = 0; y < letters.height; ++y)
    for (int x = 0; x < letters.width; ++x)
      cover[static_cast<std::size_t>((y + image.margin_px) * image.width_px + x + image.margin_px)] =
          letters.value[static_cast<std::size_t>(y * letters.width + x)];
  std::vector<int> shade = cover;
  for (int pass = 0; pass < 2; ++pass) {
    blur(shade, image.width_px, image.height_px, 1, image.width_px, radius);
    blur(shade, image.height_px, image.width_px, image.width_px, 1, radius);
  }
  image.rgba.resize(pixels * 4);
  for (std::size_t n = 0; n < pixels; ++n) {
    // Letters over their halo, as straight (not premultiplied) colour.
    const double top = cover[n] / 255.0;
    const double under = halo ? std::min(0.85, 2.2 * shade[n] / 255.0) : 0.0;
    const double alpha = top + under * (1.0 - top);
    const double share = alpha > 0.0 ? top / alpha : 1.0;
    image.rgba[4 * n + 0] = static_cast<std::uint8_t>(color.r * share + 0.5);
    image.rgba[4 * n + 1] = static_cast<std::uint8_t>(color.g * share + 0.5);
    image.rgba[4 * n + 2] = static_cast<std::uint8_t>(color.b * share + 0.5);
    image.rgba[4 * n + 3] = static_cast<std::uint8_t>(alpha * color.a + 0.5);
  }
  return image;
}

}  // namespace palpate::visualization
