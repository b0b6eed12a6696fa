#include "series_dialog.hpp"

#include "ui_series_dialog.h"

namespace palpate::gui {

SeriesDialog::SeriesDialog(const QVector<SeriesChoice>& series, QWidget* parent)
    : QDialog(parent), ui_(std::make_unique<Ui::SeriesDialog>()) {
  ui_->setupUi(this);
  setObjectName(QStringLiteral("seriesDialog"));
  setAttribute(Qt::WA_DeleteOnClose);
  for (const auto& choice : series) {
    auto* item = new QListWidgetItem(choice.text, ui_->seriesList);
    item->setData(Qt::UserRole, choice.uid);
    item->setToolTip(choice.uid);
  }
  ui_->seriesList->setCurrentRow(0);
  connect(ui_->openButton, &QPushButton::clicked, this, &SeriesDialog::choose);
  connect(ui_->seriesList, &QListWidget::itemActivated, this, &SeriesDialog::choose);
  connect(ui_->cancelButton, &QPushButton::clicked, this, &QDialog::reject);
}

SeriesDialog::~SeriesDialog() = default;

void SeriesDialog::choose() {
  const auto* item = ui_->seriesList->currentItem();
  if (item == nullptr) return;
  emit seriesChosen(item->data(Qt::UserRole).toString());
  accept();
}

}  // namespace palpate::gui
