#pragma once

#include "workbench.hpp"

#include <QFrame>

#include <memory>

namespace Ui {
class TransportBar;
}

namespace palpate::gui {

/// Play, step, reset, the simulated time, and the values under the cursor.
class TransportBar : public QFrame {
  Q_OBJECT

 public:
  TransportBar(Workbench& workbench, QWidget* parent);
  ~TransportBar() override;
  /// At a place of the scan in LPS mm.
  void show_cursor(bool inside, double x_mm, double y_mm, double z_mm);

 private:
  void refresh();

  Workbench& workbench_;
  std::unique_ptr<Ui::TransportBar> ui_;
};

}  // namespace palpate::gui
