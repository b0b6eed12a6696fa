#pragma once

#include "views/gl_view.hpp"

#include <QFrame>

class QSlider;
class QToolButton;
class QVBoxLayout;

namespace palpate::gui {

/// A view with a narrow column at its right: maximise button, slice slider or
/// the view's own buttons. The view itself draws its title and coloured edge.
class ViewFrame : public QFrame {
  Q_OBJECT

 public:
  /// `id` names the widgets: "axial" gives axialView, axialSlider, axialMaximise.
  ViewFrame(const QString& id, const QString& title, GlView* view, QWidget* parent);
  GlView& view() const { return *view_; }
  void set_maximised(bool maximised);
  /// Buttons of the view, below the maximise button.
  void add_button(QToolButton* button);

 signals:
  void maximiseRequested();

 private:
  void add_slider(const QString& id);
  void refresh_slider();

  GlView* view_;
  QVBoxLayout* column_;
  QSlider* slider_ = nullptr;
  QToolButton* maximise_;
};

}  // namespace palpate::gui
