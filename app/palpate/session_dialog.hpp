#pragma once

#include "session_keeper.hpp"

#include <QDialog>

namespace palpate::gui {

/// Asks what to do about a session's scan that moved or changed.
class SessionDialog : public QDialog {
  Q_OBJECT

 public:
  SessionDialog(const ScanQuestion& question, QWidget* parent);

 signals:
  void openAnywayRequested();
  void findRequested();  ///< a file
  void findFolderRequested();
};

}  // namespace palpate::gui
