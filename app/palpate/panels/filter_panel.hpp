#pragma once

#include "workbench.hpp"

#include <QVector>
#include <QWidget>

#include <memory>

namespace Ui {
class FilterPanel;
}

namespace palpate::gui {

class FilterCard;

/// Step 2: a chain of filters that smooth the speckle, tried on the slices that
/// are seen before they are applied; or none.
class FilterPanel : public QWidget {
  Q_OBJECT

 public:
  FilterPanel(Workbench& workbench, QWidget* parent = nullptr);
  ~FilterPanel() override;
  /// What was applied, in a line: "Median, 1 voxel" or "None".
  QString result() const;

 protected:
  void showEvent(QShowEvent* event) override;
  void hideEvent(QHideEvent* event) override;

 private:
  struct Entry {
    imaging::FilterStep step;
    bool on = true;
  };
  void fill_menu();
  void add(const std::string& name);
  void move(int at, int by);
  void remove(int at);
  void take_cards();
  void build_cards();
  void follow_recipe();
  void show_preview();
  void refresh();
  void show_speckle();
  std::vector<imaging::FilterStep> chain() const;

  Workbench& workbench_;
  std::unique_ptr<Ui::FilterPanel> ui_;
  QVector<Entry> entries_;
  QVector<FilterCard*> cards_;
  QString preview_problem_;
};

}  // namespace palpate::gui
