#pragma once

#include "workbench.hpp"

#include <QWidget>

#include <memory>

namespace Ui {
class PicturePanel;
}

namespace palpate::gui {

/// Step 5: saves what is seen.
class PicturePanel : public QWidget {
  Q_OBJECT

 public:
  PicturePanel(Workbench& workbench, QWidget* parent = nullptr);
  ~PicturePanel() override;

 signals:
  void savePictureRequested();

 private:
  std::unique_ptr<Ui::PicturePanel> ui_;
};

}  // namespace palpate::gui
