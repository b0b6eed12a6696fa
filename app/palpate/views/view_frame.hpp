#pragma once

#include <QFrame>

#include "views/gl_view.hpp"

class QHBoxLayout;
class QSlider;
class QToolButton;

namespace palpate::gui {

/// A view with its coloured edge, title, slice slider and maximise button.
class ViewFrame : public QFrame {
  Q_OBJECT

 public:
  /// `id` names the widgets: "axial" gives axialView, axialSlider, axialMaximise.
  ViewFrame(const QString& id, const QString& title, const QColor& color, GlView* view, QWidget* parent);
  GlView& view() const { return *view_; }
  void set_maximised(bool maximised);
  /// Buttons of the view, left of the maximise button.
  void add_button(QToolButton* button);

 signals:
  void maximiseRequested();

 private:
  void add_slider(const QString& id, QHBoxLayout* row);
  void refresh_slider();

  GlView* view_;
  QHBoxLayout* header_;
  QSlider* slider_ = nullptr;
  QToolButton* maximise_;
};

}  // namespace palpate::gui
