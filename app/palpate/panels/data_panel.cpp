#include "panels/data_panel.hpp"

#include "icons.hpp"
#include "stated_geometry.hpp"
#include "text.hpp"
#include "theme.hpp"
#include "ui_data_panel.h"

#include <QClipboard>
#include <QCoreApplication>
#include <QEvent>
#include <QGuiApplication>
#include <QSignalBlocker>

#include <cmath>

namespace palpate::gui {
namespace {

const QString as_the_file = QStringLiteral("file");
// Half of the last decimal that is shown: what nobody touched is not stated.
constexpr double touched_mm = 0.00005;

void set_arrow(QToolButton* button, bool open) {
  button->setIcon(icon(open ? "chevron-down" : "chevron-right", colors::quiet_text));
}

}  // namespace

DataPanel::DataPanel(Workbench& workbench, QWidget* parent)
    : QWidget(parent), workbench_(workbench), ui_(std::make_unique<Ui::DataPanel>()) {
  ui_->setupUi(this);
  ui_->openScanButton->setIcon(icon("open", colors::ground));
  ui_->openFolderButton->setIcon(icon("folder"));
  ui_->openSampleButton->setIcon(icon("heart"));
  ui_->copyReportButton->setIcon(icon("copy"));
  // The wheel scrolls the panel; it must not turn the scan over in passing.
  ui_->orientationCombo->setFocusPolicy(Qt::StrongFocus);
  ui_->orientationCombo->installEventFilter(this);
  for (QWidget* part : {ui_->infoBox, ui_->spacingBox, ui_->orientationBox, ui_->warningsBox}) part->hide();
  ui_->spacingButton->hide();
  wire();
  show_note();
}

DataPanel::~DataPanel() = default;

void DataPanel::wire() {
  connect(ui_->openScanButton, &QPushButton::clicked, this, &DataPanel::openRequested);
  connect(ui_->openFolderButton, &QPushButton::clicked, this, &DataPanel::openFolderRequested);
  connect(ui_->openSampleButton, &QPushButton::clicked, this, &DataPanel::openSampleRequested);
  connect(ui_->spacingButton, &QToolButton::toggled, this, [this](bool open) {
    ui_->spacingBox->setVisible(open);
    set_arrow(ui_->spacingButton, open);
  });
  set_arrow(ui_->spacingButton, false);
  connect(ui_->applySpacingButton, &QPushButton::clicked, this, &DataPanel::take_spacing);
  connect(ui_->fileSpacingButton, &QPushButton::clicked, &workbench_,
          [this] { workbench_.state_spacing(std::nullopt); });
  connect(ui_->orientationCombo, QOverload<int>::of(&QComboBox::activated), this, [this](int index) {
    workbench_.state_orientation(ui_->orientationCombo->itemData(index).toString());
  });
  connect(ui_->warningDetailsButton, &QToolButton::toggled, this, &DataPanel::show_warnings);
  connect(ui_->copyReportButton, &QPushButton::clicked, this, &DataPanel::copy_report);
  connect(&workbench_, &Workbench::volumeOpened, this, &DataPanel::show_scan);
  connect(&workbench_, &Workbench::geometryStated, this, &DataPanel::show_geometry);
  connect(&workbench_, &Workbench::tissueBuilt, this, &DataPanel::show_note);
  connect(&workbench_, &Workbench::tissueDropped, this, &DataPanel::show_note);
}

bool DataPanel::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::Wheel && !ui_->orientationCombo->hasFocus()) {
    event->ignore();
    return true;
  }
  return QWidget::eventFilter(watched, event);
}

void DataPanel::show_scan() {
  const auto& info = workbench_.info();
  const auto text = [](const std::string& words) { return QString::fromStdString(words); };
  ui_->sizeValue->setText(describe_dims(info.geometry));
  const auto& range = workbench_.volume().range();
  ui_->rangeValue->setText(tr("%1 to %2").arg(short_number(range.min), short_number(range.max)));
  QStringList format{text(info.format)};
  for (const auto& part : {info.modality, info.pixel_type})
    if (!part.empty()) format << text(part);
  ui_->formatValue->setText(format.join(QStringLiteral(", ")));
  ui_->scannerValue->setText(text(info.scanner));
  for (QWidget* part : {ui_->scannerCaption, ui_->scannerValue}) part->setVisible(!info.scanner.empty());
  // Where nobody knows it, the fields to say it stand open.
  ui_->spacingButton->setChecked(info.spacing_is_assumed());
  for (QWidget* part : {static_cast<QWidget*>(ui_->infoBox), static_cast<QWidget*>(ui_->spacingButton),
                        static_cast<QWidget*>(ui_->orientationBox), static_cast<QWidget*>(ui_->warningsBox)})
    part->show();
  show_times();
  show_geometry();
}

void DataPanel::show_geometry() {
  const auto& info = workbench_.info();
  const auto& origin = info.geometry.origin_mm();
  QStringList place;
  for (int axis = 0; axis < 3; ++axis)
    place << short_number(std::round(in_length_unit(origin[axis], info) * 10.0) / 10.0 + 0.0);
  const bool known = info.origin_provenance != core::Provenance::absent;
  ui_->originValue->setText(
      known ? QStringLiteral("%1 %2").arg(place.join(QStringLiteral(", ")), length_unit(info))
            : tr("not known"));
  ui_->originBadge->show_provenance(tr("Origin"), info.origin_provenance);
  show_spacing();
  show_orientation();
  show_warnings();
  show_note();
}

void DataPanel::show_spacing() {
  const auto& info = workbench_.info();
  ui_->spacingValue->setText(info.spacing_is_assumed() ? tr("not known, lengths are in voxels")
                                                       : describe_spacing(info));
  ui_->spacingBadge->show_axes(tr("Spacing"), spacing_provenances(info));
  const auto& spacing = info.geometry.spacing_mm();
  ui_->spacingX->setValue(spacing[0]);
  ui_->spacingY->setValue(spacing[1]);
  ui_->spacingZ->setValue(spacing[2]);
  const bool deep = info.geometry.dims()[2] > 1;
  for (QWidget* part : {static_cast<QWidget*>(ui_->spacingZ), static_cast<QWidget*>(ui_->spacingCaptionZ)})
    part->setVisible(deep);
  ui_->fileSpacingButton->setEnabled(workbench_.recipe().input.spacing_mm.has_value());
}

void DataPanel::show_orientation() {
  const auto& info = workbench_.info();
  const auto& file = workbench_.file_info();
  const QString of_file = QString::fromStdString(file.orientation);
  const bool stated = info.direction_provenance == core::Provenance::user;
  const QString now = QString::fromStdString(info.orientation);
  const bool open_question = !file.patient_axes;

  const QSignalBlocker quiet(ui_->orientationCombo);
  ui_->orientationCombo->clear();
  ui_->orientationCombo->addItem(
      open_question ? tr("Not known (shown as %1)").arg(of_file) : tr("As the file says: %1").arg(of_file),
      as_the_file);
  const auto in_use = static_cast<int>(file.orientation_choices.size());
  int at = 0;
  for (const QString& word : orientations_to_offer(file)) {
    if (at == in_use && in_use > 0) ui_->orientationCombo->insertSeparator(ui_->orientationCombo->count());
    ui_->orientationCombo->addItem(QStringLiteral("%1: %2").arg(word, describe_orientation(word)), word);
    ++at;
  }
  const int chosen = stated ? ui_->orientationCombo->findData(now) : 0;
  ui_->orientationCombo->setCurrentIndex(std::max(0, chosen));

  ui_->directionValue->setText(info.patient_axes ? now : tr("patient not known"));
  ui_->directionBadge->show_provenance(tr("Axes"), info.direction_provenance);
  ui_->orientationMeaning->setText(
      info.patient_axes
          ? describe_orientation(now)
          : tr("Shown as if %1; no letters stand in the views.").arg(describe_orientation(now)));
  QString note;
  if (workbench_.orientation_was_remembered()) {
    note = tr("As you chose last time for this scanner.");
  } else if (open_question && !stated && file.geometry.dims()[2] > 1) {
    note = file.scanner.empty()
               ? tr("The file leaves open how the patient lay. Choose it if you know.")
               : tr("The file leaves open how the patient lay. Your choice is remembered for this scanner.");
  }
  ui_->orientationNote->setText(note);
  ui_->orientationNote->setVisible(!note.isEmpty());
}

void DataPanel::show_times() {
  const auto& info = workbench_.info();
  const bool moving = info.frames > 1;
  for (QWidget* part : {static_cast<QWidget*>(ui_->timesCaption), static_cast<QWidget*>(ui_->timesValue),
                        static_cast<QWidget*>(ui_->timesBadge)})
    part->setVisible(moving);
  if (!moving) return;
  const QString last = describe_frame_time(info, info.frames - 1);
  ui_->timesValue->setText(last.isEmpty() ? tr("%1 frames, times not known").arg(info.frames)
                                          : tr("%1 frames, the last at %2").arg(info.frames).arg(last));
  ui_->timesBadge->show_provenance(tr("Times"), info.time_provenance);
}

void DataPanel::show_warnings() {
  const bool details = ui_->warningDetailsButton->isChecked();
  set_arrow(ui_->warningDetailsButton, details);
  QStringList lines;
  for (const auto& warning : workbench_.info().warnings) {
    // A warning sign of its own, so that colour is not needed.
    QString line = QStringLiteral("⚠ ") + QString::fromStdString(warning.text);
    if (details) line += QStringLiteral(" [%1]").arg(QString::fromStdString(warning.code));
    lines << line;
  }
  ui_->warningsLabel->setText(lines.join(QStringLiteral("\n")));
  ui_->warningsLabel->setVisible(!lines.isEmpty());
  ui_->warningDetailsButton->setVisible(!lines.isEmpty());
}

void DataPanel::show_note() {
  ui_->noteLabel->setText(
      tr("Another scan, spacing or orientation drops this tissue; it is then to be built again."));
  ui_->noteLabel->setVisible(workbench_.has_tissue());
}

void DataPanel::take_spacing() {
  const auto& now = workbench_.info().geometry.spacing_mm();
  std::array<double, 3> asked{ui_->spacingX->value(), ui_->spacingY->value(), ui_->spacingZ->value()};
  for (int axis = 0; axis < 3; ++axis) {
    auto& one = asked[static_cast<std::size_t>(axis)];
    if (std::abs(one - now[axis]) <= touched_mm) one = now[axis];
  }
  workbench_.state_spacing(asked);
}

void DataPanel::copy_report() const {
  QGuiApplication::clipboard()->setText(
      QStringLiteral("Palpate %1\n").arg(QCoreApplication::applicationVersion()) +
      geometry_report(workbench_.info()));
}

}  // namespace palpate::gui
