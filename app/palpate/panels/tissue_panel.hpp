#pragma once

#include "workbench.hpp"

#include <QWidget>

#include <memory>

class QSpinBox;
namespace Ui {
class TissuePanel;
}

namespace palpate::gui {

/// Step 3: which voxels become tissue, and what that makes: estimated, marked
/// ≈, before it is built, and counted after.
class TissuePanel : public QWidget {
  Q_OBJECT

 public:
  TissuePanel(Workbench& workbench, QWidget* parent = nullptr);
  ~TissuePanel() override;

 private:
  void wire();
  void wire_mask();
  void choose_mask(int source);
  void show_mask();
  void show_parameters();
  void show_enabled();
  void set_ranges();
  void take_parameters();
  void show_estimate();
  void show_built();
  void show_waiting(const QString& text);
  void show_note();
  void choose_surface(int source);
  void show_surface_source();
  void show_threshold(double threshold);
  double slider_to_value(int slider) const;

  Workbench& workbench_;
  std::unique_ptr<Ui::TissuePanel> ui_;
  std::array<std::array<QSpinBox*, 2>, 3> crop_{};
  bool filling_ = false;
  bool taking_ = false;
  bool changed_since_built_ = false;
};

}  // namespace palpate::gui
