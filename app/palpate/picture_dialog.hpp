#pragma once

#include "workbench.hpp"

#include <QDialog>
#include <QTimer>

#include <memory>

namespace Ui {
class PictureDialog;
}

namespace palpate::gui {

/// Which views, at what size, with which text, into which file.
class PictureDialog : public QDialog {
  Q_OBJECT

 public:
  /// `folder`: where pictures were saved last.
  PictureDialog(Workbench& workbench, const visualization::ViewSettings& settings, const QString& folder,
                QWidget* parent);
  ~PictureDialog() override;

 signals:
  void saveRequested(const QString& path, const palpate::visualization::ViewSettings& settings,
                     const palpate::visualization::PictureRequest& request);

 private:
  visualization::PictureRequest request() const;
  visualization::ViewSettings settings() const;
  void choose_size(int index);
  void refresh();
  void draw_preview();
  void show_preview(const core::Picture& picture);
  void browse();
  void save();

  Workbench& workbench_;
  visualization::ViewSettings settings_;
  QTimer preview_delay_;
  std::unique_ptr<Ui::PictureDialog> ui_;
};

}  // namespace palpate::gui
