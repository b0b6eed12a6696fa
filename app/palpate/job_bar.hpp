#pragma once

#include "job_tracker.hpp"

#include <QHash>
#include <QWidget>

class QLabel;
class QProgressBar;
class QToolButton;
class QVBoxLayout;

namespace palpate::gui {

/// A line for each job: what, how far, how long still, and the way to stop it.
class JobBar : public QWidget {
  Q_OBJECT

 public:
  JobBar(JobTracker& tracker, QWidget* parent);

 private:
  struct Row {
    QWidget* widget;
    QLabel* text;
    QProgressBar* bar;
    QLabel* left;
  };
  void refresh();
  Row add_row(quint64 epoch);

  JobTracker& tracker_;
  QVBoxLayout* column_;
  QHash<quint64, Row> rows_;
};

/// "12 s left", or nothing while that cannot be told.
QString time_left(const JobStatus& job);

}  // namespace palpate::gui
