#include "series_dialog.hpp"

#include "series_model.hpp"
#include "ui_series_dialog.h"

#include <QHeaderView>
#include <QScreen>
#include <QSortFilterProxyModel>

#include <algorithm>

namespace palpate::gui {

SeriesDialog::SeriesDialog(const std::vector<imaging::SeriesSummary>& series, QWidget* parent)
    : QDialog(parent),
      ui_(std::make_unique<Ui::SeriesDialog>()),
      model_(new SeriesModel(series, this)),
      sorted_(new QSortFilterProxyModel(this)) {
  ui_->setupUi(this);
  setObjectName(QStringLiteral("seriesDialog"));
  setAttribute(Qt::WA_DeleteOnClose);
  sorted_->setSourceModel(model_);
  sorted_->setSortRole(SeriesModel::sort_role);
  ui_->seriesTree->setModel(sorted_);
  ui_->seriesTree->expandAll();
  // As the folder has them, until a head is clicked.
  ui_->seriesTree->sortByColumn(-1, Qt::AscendingOrder);
  lay_out_columns();
  const auto openable =
      std::count_if(series.begin(), series.end(), [](const auto& one) { return one.error_code.empty(); });
  const auto all = static_cast<qlonglong>(series.size());
  ui_->seriesCount->setText(openable == all
                                ? tr("%1 series").arg(all)
                                : tr("%1 series, %2 of them open as a volume").arg(all).arg(openable));
  ui_->seriesText->setText(openable > 0
                               ? tr("This folder holds several series. Which one shall be opened?")
                               : tr("Nothing in this folder opens as a volume; each line says why."));
  connect(ui_->openButton, &QPushButton::clicked, this, &SeriesDialog::choose);
  connect(ui_->seriesTree, &QTreeView::activated, this, &SeriesDialog::choose);
  connect(ui_->seriesTree->selectionModel(), &QItemSelectionModel::selectionChanged, this,
          &SeriesDialog::refresh);
  connect(ui_->cancelButton, &QPushButton::clicked, this, &QDialog::reject);
  select_first();
  refresh();
}

SeriesDialog::~SeriesDialog() = default;

void SeriesDialog::lay_out_columns() {
  auto* header = ui_->seriesTree->header();
  header->setStretchLastSection(false);
  header->setSectionResizeMode(QHeaderView::Interactive);
  header->setSectionResizeMode(SeriesModel::name_column, QHeaderView::Stretch);
  header->setMinimumSectionSize(48);
  for (int row = 0; row < sorted_->rowCount(); ++row) ui_->seriesTree->setFirstColumnSpanned(row, {}, true);
  for (int column = 1; column < SeriesModel::column_count; ++column)
    ui_->seriesTree->resizeColumnToContents(column);
  const QSize room = screen() != nullptr ? screen()->availableSize() : QSize(1280, 800);
  resize(std::min(1040, room.width() * 9 / 10), std::min(560, room.height() * 8 / 10));
}

void SeriesDialog::select_first() {
  for (int group = 0; group < sorted_->rowCount(); ++group) {
    const QModelIndex parent = sorted_->index(group, 0);
    for (int row = 0; row < sorted_->rowCount(parent); ++row) {
      const QModelIndex index = sorted_->index(row, 0, parent);
      if (!model_->opens(sorted_->mapToSource(index))) continue;
      ui_->seriesTree->setCurrentIndex(index);
      ui_->seriesTree->setFocus();
      return;
    }
  }
}

const imaging::SeriesSummary* SeriesDialog::chosen() const {
  const auto rows = ui_->seriesTree->selectionModel()->selectedRows();
  if (rows.isEmpty()) return nullptr;
  const QModelIndex index = sorted_->mapToSource(rows.front());
  return model_->opens(index) ? model_->series_at(index) : nullptr;
}

void SeriesDialog::refresh() { ui_->openButton->setEnabled(chosen() != nullptr); }

void SeriesDialog::choose() {
  const auto* series = chosen();
  if (series == nullptr) return;
  emit seriesChosen(QString::fromStdString(series->path.string()),
                    QString::fromStdString(series->info.series_uid));
  accept();
}

}  // namespace palpate::gui
