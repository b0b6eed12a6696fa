// The part of the window that saves, opens and brings back sessions.
#include "lost_session_bar.hpp"
#include "main_window.hpp"
#include "message_bar.hpp"
#include "session_dialog.hpp"
#include "session_keeper.hpp"
#include "ui_main_window.h"
#include "views/view_grid.hpp"

#include <QDir>
#include <QFileDialog>
#include <QFileInfo>
#include <QStandardPaths>

namespace palpate::gui {
namespace {

QString session_filter() {
  return QObject::tr("Sessions (*%1);;All files (*)").arg(QLatin1String(session::session_ending));
}

// Windows with settings of their own, as in tests, keep all they write beside them.
QString autosave_folder(const QString& settings_file) {
  const QString place = settings_file.isEmpty()
                            ? QStandardPaths::writableLocation(QStandardPaths::AppLocalDataLocation)
                            : QFileInfo(settings_file).absolutePath();
  return QDir(place).filePath(QStringLiteral("autosave"));
}

}  // namespace

void MainWindow::wire_session() {
  session_ = std::make_unique<SessionKeeper>(workbench_, state_, *views_,
                                             autosave_folder(options_.settings_file), nullptr);
  lost_ = new LostSessionBar(this);
  qobject_cast<QVBoxLayout*>(ui_->centralwidget->layout())->insertWidget(0, lost_);
  if (session_->lost()) lost_->offer(*session_->lost());
  connect(lost_, &LostSessionBar::restoreRequested, session_.get(), &SessionKeeper::restore_lost);
  connect(lost_, &LostSessionBar::discardRequested, session_.get(), &SessionKeeper::discard_lost);
  // Work has begun on something else: the offer waits for the next start.
  connect(&workbench_, &Workbench::volumeOpened, lost_, &QWidget::hide);
  connect(ui_->actionOpenSession, &QAction::triggered, this, &MainWindow::choose_session);
  connect(ui_->actionSaveSession, &QAction::triggered, this, &MainWindow::save_session);
  connect(ui_->actionSaveSessionAs, &QAction::triggered, this, &MainWindow::choose_session_file);
  connect(session_.get(), &SessionKeeper::titleChanged, this, &MainWindow::show_title);
  connect(session_.get(), &SessionKeeper::scanUnclear, this, &MainWindow::ask_for_scan);
  connect(session_.get(), &SessionKeeper::problemFound, messages_, &MessageBar::show_problem);
  connect(session_.get(), &SessionKeeper::saved, this, [this](const QString& path) {
    recent_.add(path);
    messages_->show_info(
        tr("The session is saved as %1. Pulls are not part of it.").arg(QDir::toNativeSeparators(path)));
  });
  connect(session_.get(), &SessionKeeper::opened, this, [this] {
    if (!session_->file().isEmpty() && QFileInfo::exists(session_->file())) recent_.add(session_->file());
  });
}

void MainWindow::choose_session() {
  const QString path = QFileDialog::getOpenFileName(
      this, tr("Open session"), settings_->value(QStringLiteral("folders/session")).toString(),
      session_filter());
  if (path.isEmpty()) return;
  settings_->setValue(QStringLiteral("folders/session"), QFileInfo(path).absolutePath());
  session_->open(path);
}

void MainWindow::save_session() {
  if (session_->file().isEmpty()) {
    choose_session_file();
  } else {
    session_->save(session_->file());
  }
}

void MainWindow::choose_session_file() {
  if (!session_->can_save()) return;
  QString path =
      QFileDialog::getSaveFileName(this, tr("Save session"), session_->proposed_file(), session_filter());
  if (path.isEmpty()) return;
  if (!SessionKeeper::is_session(path)) path += QLatin1String(session::session_ending);
  settings_->setValue(QStringLiteral("folders/session"), QFileInfo(path).absolutePath());
  session_->save(path);
}

void MainWindow::ask_for_scan(const ScanQuestion& question) {
  auto* dialog = new SessionDialog(question, this);
  const auto take = [this, dialog](const QString& path) {
    if (path.isEmpty()) return;
    dialog->accept();
    session_->open_with_scan(path, false);
  };
  const QString folder = QFileInfo(QDir::fromNativeSeparators(question.place)).absolutePath();
  connect(dialog, &SessionDialog::findRequested, this, [this, take, folder, scan = question.scan] {
    take(QFileDialog::getOpenFileName(this, tr("Where is %1?").arg(scan), folder));
  });
  connect(dialog, &SessionDialog::findFolderRequested, this, [this, take, folder, scan = question.scan] {
    take(QFileDialog::getExistingDirectory(this, tr("Where is %1?").arg(scan), folder));
  });
  connect(dialog, &SessionDialog::openAnywayRequested, this, [this, dialog, place = question.place] {
    dialog->accept();
    session_->open_with_scan(QDir::fromNativeSeparators(place), true);
  });
  dialog->open();
}

// A scan that was never saved as a session has nothing that it could differ
// from, so it has no mark. Closing asks for nothing: what was set is small, the
// autosave holds it while the window lives, and who wants to keep it saves it.
void MainWindow::show_title() {
  if (!workbench_.has_volume()) return;
  const QString& file = session_->file();
  const QString ending = QLatin1String(session::session_ending);
  const QString name = file.isEmpty() ? workbench_.input_name()
                                      : QFileInfo(file).fileName().remove(ending, Qt::CaseInsensitive);
  setWindowTitle(tr("%1[*] – Palpate").arg(name));
  setWindowModified(session_->changed());
}

}  // namespace palpate::gui
