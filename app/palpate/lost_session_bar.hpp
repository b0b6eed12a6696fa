#pragma once

#include "session_autosave.hpp"

#include <QFrame>

class QLabel;

namespace palpate::gui {

/// Offers what was open when the program ended without being closed.
class LostSessionBar : public QFrame {
  Q_OBJECT

 public:
  explicit LostSessionBar(QWidget* parent = nullptr);
  void offer(const LostSession& lost);

 signals:
  void restoreRequested();
  void discardRequested();

 private:
  QLabel* text_;
};

}  // namespace palpate::gui
