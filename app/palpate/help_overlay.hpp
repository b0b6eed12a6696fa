#pragma once

#include "tools.hpp"

#include <QFrame>

class QGridLayout;
class QLabel;

namespace palpate::gui {

/// The keys and the mouse of the active tool, over the views.
class HelpOverlay : public QFrame {
  Q_OBJECT

 public:
  explicit HelpOverlay(QWidget* parent);
  void show_tool(Tool tool);

 protected:
  void mousePressEvent(QMouseEvent* event) override;
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  void place();

  QLabel* text_;
};

}  // namespace palpate::gui
