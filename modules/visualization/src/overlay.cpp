#include "overlay.hpp"

#include "text_image.hpp"

#include <vtkActor2D.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper2D.h>
#include <vtkProperty2D.h>
#include <vtkRenderer.h>
#include <vtkTexture.h>
#include <vtkTexturedActor2D.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>

namespace palpate::visualization {
namespace {

/// One string on a textured quad.
struct Label {
  Label() {
    points->SetDataTypeToFloat();
    points->SetNumberOfPoints(4);
    coordinates->SetNumberOfComponents(2);
    coordinates->SetNumberOfTuples(4);
    const float corner[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    for (int n = 0; n < 4; ++n) coordinates->SetTuple(n, corner[n]);
    vtkNew<vtkCellArray> quad;
    const vtkIdType ids[4] = {0, 1, 2, 3};
    quad->InsertNextCell(4, ids);
    data->SetPoints(points);
    data->SetPolys(quad);
    data->GetPointData()->SetTCoords(coordinates);
    mapper->SetInputData(data);
    texture->SetInputData(image);
    texture->InterpolateOn();
    texture->EdgeClampOn();
    actor->SetMapper(mapper);
    actor->SetTexture(texture);
  }

  void show(const TextImage& pixels) {
    image->SetDimensions(pixels.width_px, pixels.height_px, 1);
    image->AllocateScalars(VTK_UNSIGNED_CHAR, 4);
    std::memcpy(image->GetScalarPointer(), pixels.rgba.data(), pixels.rgba.size());
    image->Modified();
  }

  std::string words;
  std::tuple<int, int, int, int, int, bool, bool> look{};
  int width_px = 0;
  int height_px = 0;
  int margin_px = 0;
  vtkNew<vtkPoints> points;
  vtkNew<vtkFloatArray> coordinates;
  vtkNew<vtkPolyData> data;
  vtkNew<vtkImageData> image;
  vtkNew<vtkTexture> texture;
  vtkNew<vtkPolyDataMapper2D> mapper;
  vtkNew<vtkTexturedActor2D> actor;
};

double aligned(double place, double length, Align align) {
  if (align == Align::start) return place;
  return align == Align::middle ? place - 0.5 * length : place - length;
}

}  // namespace

int legible_px(double at_scale_one, double scale, const Tile& tile) {
  constexpr int smallest_readable = 9;
  constexpr int smallest_view = 150;
  if (std::min(tile.view_width, tile.view_height) < smallest_view) return 0;
  return std::max(smallest_readable, static_cast<int>(std::lround(at_scale_one * scale)));
}

struct Overlay::Impl {
  explicit Impl(vtkRenderer& target) : renderer(target) {
    colors->SetNumberOfComponents(4);
    points->SetDataTypeToFloat();
    shapes->SetPoints(points);
    shapes->SetPolys(polygons);
    shapes->GetPointData()->SetScalars(colors);
    mapper->SetInputData(shapes);
    mapper->ScalarVisibilityOn();
    actor->SetMapper(mapper);
    renderer.AddActor2D(actor);
  }

  /// The next label of this layout, with the pixels of `words`; null for empty ones.
  Label* label_for(const std::string& words, const TextStyle& style) {
    const std::tuple<int, int, int, int, int, bool, bool> look{
        style.size_px, style.color.r, style.color.g, style.color.b, style.color.a, style.bold, style.halo};
    if (used == labels.size()) {
      labels.push_back(std::make_unique<Label>());
      renderer.AddActor2D(labels.back()->actor);
    }
    Label& label = *labels[used];
    if (label.words != words || label.look != look || label.width_px == 0) {
      const TextImage pixels = draw_text(words, style.size_px, style.color, style.bold, style.halo);
      if (pixels.rgba.empty()) return nullptr;
      label.words = words;
      label.look = look;
      label.width_px = pixels.width_px;
      label.height_px = pixels.height_px;
      label.margin_px = pixels.margin_px;
      label.show(pixels);
    }
    ++used;
    texts.push_back(words);
    return &label;
  }

  void place(Label& label, const Eigen::Vector2d& origin, const Eigen::Vector2d& across,
             const Eigen::Vector2d& upward) const {
    const Eigen::Vector2d w = across * label.width_px;
    const Eigen::Vector2d h = upward * label.height_px;
    const Eigen::Vector2d corners[4] = {origin, origin + w, origin + w + h, origin + h};
    for (int n = 0; n < 4; ++n)
      label.points->SetPoint(n, corners[n].x() - tile.x, corners[n].y() - tile.y, 0.0);
    label.points->Modified();
    label.data->Modified();
    label.actor->VisibilityOn();
  }

  vtkRenderer& renderer;
  Tile tile;
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> polygons;
  vtkNew<vtkUnsignedCharArray> colors;
  vtkNew<vtkPolyData> shapes;
  vtkNew<vtkPolyDataMapper2D> mapper;
  vtkNew<vtkActor2D> actor;
  std::vector<std::unique_ptr<Label>> labels;
  std::size_t used = 0;
  std::vector<std::string> texts;
};

Overlay::Overlay(vtkRenderer& renderer) : impl_(std::make_unique<Impl>(renderer)) {}
Overlay::~Overlay() = default;

void Overlay::begin(const Tile& tile) {
  impl_->tile = tile;
  impl_->points->Reset();
  impl_->polygons->Reset();
  impl_->colors->Reset();
  impl_->used = 0;
  impl_->texts.clear();
}

void Overlay::polygon(const std::vector<Eigen::Vector2d>& convex, Rgba color) {
  // A fan of triangles: the 2-D mapper cuts larger polygons anew at every draw.
  const vtkIdType first = impl_->points->GetNumberOfPoints();
  for (const Eigen::Vector2d& corner : convex) {
    impl_->points->InsertNextPoint(corner.x() - impl_->tile.x, corner.y() - impl_->tile.y, 0.0);
    const unsigned char rgba[4] = {color.r, color.g, color.b, color.a};
    impl_->colors->InsertNextTypedTuple(rgba);
  }
  for (vtkIdType n = 1; n + 1 < static_cast<vtkIdType>(convex.size()); ++n) {
    const vtkIdType triangle[3] = {first, first + n, first + n + 1};
    impl_->polygons->InsertNextCell(3, triangle);
  }
}

void Overlay::rectangle(double x0, double y0, double x1, double y1, Rgba color) {
  polygon({{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}, color);
}

void Overlay::line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width_px, Rgba color) {
  const Eigen::Vector2d along = to - from;
  const double length = along.norm();
  if (!(length > 0.0)) return;
  const Eigen::Vector2d side = Eigen::Vector2d(-along.y(), along.x()) * (0.5 * width_px / length);
  polygon({from - side, to - side, to + side, from + side}, color);
}

Eigen::Vector2d Overlay::text(const std::string& words, const Eigen::Vector2d& place,
                              const TextStyle& style) {
  Label* label = impl_->label_for(words, style);
  if (label == nullptr) return Eigen::Vector2d::Zero();
  const Eigen::Vector2d size(label->width_px - 2 * label->margin_px, label->height_px - 2 * label->margin_px);
  // On whole pixels, so that letters stay sharp.
  const Eigen::Vector2d origin(std::round(aligned(place.x(), size.x(), style.horizontal)) - label->margin_px,
                               std::round(aligned(place.y(), size.y(), style.vertical)) - label->margin_px);
  impl_->place(*label, origin, Eigen::Vector2d::UnitX(), Eigen::Vector2d::UnitY());
  return size;
}

void Overlay::text_on_face(const std::string& words, const Eigen::Vector2d& middle,
                           const Eigen::Vector2d& across, const Eigen::Vector2d& upward,
                           const TextStyle& style) {
  Label* label = impl_->label_for(words, style);
  if (label == nullptr) return;
  const Eigen::Vector2d origin =
      middle - across * (0.5 * label->width_px) - upward * (0.5 * label->height_px);
  impl_->place(*label, origin, across, upward);
}

void Overlay::end() {
  for (std::size_t n = impl_->used; n < impl_->labels.size(); ++n) impl_->labels[n]->actor->VisibilityOff();
  impl_->actor->SetVisibility(impl_->points->GetNumberOfPoints() > 0 ? 1 : 0);
  impl_->points->Modified();
  impl_->polygons->Modified();
  impl_->colors->Modified();
  impl_->shapes->Modified();
}

const std::vector<std::string>& Overlay::texts() const noexcept { return impl_->texts; }

void draw_mark(Overlay& overlay, const Eigen::Vector2d& place, const std::string& words, double scale,
               const Tile& tile) {
  constexpr double pi = 3.14159265358979323846;
  constexpr int corners = 40;
  const double radius = 11.0 * scale;
  const auto at = [&](double angle, double distance) {
    return Eigen::Vector2d(place + distance * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  };
  for (const bool rim : {true, false}) {
    const Rgba color = rim ? Rgba{0, 0, 0, 170} : mark_color;
    const double width = std::max(1.5, (rim ? 4.5 : 2.0) * scale);
    for (int n = 0; n < corners; ++n)
      overlay.line(at(2.0 * pi * n / corners, radius), at(2.0 * pi * (n + 1) / corners, radius), width,
                   color);
    // Four ticks towards the point, so that the shape differs from the grab's circle.
    for (int n = 0; n < 4; ++n)
      overlay.line(at(pi * (0.25 + 0.5 * n), 0.55 * radius), at(pi * (0.25 + 0.5 * n), 1.45 * radius), width,
                   color);
  }
  Overlay::TextStyle style;
  style.size_px = legible_px(13.0, scale, tile);
  if (style.size_px == 0 || words.empty()) return;
  style.bold = true;
  style.color = mark_color;
  style.vertical = Align::middle;
  // On the side where there is room for it.
  const bool left = place.x() > 0.5 * tile.view_width;
  style.horizontal = left ? Align::end : Align::start;
  const double aside = 1.7 * radius;
  overlay.text(words, place + Eigen::Vector2d(left ? -aside : aside, 0.0), style);
}

}  // namespace palpate::visualization
