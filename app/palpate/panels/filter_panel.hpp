#pragma once

#include "workbench.hpp"

#include <QWidget>

#include <memory>

namespace Ui {
class FilterPanel;
}

namespace palpate::gui {

/// Step 2: smooths the speckle, or leaves it.
class FilterPanel : public QWidget {
  Q_OBJECT

 public:
  FilterPanel(Workbench& workbench, QWidget* parent = nullptr);
  ~FilterPanel() override;
  /// What was applied, in a line: "Median, 1 voxel" or "None".
  QString result() const;

 private:
  void choose(int index);
  void apply();
  void refresh();

  Workbench& workbench_;
  std::unique_ptr<Ui::FilterPanel> ui_;
};

}  // namespace palpate::gui
