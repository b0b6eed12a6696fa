// The window's tools, menus, keys and what it remembers.
#include "empty_state.hpp"
#include "help_overlay.hpp"
#include "icons.hpp"
#include "main_window.hpp"
#include "session_keeper.hpp"
#include "ui_main_window.h"
#include "views/view_grid.hpp"

#include <QActionGroup>
#include <QApplication>
#include <QCloseEvent>
#include <QDragEnterEvent>
#include <QFileInfo>
#include <QMenu>
#include <QMessageBox>
#include <QMimeData>
#include <QScreen>
#include <QToolButton>
#include <QUrl>

namespace palpate::gui {

void MainWindow::build_tools() {
  ui_->actionOpen->setIcon(icon("open"));
  ui_->actionOpenFolder->setIcon(icon("folder"));
  ui_->actionOpenSample->setIcon(icon("heart"));
  ui_->actionSavePicture->setIcon(icon("picture"));
  ui_->actionUndo->setIcon(icon("undo"));
  ui_->actionRedo->setIcon(icon("redo"));
  ui_->actionPlayPause->setIcon(icon("play"));
  ui_->actionStep->setIcon(icon("step"));
  ui_->actionReset->setIcon(icon("reset"));
  ui_->actionFourUp->setIcon(icon("layout"));
  ui_->actionSideBySide->setIcon(icon("layout-side"));
  ui_->actionTissueLarge->setIcon(icon("layout-three"));
  ui_->actionMaximise->setIcon(icon("maximise"));
  ui_->actionSurface->setIcon(icon("surface"));
  ui_->actionPoints->setIcon(icon("points"));
  ui_->actionLinks->setIcon(icon("links"));
  ui_->actionFitView->setIcon(icon("fit"));
  ui_->actionKeys->setIcon(icon("help"));

  build_file_buttons();
  build_tool_buttons();
  build_layout_buttons();
}

void MainWindow::build_file_buttons() {
  auto* open = new QToolButton(this);
  open->setObjectName(QStringLiteral("openToolButton"));
  open->setPopupMode(QToolButton::InstantPopup);
  open->setIcon(icon("open"));
  open->setText(tr("Open"));
  open->setToolTip(tr("Open a scan, a folder or the sample heart"));
  open->setToolButtonStyle(Qt::ToolButtonTextBesideIcon);
  auto* open_menu = new QMenu(open);
  open_menu->addActions({ui_->actionOpen, ui_->actionOpenFolder, ui_->actionOpenSample});
  open_menu->addMenu(ui_->menuRecent);
  open->setMenu(open_menu);
  ui_->toolBar->addWidget(open);
  ui_->toolBar->addSeparator();
  for (auto* action : {ui_->actionUndo, ui_->actionRedo}) {
    ui_->toolBar->addAction(action);
    qobject_cast<QToolButton*>(ui_->toolBar->widgetForAction(action))
        ->setToolButtonStyle(Qt::ToolButtonIconOnly);
  }
  ui_->toolBar->addSeparator();
}

void MainWindow::build_tool_buttons() {
  tools_ = new QActionGroup(this);
  int number = 0;
  for (const auto& tool : tools()) {
    ++number;
    auto* action = new QAction(icon(tool.icon), tool.title, tools_);
    action->setObjectName(QStringLiteral("tool%1").arg(number));
    action->setCheckable(true);
    action->setChecked(tool.tool == state_.tool());
    action->setShortcut(QKeySequence(QString::number(number)));
    QString tip = QStringLiteral("%1 (%2)").arg(tool.text).arg(number);
    for (const auto& binding : tool.bindings)
      tip += QStringLiteral("\n%1: %2").arg(binding.keys, binding.effect);
    action->setToolTip(tip);
    connect(action, &QAction::triggered, this, [this, which = tool.tool] { state_.set_tool(which); });
    ui_->toolBar->addAction(action);
    ui_->toolBar->widgetForAction(action)->setObjectName(action->objectName() + QStringLiteral("Button"));
  }
  connect(&state_, &ViewState::toolChanged, this, [this] {
    for (int at = 0; at < tools().size(); ++at) {
      if (tools()[at].tool == state_.tool()) tools_->actions().at(at)->setChecked(true);
    }
    if (help_->isVisible()) help_->show_tool(state_.tool());
  });
}

void MainWindow::build_layout_buttons() {
  auto* layouts = new QActionGroup(this);
  const std::pair<QAction*, ViewLayout> choices[] = {{ui_->actionFourUp, ViewLayout::four_up},
                                                     {ui_->actionSideBySide, ViewLayout::side_by_side},
                                                     {ui_->actionTissueLarge, ViewLayout::three_d_large}};
  for (const auto& [action, layout] : choices) {
    layouts->addAction(action);
    connect(action, &QAction::triggered, this, [this, chosen = layout] { views_->set_layout(chosen); });
  }
  using visualization::Show;
  auto* shows = new QActionGroup(this);
  const std::pair<QAction*, Show> shown[] = {{ui_->actionSurface, Show::surface},
                                             {ui_->actionPoints, Show::points},
                                             {ui_->actionLinks, Show::links}};
  for (const auto& [action, show] : shown) {
    shows->addAction(action);
    connect(action, &QAction::triggered, this, [this, chosen = show] { state_.set_show(chosen); });
    connect(&state_, &ViewState::showChanged, action,
            [this, made = action, chosen = show] { made->setChecked(state_.settings().show == chosen); });
  }
  ui_->actionSurface->setChecked(true);
  connect(views_, &ViewGrid::layoutChanged, this, [this] {
    ui_->actionFourUp->setChecked(views_->view_layout() == ViewLayout::four_up);
    ui_->actionSideBySide->setChecked(views_->view_layout() == ViewLayout::side_by_side);
    ui_->actionTissueLarge->setChecked(views_->view_layout() == ViewLayout::three_d_large);
  });
  ui_->actionFourUp->setChecked(true);

  ui_->toolBar->addSeparator();
  auto* layout = new QToolButton(this);
  layout->setObjectName(QStringLiteral("layoutToolButton"));
  layout->setPopupMode(QToolButton::InstantPopup);
  layout->setIcon(icon("layout"));
  layout->setText(tr("Layout"));
  layout->setToolTip(tr("How the views share the window"));
  layout->setToolButtonStyle(Qt::ToolButtonTextBesideIcon);
  auto* layout_menu = new QMenu(layout);
  layout_menu->addActions({ui_->actionFourUp, ui_->actionSideBySide, ui_->actionTissueLarge});
  layout_menu->addSeparator();
  layout_menu->addAction(ui_->actionMaximise);
  layout_menu->addAction(ui_->actionResetViews);
  layout->setMenu(layout_menu);
  ui_->toolBar->addWidget(layout);
  ui_->toolBar->addSeparator();
  ui_->toolBar->addAction(ui_->actionSavePicture);
  ui_->toolBar->widgetForAction(ui_->actionSavePicture)->setObjectName(QStringLiteral("pictureToolButton"));
  ui_->actionSavePicture->setIconText(tr("Picture"));
  auto* gap = new QWidget(this);
  gap->setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Preferred);
  ui_->toolBar->addWidget(gap);
  ui_->toolBar->addAction(ui_->actionKeys);
  qobject_cast<QToolButton*>(ui_->toolBar->widgetForAction(ui_->actionKeys))
      ->setToolButtonStyle(Qt::ToolButtonIconOnly);
}

// A button that was clicked must not keep the space bar, which plays; one that
// was reached by the Tab key is pressed by it, as everywhere.
void MainWindow::keep_keys_for_views() {
  for (auto* button : findChildren<QAbstractButton*>()) {
    button->setFocusPolicy(Qt::TabFocus);
    button->installEventFilter(this);
  }
}

bool MainWindow::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::ShortcutOverride && qobject_cast<QAbstractButton*>(watched) != nullptr &&
      static_cast<QKeyEvent*>(event)->key() == Qt::Key_Space) {
    event->accept();
    return true;
  }
  return QMainWindow::eventFilter(watched, event);
}

void MainWindow::refresh_recent() {
  ui_->menuRecent->clear();
  int number = 0;
  for (const QString& path : recent_.paths()) {
    ++number;
    auto* action = ui_->menuRecent->addAction(icon("open"), QFileInfo(path).fileName());
    action->setObjectName(QStringLiteral("actionRecent%1").arg(number));
    action->setShortcut(QKeySequence(QStringLiteral("Ctrl+%1").arg(number)));
    action->setToolTip(path);
    connect(action, &QAction::triggered, this, [this, path] { open(path); });
  }
  ui_->menuRecent->setEnabled(number > 0);
  if (number == 0) return;
  ui_->menuRecent->addSeparator();
  connect(ui_->menuRecent->addAction(tr("Forget them")), &QAction::triggered, &recent_, &RecentFiles::clear);
}

void MainWindow::refresh_actions() {
  const bool volume = workbench_.has_volume();
  const bool ready = workbench_.simulation_ready();
  ui_->actionSavePicture->setEnabled(volume);
  for (auto* action : {ui_->actionSaveSession, ui_->actionSaveSessionAs})
    action->setEnabled(session_->can_save());
  ui_->actionBuild->setEnabled(workbench_.has_depth());
  for (auto* action : {ui_->actionPlayPause, ui_->actionStep, ui_->actionReset}) action->setEnabled(ready);
  ui_->actionUndo->setEnabled(workbench_.can_undo());
  ui_->actionRedo->setEnabled(workbench_.can_redo());
  ui_->actionUndo->setText(workbench_.undoes_filter() ? tr("&Undo filter") : tr("&Undo"));
  ui_->actionRedo->setText(workbench_.redoes_filter() ? tr("&Redo filter") : tr("&Redo"));
  ui_->actionUndo->setToolTip(workbench_.undoes_filter()
                                  ? tr("Undo the last filter; tissue made from it is dropped (Ctrl+Z)")
                                  : tr("Undo the last pull, reset or anchor stroke (Ctrl+Z)"));
  ui_->actionPlayPause->setText(workbench_.playing() ? tr("&Pause") : tr("&Play"));
}

void MainWindow::toggle_help() {
  if (help_->isVisible()) {
    help_->hide();
  } else {
    help_->show_tool(state_.tool());
  }
}

void MainWindow::show_about() {
  QMessageBox box(this);
  box.setObjectName(QStringLiteral("aboutBox"));
  box.setWindowTitle(tr("About Palpate"));
  box.setIconPixmap(icon_pixmap("palpate", {}, 64, devicePixelRatioF()));
  box.setText(tr("<b>Palpate %1</b><br>Turns an ultrasound volume into tissue that can be pulled.")
                  .arg(QApplication::applicationVersion()));
  box.setInformativeText(
      tr("For research. Not a medical device: do not base decisions about patients on it.\n"
         "Apache License 2.0"));
  box.exec();
}

void MainWindow::restore() {
  setMinimumSize(960, 640);
  const QSize room = screen() != nullptr ? screen()->availableSize() : QSize(1280, 800);
  resize(std::min(1600, room.width()), std::min(1000, room.height()));
  restoreGeometry(settings_->value(QStringLiteral("window/geometry")).toByteArray());
  restoreState(settings_->value(QStringLiteral("window/state")).toByteArray());
  const int layout = settings_->value(QStringLiteral("window/layout"), 0).toInt();
  if (layout > 0 && layout < static_cast<int>(ViewLayout::one))
    views_->set_layout(static_cast<ViewLayout>(layout));
}

void MainWindow::closeEvent(QCloseEvent* event) {
  settings_->setValue(QStringLiteral("window/geometry"), saveGeometry());
  settings_->setValue(QStringLiteral("window/state"), saveState());
  if (views_->view_layout() != ViewLayout::one) {
    settings_->setValue(QStringLiteral("window/layout"), static_cast<int>(views_->view_layout()));
  }
  settings_->sync();
  workbench_.jobs().cancel_all();
  session_->end();
  event->accept();
}

void MainWindow::dragEnterEvent(QDragEnterEvent* event) {
  const auto urls = event->mimeData()->urls();
  if (urls.isEmpty() || !urls.front().isLocalFile()) return;
  empty_->set_drop_active(true);
  event->acceptProposedAction();
}

void MainWindow::dragLeaveEvent(QDragLeaveEvent* event) {
  empty_->set_drop_active(false);
  QMainWindow::dragLeaveEvent(event);
}

void MainWindow::dropEvent(QDropEvent* event) {
  empty_->set_drop_active(false);
  const auto urls = event->mimeData()->urls();
  if (urls.isEmpty() || !urls.front().isLocalFile()) return;
  event->acceptProposedAction();
  open(urls.front().toLocalFile());
}

}  // namespace palpate::gui
