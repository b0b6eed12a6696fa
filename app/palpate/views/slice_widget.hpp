#pragma once

#include "views/gl_view.hpp"

#include "palpate/session/session_file.hpp"
#include "palpate/visualization/slice_view.hpp"

#include <optional>

namespace palpate::gui {

/// One slice view in the window.
class SliceWidget : public GlView {
  Q_OBJECT

 public:
  SliceWidget(visualization::SlicePlane plane, Workbench& workbench, ViewState& state, QWidget* parent);
  ~SliceWidget() override;

  void update_content() override;
  void update_settings() override;
  void fit() override;
  void step_slices(int count) override;
  void set_slice(int index);
  int slice() const { return view_.slice(); }
  int slice_count() const { return view_.slice_count(); }
  const visualization::SliceView& view() const { return view_; }
  /// Zoom and middle, whatever the size of the widget.
  session::SliceFraming framing() const;
  void set_framing(const session::SliceFraming& framing);

 signals:
  void sliceChanged();

 protected:
  void showEvent(QShowEvent* event) override;
  void hideEvent(QHideEvent* event) override;
  void set_text_scale(double scale) override { view_.set_text_scale(scale); }
  void wheel(int steps) override { step_slices(steps); }
  void zoom(double factor) override { view_.zoom(factor); }
  void pan(double dx_px, double dy_px) override { view_.pan(dx_px, dy_px); }
  void tool_pressed(const QPointF& place) override;
  void tool_dragged(const QPointF& from, const QPointF& to) override;
  void tool_released() override;
  void point_at(const QPointF& place, bool crosshair) override;

 private:
  void show_preview();
  std::optional<interaction::Ray> ray_through_slice(const QPointF& place) const;
  interaction::PickReach reach_at(const QPointF& place) const;

  visualization::SliceView view_;
  bool grabbing_ = false;
  bool painting_ = false;
};

}  // namespace palpate::gui
