#pragma once

#include "workbench.hpp"

#include <QDialog>

#include <memory>

namespace Ui {
class SeriesDialog;
}

namespace palpate::gui {

/// Which series of a folder is meant.
class SeriesDialog : public QDialog {
  Q_OBJECT

 public:
  SeriesDialog(const QVector<SeriesChoice>& series, QWidget* parent);
  ~SeriesDialog() override;

 signals:
  void seriesChosen(const QString& uid);

 private:
  void choose();
  std::unique_ptr<Ui::SeriesDialog> ui_;
};

}  // namespace palpate::gui
