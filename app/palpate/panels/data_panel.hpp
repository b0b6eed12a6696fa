#pragma once

#include "workbench.hpp"

#include <QWidget>

#include <memory>

namespace Ui {
class DataPanel;
}

namespace palpate::gui {

/// Step 1: which scan, what its file says of it and where that came from, and
/// what the user says in its place.
class DataPanel : public QWidget {
  Q_OBJECT

 public:
  DataPanel(Workbench& workbench, QWidget* parent = nullptr);
  ~DataPanel() override;

 signals:
  void openRequested();
  void openFolderRequested();
  void openSampleRequested();

 protected:
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  void wire();
  void show_scan();
  void show_geometry();
  void show_spacing();
  void show_orientation();
  void show_times();
  void show_warnings();
  void show_note();
  void take_spacing();
  void copy_report() const;

  Workbench& workbench_;
  std::unique_ptr<Ui::DataPanel> ui_;
};

}  // namespace palpate::gui
