#pragma once

#include "text.hpp"
#include "views/view_state.hpp"
#include "workbench.hpp"

#include <QElapsedTimer>
#include <QTimer>
#include <QVTKOpenGLNativeWidget.h>

class QMouseEvent;
class QWheelEvent;

namespace palpate::gui {

/// A view that VTK draws and that this program steers: VTK's own interaction
/// is left out. Draws when asked, at most at the display's rate. Places are
/// viewport pixels with the origin at the bottom left, as the views take them.
class GlView : public QVTKOpenGLNativeWidget {
  Q_OBJECT

 public:
  GlView(Workbench& workbench, ViewState& state, QWidget* parent);

  void request_render();
  /// The scene of the workbench, as it is now.
  virtual void update_content() = 0;
  virtual void update_settings() = 0;
  virtual void fit() = 0;
  /// One slice further, where there are slices.
  virtual void step_slices(int count) = 0;
  /// What draws, once something was drawn: "llvmpipe (LLVM 15...)".
  const QString& renderer_name() const { return renderer_name_; }
  /// The processor draws, in place of a graphics card.
  bool draws_in_software() const { return is_software_renderer(renderer_name_); }

 signals:
  void maximiseRequested();
  void rendered();
  /// Over a place of the scan, in LPS mm; `inside` is false where there is none.
  void hovered(bool inside, double x_mm, double y_mm, double z_mm);

 protected:
  void initializeGL() override;
  bool event(QEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void mouseDoubleClickEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void leaveEvent(QEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;
  void showEvent(QShowEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;

  virtual void set_text_scale(double scale) = 0;
  virtual void wheel(int steps) = 0;
  virtual void zoom(double factor) = 0;
  virtual void pan(double dx_px, double dy_px) = 0;
  virtual void tool_pressed(const QPointF& place) = 0;
  virtual void tool_dragged(const QPointF& from, const QPointF& to) = 0;
  virtual void tool_released() = 0;
  virtual void point_at(const QPointF& place, bool crosshair) = 0;
  void drag_window_level(const QPointF& from, const QPointF& to);

  /// Of the press that began the drag.
  Qt::KeyboardModifiers pressed_with() const { return pressed_with_; }

  Workbench& workbench_;
  ViewState& state_;

 private:
  enum class Drag { none, tool, zoom, pan };
  void render_now();
  QPointF viewport_place(const QPointF& logical) const;

  Drag drag_ = Drag::none;
  Qt::MouseButton drag_button_ = Qt::NoButton;
  QPointF last_place_;
  Qt::KeyboardModifiers pressed_with_ = Qt::NoModifier;
  int wheel_angle_ = 0;
  QTimer render_delay_;
  QElapsedTimer since_render_;
  QString renderer_name_;
};

}  // namespace palpate::gui
