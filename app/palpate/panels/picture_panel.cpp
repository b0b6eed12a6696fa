#include "panels/picture_panel.hpp"

#include "icons.hpp"
#include "theme.hpp"
#include "ui_picture_panel.h"

#include <QFileInfo>

namespace palpate::gui {

PicturePanel::PicturePanel(Workbench& workbench, QWidget* parent)
    : QWidget(parent), ui_(std::make_unique<Ui::PicturePanel>()) {
  ui_->setupUi(this);
  ui_->savePictureButton->setIcon(icon("picture", colors::ground));
  ui_->savePictureButton->setEnabled(false);
  ui_->savedLabel->hide();
  connect(ui_->savePictureButton, &QPushButton::clicked, this, &PicturePanel::savePictureRequested);
  connect(&workbench, &Workbench::volumeOpened, this, [this] {
    ui_->savePictureButton->setEnabled(true);
    ui_->savedLabel->hide();
  });
  connect(&workbench, &Workbench::pictureSaved, this, [this](const QString& path) {
    ui_->savedLabel->setText(tr("Saved as %1").arg(QFileInfo(path).fileName()));
    ui_->savedLabel->setToolTip(path);
    ui_->savedLabel->show();
  });
}

PicturePanel::~PicturePanel() = default;

}  // namespace palpate::gui
