#pragma once

#include <QDoubleSpinBox>

namespace palpate::gui {

/// A field for values over many powers of ten: the arrows go 1, 2, 5, 10, and
/// "1e6", "10 000" and "0,5" are understood. Below `singleStep` comes 0, where
/// 0 is allowed.
class LogSpinBox : public QDoubleSpinBox {
  Q_OBJECT

 public:
  explicit LogSpinBox(QWidget* parent = nullptr);
  void stepBy(int steps) override;

 protected:
  QString textFromValue(double value) const override;
  double valueFromText(const QString& text) const override;
  QValidator::State validate(QString& text, int& place) const override;

 private:
  QString bare(const QString& text) const;
};

}  // namespace palpate::gui
