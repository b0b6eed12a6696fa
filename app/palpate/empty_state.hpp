#pragma once

#include "recent_files.hpp"

#include <QWidget>

#include <memory>

namespace Ui {
class EmptyState;
}

namespace palpate::gui {

/// What stands in the centre while no scan is open.
class EmptyState : public QWidget {
  Q_OBJECT

 public:
  EmptyState(RecentFiles& recent, QWidget* parent);
  ~EmptyState() override;
  /// While something that could be dropped hovers over the window.
  void set_drop_active(bool active);

 signals:
  void openRequested();
  void openFolderRequested();
  void openSampleRequested();
  void recentRequested(const QString& path);

 private:
  void show_recent();

  RecentFiles& recent_;
  std::unique_ptr<Ui::EmptyState> ui_;
};

}  // namespace palpate::gui
