#include "views/tissue_widget.hpp"

#include "palpate/interaction/move_tool.hpp"

#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkRenderer.h>

#include <cmath>

namespace palpate::gui {
namespace {
constexpr double reach_px = 8.0;  // about the tip of a pointer
constexpr double zoom_per_notch = 1.15;
}  // namespace

TissueWidget::TissueWidget(Workbench& workbench, ViewState& state, QWidget* parent)
    : GlView(workbench, state, parent) {
  renderWindow()->AddRenderer(view_.renderer());
}

TissueWidget::~TissueWidget() {
  makeCurrent();
  renderWindow()->RemoveRenderer(view_.renderer());
}

void TissueWidget::update_content() {
  view_.set_content(workbench_.content());
  request_render();
}

void TissueWidget::update_settings() {
  visualization::ViewSettings settings = state_.settings();
  settings.camera = view_.camera();  // this view owns it
  view_.set_settings(settings);
  request_render();
}

void TissueWidget::fit() {
  view_.fit();
  request_render();
}

void TissueWidget::set_camera(const interaction::Camera& camera) {
  view_.set_camera(camera);
  request_render();
}

void TissueWidget::wheel(int steps) {
  view_.zoom(std::pow(zoom_per_notch, steps));
  request_render();
}

interaction::PickReach TissueWidget::reach() const { return view_.reach(reach_px * devicePixelRatioF()); }

void TissueWidget::tool_pressed(const QPointF& place) {
  if (state_.tool() == Tool::anchor && workbench_.has_tissue()) {
    painting_ = true;
    workbench_.begin_anchor_stroke((pressed_with() & Qt::ControlModifier) != 0);
    workbench_.paint_anchors(view_.ray_at(place.x(), place.y()), reach());
    return;
  }
  if (state_.tool() != Tool::grab || !workbench_.simulation_ready()) return;
  grabbing_ = true;
  workbench_.grab(view_.ray_at(place.x(), place.y()), reach());
}

void TissueWidget::tool_dragged(const QPointF& from, const QPointF& to) {
  if (grabbing_) {
    workbench_.drag(view_.ray_at(to.x(), to.y()));
  } else if (painting_) {
    workbench_.paint_anchors(view_.ray_at(to.x(), to.y()), reach());
  } else if (state_.tool() == Tool::window_level) {
    drag_window_level(from, to);
  } else {
    view_.rotate(to.x() - from.x(), to.y() - from.y());
    request_render();
  }
}

void TissueWidget::tool_released() {
  if (grabbing_) workbench_.release();
  if (painting_) workbench_.end_anchor_stroke();
  grabbing_ = painting_ = false;
}

// The crosshair goes to the tissue under the pointer.
void TissueWidget::point_at(const QPointF& place, bool crosshair) {
  if (!crosshair || !workbench_.has_tissue()) return;
  const auto& points = workbench_.tissue()->tissue->points;
  const auto& frame = workbench_.last_frame();
  const auto& positions = frame && frame->positions_mm ? *frame->positions_mm : points.positions_mm;
  const auto hit =
      interaction::pick(view_.ray_at(place.x(), place.y()), reach(), {positions, points.center_mm});
  if (hit) state_.set_crosshair(hit->origin_mm);
}

}  // namespace palpate::gui
