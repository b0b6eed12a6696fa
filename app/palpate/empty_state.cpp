#include "empty_state.hpp"

#include "icons.hpp"
#include "theme.hpp"
#include "ui_empty_state.h"

#include <QDir>
#include <QFileInfo>
#include <QStyle>

namespace palpate::gui {

EmptyState::EmptyState(RecentFiles& recent, QWidget* parent)
    : QWidget(parent), recent_(recent), ui_(std::make_unique<Ui::EmptyState>()) {
  ui_->setupUi(this);
  setAttribute(Qt::WA_StyledBackground);
  ui_->emptyIcon->setPixmap(icon_pixmap("palpate", {}, 72, devicePixelRatioF()));
  ui_->emptyOpenButton->setIcon(icon("open", colors::ground));
  ui_->emptyFolderButton->setIcon(icon("folder"));
  ui_->emptySampleButton->setIcon(icon("heart"));
  connect(ui_->emptyOpenButton, &QPushButton::clicked, this, &EmptyState::openRequested);
  connect(ui_->emptyFolderButton, &QPushButton::clicked, this, &EmptyState::openFolderRequested);
  connect(ui_->emptySampleButton, &QPushButton::clicked, this, &EmptyState::openSampleRequested);
  const auto open = [this](const QListWidgetItem* item) {
    emit recentRequested(item->data(Qt::UserRole).toString());
  };
  connect(ui_->recentList, &QListWidget::itemClicked, this, open);
  connect(ui_->recentList, &QListWidget::itemActivated, this, open);
  connect(&recent_, &RecentFiles::changed, this, &EmptyState::show_recent);
  show_recent();
}

EmptyState::~EmptyState() = default;

void EmptyState::set_drop_active(bool active) {
  ui_->dropArea->setProperty("active", active);
  ui_->dropArea->style()->unpolish(ui_->dropArea);
  ui_->dropArea->style()->polish(ui_->dropArea);
  ui_->emptyTitle->setText(active ? tr("Let go to open it") : tr("Drop a scan here"));
}

void EmptyState::show_recent() {
  ui_->recentList->clear();
  for (const QString& path : recent_.paths()) {
    const QFileInfo file(path);
    auto* item =
        new QListWidgetItem(icon(file.isDir() ? "folder" : "open", colors::quiet_text), file.fileName());
    item->setData(Qt::UserRole, path);
    item->setToolTip(QDir::toNativeSeparators(path));
    ui_->recentList->addItem(item);
  }
  ui_->recentBox->setVisible(ui_->recentList->count() > 0);
}

}  // namespace palpate::gui
