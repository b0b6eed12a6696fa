#include "panels/data_panel.hpp"

#include "panels/more_button.hpp"
#include "text.hpp"
#include "ui_data_panel.h"

namespace palpate::gui {

DataPanel::DataPanel(Workbench& workbench, QWidget* parent)
    : QWidget(parent), workbench_(workbench), ui_(std::make_unique<Ui::DataPanel>()) {
  ui_->setupUi(this);
  wire_more(ui_->moreButton, ui_->moreBox);
  ui_->openScanButton->setIcon(icon("open", colors::ground));
  ui_->openFolderButton->setIcon(icon("folder"));
  ui_->openSampleButton->setIcon(icon("heart"));
  connect(ui_->openScanButton, &QPushButton::clicked, this, &DataPanel::openRequested);
  connect(ui_->openFolderButton, &QPushButton::clicked, this, &DataPanel::openFolderRequested);
  connect(ui_->openSampleButton, &QPushButton::clicked, this, &DataPanel::openSampleRequested);
  connect(ui_->rereadButton, &QPushButton::clicked, this, &DataPanel::reread);
  connect(&workbench_, &Workbench::volumeOpened, this, &DataPanel::show_volume);
  connect(&workbench_, &Workbench::tissueBuilt, this, &DataPanel::show_note);
  connect(&workbench_, &Workbench::tissueDropped, this, &DataPanel::show_note);
  ui_->rereadButton->setEnabled(false);
  ui_->warningsLabel->hide();
  ui_->infoBox->hide();
  ui_->moreButton->hide();
  show_note();
}

DataPanel::~DataPanel() = default;

void DataPanel::show_volume() {
  const auto& info = workbench_.info();
  ui_->sizeValue->setText(info.frames > 1
                              ? tr("%1, %2 frames").arg(describe_dims(info.geometry)).arg(info.frames)
                              : describe_dims(info.geometry));
  ui_->spacingValue->setText(QStringLiteral("%1 (%2)").arg(
      describe_spacing(info), QString::fromStdString(core::to_string(info.spacing_provenance[0]))));
  ui_->spacingValue->setToolTip(describe_provenance(info.spacing_provenance[0]));
  const auto& range = workbench_.volume().range();
  ui_->rangeValue->setText(tr("%1 to %2").arg(short_number(range.min), short_number(range.max)));
  ui_->formatValue->setText(
      QString::fromStdString(info.format) +
      (info.pixel_type.empty() ? QString() : QStringLiteral(", ") + QString::fromStdString(info.pixel_type)));
  QStringList warnings;
  for (const auto& warning : info.warnings) warnings << QString::fromStdString(warning.text);
  ui_->warningsLabel->setText(warnings.join(QLatin1Char('\n')));
  ui_->warningsLabel->setVisible(!warnings.isEmpty());
  ui_->frameSpin->setMaximum(std::max(1, info.frames));
  ui_->frameSpin->setValue(workbench_.recipe().input.frame + 1);
  ui_->frameSpin->setEnabled(info.frames > 1);
  const auto& spacing = info.geometry.spacing_mm();
  ui_->spacingX->setValue(spacing[0]);
  ui_->spacingY->setValue(spacing[1]);
  ui_->spacingZ->setValue(spacing[2]);
  ui_->rereadButton->setEnabled(true);
  ui_->infoBox->show();
  ui_->moreButton->show();
  show_note();
}

void DataPanel::show_note() {
  ui_->noteLabel->setText(tr("Opening another scan drops this tissue; it is then made again."));
  ui_->noteLabel->setVisible(workbench_.has_tissue());
}

void DataPanel::reread() {
  const auto& now = workbench_.info().geometry.spacing_mm();
  const std::array<double, 3> asked{ui_->spacingX->value(), ui_->spacingY->value(), ui_->spacingZ->value()};
  std::optional<std::array<double, 3>> spacing = workbench_.recipe().input.spacing_mm;
  for (int axis = 0; axis < 3; ++axis) {
    // Half of the last decimal that is shown: what nobody touched is not stated.
    if (std::abs(asked[static_cast<std::size_t>(axis)] - now[axis]) > 0.0005) spacing = asked;
  }
  workbench_.reopen(ui_->frameSpin->value() - 1, spacing);
}

}  // namespace palpate::gui
