#include "views/slice_widget.hpp"

#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkRenderer.h>

#include <algorithm>

namespace palpate::gui {

SliceWidget::SliceWidget(visualization::SlicePlane plane, Workbench& workbench, ViewState& state,
                         QWidget* parent)
    : GlView(workbench, state, parent), view_(plane) {
  renderWindow()->AddRenderer(view_.renderer());
  connect(&workbench_.preview(), &FilterPreview::changed, this, &SliceWidget::show_preview);
  connect(&workbench_, &Workbench::comparingChanged, this, &SliceWidget::update_content);
}

// The renderer frees what it holds on the card while the context still lives.
SliceWidget::~SliceWidget() {
  makeCurrent();
  renderWindow()->RemoveRenderer(view_.renderer());
}

void SliceWidget::update_content() {
  view_.set_content(workbench_.content());
  show_preview();
}

void SliceWidget::update_settings() {
  const int before = view_.slice();
  view_.set_settings(state_.settings());
  if (view_.slice() != before) emit sliceChanged();
  show_preview();
}

// Says which slice is seen, and shows it as the filters that are tried make it.
void SliceWidget::show_preview() {
  if (!workbench_.has_volume() || view_.slice_count() < 1) return;
  FilterPreview& preview = workbench_.preview();
  preview.want(view_.axis(), isVisible() ? std::optional<int>(view_.slice()) : std::nullopt);
  visualization::SlicePreview shown;
  if (workbench_.comparing()) {
    shown.mark = tr("Unfiltered").toStdString();
  } else if (preview.active()) {
    if (auto slice = preview.slice(view_.axis(), view_.slice())) shown.slice = *std::move(slice);
    shown.mark = (shown.slice.empty() ? tr("Preview …") : tr("Preview")).toStdString();
  }
  view_.set_preview(shown);
  request_render();
}

void SliceWidget::showEvent(QShowEvent* event) {
  GlView::showEvent(event);
  show_preview();
}

void SliceWidget::hideEvent(QHideEvent* event) {
  GlView::hideEvent(event);
  show_preview();
}

session::SliceFraming SliceWidget::framing() const {
  const int* size = view_.renderer()->GetSize();
  return {view_.zoom_percent(), view_.place_at(0.5 * size[0], 0.5 * size[1])};
}

void SliceWidget::set_framing(const session::SliceFraming& framing) {
  view_.fit();
  view_.zoom(framing.zoom_percent / 100.0);
  const int* size = view_.renderer()->GetSize();
  const Eigen::Vector2d middle(0.5 * size[0], 0.5 * size[1]);
  const Eigen::Vector3d place = view_.place_at(middle.x(), middle.y());
  const Eigen::Vector3d right = view_.place_at(middle.x() + 1.0, middle.y()) - place;
  const Eigen::Vector3d up = view_.place_at(middle.x(), middle.y() + 1.0) - place;
  const Eigen::Vector3d aside = framing.middle_mm - place;
  if (right.squaredNorm() > 0.0 && up.squaredNorm() > 0.0)
    view_.pan(-aside.dot(right) / right.squaredNorm(), -aside.dot(up) / up.squaredNorm());
  request_render();
}

void SliceWidget::fit() {
  view_.fit();
  request_render();
}

// A scan of one slice has only its frames to step through.
void SliceWidget::step_slices(int count) {
  if (view_.slice_count() == 1 && workbench_.frame_count() > 1) {
    const int frames = workbench_.frame_count();
    workbench_.show_frame(((workbench_.wanted_frame() + count) % frames + frames) % frames);
    return;
  }
  set_slice(view_.slice() + count);
}

void SliceWidget::set_slice(int index) {
  if (!workbench_.has_volume() || view_.slice_count() < 1) return;
  const int wanted = std::clamp(index, 0, view_.slice_count() - 1);
  if (wanted != view_.slice()) state_.set_crosshair(view_.crosshair_at_slice(wanted));
}

// From just before the slice along its normal, so that what is nearest to the
// ray's start lies in the slice.
std::optional<interaction::Ray> SliceWidget::ray_through_slice(const QPointF& place) const {
  if (view_.slice_count() < 2) return std::nullopt;
  const Eigen::Vector3d step = view_.crosshair_at_slice(1) - view_.crosshair_at_slice(0);
  if (step.norm() <= 0.0) return std::nullopt;
  interaction::Ray ray;
  ray.direction = step.normalized();
  ray.origin_mm = view_.place_at(place.x(), place.y()) - 0.75 * step;
  return ray;
}

// Four pixels of the slice, but no less than a voxel.
interaction::PickReach SliceWidget::reach_at(const QPointF& place) const {
  interaction::PickReach reach;
  reach.cone_half_angle_deg = 0.0;
  const Eigen::Vector3d across =
      view_.place_at(place.x() + 4.0, place.y()) - view_.place_at(place.x(), place.y());
  reach.cylinder_radius_mm = std::max(across.norm(), workbench_.volume().geometry().spacing_mm().maxCoeff());
  return reach;
}

void SliceWidget::tool_pressed(const QPointF& place) {
  if (!workbench_.has_volume()) return;
  if (state_.tool() == Tool::window_level) return;
  const auto ray = ray_through_slice(place);
  if (ray && state_.tool() == Tool::grab && workbench_.simulation_ready()) {
    grabbing_ = true;
    workbench_.grab(*ray, reach_at(place));
    return;
  }
  if (ray && state_.tool() == Tool::anchor && workbench_.has_tissue()) {
    painting_ = true;
    workbench_.begin_anchor_stroke((pressed_with() & Qt::ControlModifier) != 0);
    workbench_.paint_anchors(*ray, reach_at(place));
    return;
  }
  state_.set_crosshair(view_.place_at(place.x(), place.y()));
}

void SliceWidget::tool_dragged(const QPointF& from, const QPointF& to) {
  if (!workbench_.has_volume()) return;
  if (state_.tool() == Tool::window_level) {
    drag_window_level(from, to);
  } else if (grabbing_) {
    if (const auto ray = ray_through_slice(to)) workbench_.drag(*ray);
  } else if (painting_) {
    if (const auto ray = ray_through_slice(to)) workbench_.paint_anchors(*ray, reach_at(to));
  } else {
    state_.set_crosshair(view_.place_at(to.x(), to.y()));
  }
}

void SliceWidget::tool_released() {
  if (grabbing_) workbench_.release();
  if (painting_) workbench_.end_anchor_stroke();
  grabbing_ = painting_ = false;
}

void SliceWidget::point_at(const QPointF& place, bool crosshair) {
  if (!workbench_.has_volume()) return;
  const Eigen::Vector3d there = view_.place_at(place.x(), place.y());
  if (crosshair) state_.set_crosshair(there);
  const Eigen::Vector3d ijk = workbench_.volume().geometry().to_ijk(there);
  const auto& dims = workbench_.volume().dims();
  bool inside = true;
  for (int axis = 0; axis < 3; ++axis) {
    inside = inside && ijk[axis] >= -0.5 && ijk[axis] < dims[static_cast<std::size_t>(axis)] - 0.5;
  }
  emit hovered(inside, there.x(), there.y(), there.z());
}

}  // namespace palpate::gui
