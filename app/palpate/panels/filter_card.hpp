#pragma once

#include "palpate/imaging/filters.hpp"

#include <QFrame>
#include <QString>
#include <QVector>

class QCheckBox;
class QDoubleSpinBox;
class QGridLayout;
class QToolButton;

namespace palpate::gui {

/// One filter of the chain: on or off, its parameters with their units, its
/// place in the order.
class FilterCard : public QFrame {
  Q_OBJECT

 public:
  /// `number` counts from 1 and names the widgets: filterCard1, filterOn1,
  /// filterUp1, filterDown1, filterRemove1, filter1_radius_voxels.
  FilterCard(int number, bool last, const imaging::FilterStep& step, bool on, const QString& length_unit,
             QWidget* parent);

  bool on() const;
  imaging::FilterStep step() const;

 signals:
  void changed();
  void moveRequested(int by);
  void removeRequested();

 private:
  QToolButton* add_button(const QString& name, const char* picture, const QString& text);
  void add_parameter(QGridLayout& grid, int number, const imaging::FilterParameter& parameter, double value,
                     const QString& length_unit);

  struct Field {
    std::string name;
    QDoubleSpinBox* box;
  };
  std::string name_;
  QCheckBox* on_;
  QVector<Field> fields_;
};

}  // namespace palpate::gui
