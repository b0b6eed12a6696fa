#include "picture_dialog.hpp"

#include "ui_picture_dialog.h"

#include <QDate>
#include <QDir>
#include <QFileDialog>
#include <QFileInfo>
#include <QImage>
#include <QMessageBox>
#include <QRegularExpression>

#include <algorithm>

namespace palpate::gui {
namespace {

using visualization::PictureView;
constexpr PictureView views[] = {PictureView::four_up, PictureView::side_by_side, PictureView::three_d,
                                 PictureView::axial,   PictureView::sagittal,     PictureView::coronal};
constexpr int preview_width_px = 400;
constexpr int preview_height_px = 300;

// The scan's file name may hold a patient's name; the picture's does not.
QString free_path(const QString& folder) {
  const QString day = QDate::currentDate().toString(Qt::ISODate);
  for (int number = 1;; ++number) {
    const QString path = QDir(folder).filePath(QStringLiteral("palpate-%1-%2.png").arg(day).arg(number));
    if (!QFileInfo::exists(path)) return path;
  }
}

}  // namespace

PictureDialog::PictureDialog(Workbench& workbench, const visualization::ViewSettings& settings,
                             const QString& folder, QWidget* parent)
    : QDialog(parent),
      workbench_(workbench),
      settings_(settings),
      ui_(std::make_unique<Ui::PictureDialog>()) {
  ui_->setupUi(this);
  setObjectName(QStringLiteral("pictureDialog"));
  setAttribute(Qt::WA_DeleteOnClose);
  ui_->pathEdit->setText(free_path(folder));
  preview_delay_.setSingleShot(true);
  preview_delay_.setInterval(200);
  connect(&preview_delay_, &QTimer::timeout, this, &PictureDialog::draw_preview);
  connect(ui_->viewCombo, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &PictureDialog::refresh);
  connect(ui_->sizeCombo, QOverload<int>::of(&QComboBox::activated), this, &PictureDialog::choose_size);
  connect(ui_->widthSpin, QOverload<int>::of(&QSpinBox::valueChanged), this, &PictureDialog::refresh);
  connect(ui_->heightSpin, QOverload<int>::of(&QSpinBox::valueChanged), this, &PictureDialog::refresh);
  connect(ui_->annotationsCheck, &QCheckBox::toggled, this, &PictureDialog::refresh);
  connect(ui_->browseButton, &QPushButton::clicked, this, &PictureDialog::browse);
  connect(ui_->cancelButton, &QPushButton::clicked, this, &QDialog::reject);
  connect(ui_->saveButton, &QPushButton::clicked, this, &PictureDialog::save);
  connect(ui_->pathEdit, &QLineEdit::textChanged, this,
          [this](const QString& path) { ui_->saveButton->setEnabled(!path.trimmed().isEmpty()); });
  connect(&workbench_, &Workbench::previewDrawn, this, &PictureDialog::show_preview);
  connect(&workbench_, &Workbench::previewFailed, this, [this](const QString& why) {
    ui_->previewLabel->clear();
    ui_->previewNote->setText(why);
  });
  refresh();
}

PictureDialog::~PictureDialog() { workbench_.jobs().cancel_lane(JobLane::preview); }

visualization::PictureRequest PictureDialog::request() const {
  visualization::PictureRequest request;
  request.width_px = ui_->widthSpin->value();
  request.height_px = ui_->heightSpin->value();
  request.view = views[ui_->viewCombo->currentIndex()];
  return request;
}

visualization::ViewSettings PictureDialog::settings() const {
  visualization::ViewSettings settings = settings_;
  settings.annotations = ui_->annotationsCheck->isChecked();
  return settings;
}

void PictureDialog::choose_size(int index) {
  static const QRegularExpression numbers(QStringLiteral("(\\d+)\\D+(\\d+)"));
  const auto match = numbers.match(ui_->sizeCombo->itemText(index));
  if (!match.hasMatch()) return;
  ui_->widthSpin->setValue(match.captured(1).toInt());
  ui_->heightSpin->setValue(match.captured(2).toInt());
}

void PictureDialog::refresh() {
  ui_->textList->clear();
  QStringList lines;
  for (const auto& text : visualization::burned_in_text(workbench_.content(), settings(), request())) {
    const QString line = QString::fromStdString(text);
    if (!lines.contains(line)) lines << line;
  }
  if (lines.isEmpty()) lines << tr("none");
  ui_->textList->addItems(lines);
  preview_delay_.start();
}

void PictureDialog::draw_preview() {
  visualization::PictureRequest small = request();
  const double ratio = std::min(preview_width_px / static_cast<double>(small.width_px),
                                preview_height_px / static_cast<double>(small.height_px));
  small.width_px = std::max(16, static_cast<int>(small.width_px * ratio));
  small.height_px = std::max(16, static_cast<int>(small.height_px * ratio));
  ui_->previewNote->setText(tr("Preview"));
  workbench_.preview_picture(settings(), small);
}

void PictureDialog::show_preview(const core::Picture& picture) {
  const QImage image(picture.rgba.data(), picture.width_px, picture.height_px, 4 * picture.width_px,
                     QImage::Format_RGBA8888);
  ui_->previewLabel->setPixmap(QPixmap::fromImage(image));
  const auto wanted = request();
  ui_->previewNote->setText(tr("Preview of %1 × %2 pixels").arg(wanted.width_px).arg(wanted.height_px));
}

void PictureDialog::browse() {
  const QString path =
      QFileDialog::getSaveFileName(this, tr("Save picture"), ui_->pathEdit->text(),
                                   tr("PNG pictures (*.png)"), nullptr, QFileDialog::DontConfirmOverwrite);
  if (!path.isEmpty()) ui_->pathEdit->setText(path);
}

void PictureDialog::save() {
  QString path = ui_->pathEdit->text().trimmed();
  if (!path.endsWith(QLatin1String(".png"), Qt::CaseInsensitive)) path += QStringLiteral(".png");
  if (QFileInfo::exists(path) &&
      QMessageBox::question(this, tr("Replace the picture?"),
                            tr("%1 is there already. Replace it?").arg(QFileInfo(path).fileName())) !=
          QMessageBox::Yes) {
    return;
  }
  emit saveRequested(path, settings(), request());
  accept();
}

}  // namespace palpate::gui
