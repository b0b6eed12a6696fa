#pragma once

#include "views/gl_view.hpp"

#include "palpate/visualization/tissue_view.hpp"

namespace palpate::gui {

/// The 3-D view in the window.
class TissueWidget : public GlView {
  Q_OBJECT

 public:
  TissueWidget(Workbench& workbench, ViewState& state, QWidget* parent);
  ~TissueWidget() override;

  void update_content() override;
  void update_settings() override;
  void fit() override;
  void step_slices(int) override {}
  interaction::Camera camera() const { return view_.camera(); }
  void set_camera(const interaction::Camera& camera);

 protected:
  void set_text_scale(double scale) override { view_.set_text_scale(scale); }
  void wheel(int steps) override;
  void zoom(double factor) override { view_.zoom(factor); }
  void pan(double dx_px, double dy_px) override { view_.pan(dx_px, dy_px); }
  void tool_pressed(const QPointF& place) override;
  void tool_dragged(const QPointF& from, const QPointF& to) override;
  void tool_released() override;
  void point_at(const QPointF& place, bool crosshair) override;

 private:
  interaction::PickReach reach() const;

  visualization::TissueView view_;
  bool grabbing_ = false;
  bool painting_ = false;
};

}  // namespace palpate::gui
