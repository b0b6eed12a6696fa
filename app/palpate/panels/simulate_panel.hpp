#pragma once

#include "workbench.hpp"

#include <QWidget>

#include <memory>

namespace Ui {
class SimulatePanel;
}

namespace palpate::gui {

/// Step 4: the physics, the grab and where it runs.
class SimulatePanel : public QWidget {
  Q_OBJECT

 public:
  SimulatePanel(Workbench& workbench, QWidget* parent = nullptr);
  ~SimulatePanel() override;

 private:
  void take_settings();
  void take_grab();
  void show_units();
  void show_settings();
  void refresh();

  Workbench& workbench_;
  std::unique_ptr<Ui::SimulatePanel> ui_;
  bool filling_ = false;
  double per_mm_ = 1.0;  ///< of the unit that lengths are shown in
};

}  // namespace palpate::gui
