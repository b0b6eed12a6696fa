#pragma once

#include "palpate/imaging/reader.hpp"

#include <QDialog>

#include <memory>
#include <vector>

class QSortFilterProxyModel;
namespace Ui {
class SeriesDialog;
}

namespace palpate::gui {

class SeriesModel;

/// Which series of a folder is meant.
class SeriesDialog : public QDialog {
  Q_OBJECT

 public:
  SeriesDialog(const std::vector<imaging::SeriesSummary>& series, QWidget* parent);
  ~SeriesDialog() override;

 signals:
  void seriesChosen(const QString& path, const QString& uid);

 private:
  void lay_out_columns();
  void select_first();
  void refresh();
  void choose();
  const imaging::SeriesSummary* chosen() const;

  std::unique_ptr<Ui::SeriesDialog> ui_;
  SeriesModel* model_;
  QSortFilterProxyModel* sorted_;
};

}  // namespace palpate::gui
