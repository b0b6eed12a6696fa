#pragma once

#include "workbench.hpp"

#include <QWidget>

#include <memory>

namespace Ui {
class DataPanel;
}

namespace palpate::gui {

/// Step 1: which scan, and what its file says of it.
class DataPanel : public QWidget {
  Q_OBJECT

 public:
  DataPanel(Workbench& workbench, QWidget* parent = nullptr);
  ~DataPanel() override;

 signals:
  void openRequested();
  void openFolderRequested();
  void openSampleRequested();

 private:
  void show_volume();
  void show_note();
  void reread();

  Workbench& workbench_;
  std::unique_ptr<Ui::DataPanel> ui_;
};

}  // namespace palpate::gui
