#include "session_views.hpp"

#include "views/view_grid.hpp"

#include <array>
#include <cmath>
#include <utility>

namespace palpate::gui {
namespace {

using session::ViewKind;
using session::Views;

constexpr std::array<std::pair<ViewGrid::Place, ViewKind>, 4> places{
    {{ViewGrid::axial, ViewKind::axial},
     {ViewGrid::three_d, ViewKind::three_d},
     {ViewGrid::sagittal, ViewKind::sagittal},
     {ViewGrid::coronal, ViewKind::coronal}}};
constexpr std::array<std::pair<ViewLayout, session::LayoutKind>, 3> layouts{
    {{ViewLayout::four_up, session::LayoutKind::four_up},
     {ViewLayout::side_by_side, session::LayoutKind::side_by_side},
     {ViewLayout::three_d_large, session::LayoutKind::three_d_large}}};
constexpr std::array<std::pair<visualization::Show, session::ShowKind>, 3> shows{
    {{visualization::Show::surface, session::ShowKind::surface},
     {visualization::Show::points, session::ShowKind::points},
     {visualization::Show::links, session::ShowKind::links}}};

double rounded(double value) { return std::round(value * 1e4) / 1e4; }
Eigen::Vector3d rounded(const Eigen::Vector3d& place) {
  return {rounded(place.x()), rounded(place.y()), rounded(place.z())};
}

interaction::Camera rounded(interaction::Camera camera) {
  camera.position_mm = rounded(camera.position_mm);
  camera.focal_point_mm = rounded(camera.focal_point_mm);
  camera.view_up = rounded(camera.view_up);
  camera.view_angle_deg = rounded(camera.view_angle_deg);
  camera.parallel_scale_mm = rounded(camera.parallel_scale_mm);
  return camera;
}

SliceWidget& slice_of(const ViewGrid& grid, ViewGrid::Place place) {
  return static_cast<SliceWidget&>(grid.view(place));
}

session::SliceFraming framing_of(const ViewGrid& grid, ViewGrid::Place place) {
  session::SliceFraming framing = slice_of(grid, place).framing();
  framing.zoom_percent = std::round(framing.zoom_percent * 100.0) / 100.0;
  framing.middle_mm = rounded(framing.middle_mm);
  return framing;
}

}  // namespace

Views views_now(const ViewGrid& grid, const ViewState& state) {
  Views views;
  const auto& settings = state.settings();
  for (const auto& [layout, kind] : layouts)
    if (layout == grid.shared_layout()) views.layout = kind;
  for (const auto& [place, kind] : places)
    if (place == grid.maximised()) views.maximised = kind;
  for (const auto& [show, kind] : shows)
    if (show == settings.show) views.show = kind;
  views.crosshair_mm = rounded(settings.crosshair_mm);
  views.window = rounded(settings.window);
  views.level = rounded(settings.level);
  views.axial = framing_of(grid, ViewGrid::axial);
  views.sagittal = framing_of(grid, ViewGrid::sagittal);
  views.coronal = framing_of(grid, ViewGrid::coronal);
  views.camera = rounded(grid.tissue_view().camera());
  return views;
}

void show_views(const Views& views, ViewGrid& grid, ViewState& state) {
  for (const auto& [layout, kind] : layouts)
    if (kind == views.layout) grid.set_layout(layout);
  for (const auto& [place, kind] : places)
    if (views.maximised == kind) grid.toggle_maximised(place);
  visualization::ViewSettings settings = state.settings();
  for (const auto& [show, kind] : shows)
    if (kind == views.show) settings.show = show;
  if (views.crosshair_mm) settings.crosshair_mm = *views.crosshair_mm;
  if (views.window) settings.window = *views.window;
  if (views.level) settings.level = *views.level;
  state.set_settings(settings);
  if (views.axial) slice_of(grid, ViewGrid::axial).set_framing(*views.axial);
  if (views.sagittal) slice_of(grid, ViewGrid::sagittal).set_framing(*views.sagittal);
  if (views.coronal) slice_of(grid, ViewGrid::coronal).set_framing(*views.coronal);
  if (views.camera) grid.tissue_view().set_camera(*views.camera);
}

}  // namespace palpate::gui
