#pragma once

#include "workbench.hpp"

#include <QWidget>

#include <functional>
#include <memory>

class QCheckBox;
class QComboBox;
class QDoubleSpinBox;
namespace Ui {
class SimulatePanel;
}

namespace palpate::gui {

/// Step 4: the physics, the time step, the grab and where it runs.
class SimulatePanel : public QWidget {
  Q_OBJECT

 public:
  SimulatePanel(Workbench& workbench, QWidget* parent = nullptr);
  ~SimulatePanel() override;

 private:
  using Settings = session::SimulationSettings;
  /// A field changes only what it stands for, so that nothing else is rounded to what fields show.
  void bind(QDoubleSpinBox* field, std::function<void(Settings&, double)> put);
  void bind(QCheckBox* field, std::function<void(Settings&, bool)> put);
  void bind(QComboBox* field, std::function<void(Settings&, int)> put);
  void change(const std::function<void(Settings&)>& put);
  void wire_physics();
  void wire_step();
  void wire_anchors();
  void wire_grab();
  void choose_anchors(int rule);
  void take_grab();
  void show_units();
  void name_gravity();
  void show_settings();
  void show_beat();
  void show_limit();
  void show_warning();
  void show_anchors();
  void show_layout();
  void refresh();

  Workbench& workbench_;
  std::unique_ptr<Ui::SimulatePanel> ui_;
  bool filling_ = false;
  double per_mm_ = 1.0;  ///< of the unit that lengths are shown in
};

}  // namespace palpate::gui
