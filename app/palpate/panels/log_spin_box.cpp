#include "panels/log_spin_box.hpp"

#include <QRegularExpression>

#include <algorithm>
#include <cmath>

namespace palpate::gui {
namespace {

constexpr QChar thin_space(0x202F);

// 1, 2 or 5 times a power of ten, and the next of them. A part in a million
// of rounding is the same value.
double next_above(double value) {
  const double decade = std::pow(10.0, std::floor(std::log10(value * (1.0 + 1e-6))));
  for (const double part : {1.0, 2.0, 5.0, 10.0})
    if (part * decade > value * (1.0 + 1e-6)) return part * decade;
  return 10.0 * decade;
}

double next_below(double value) {
  const double decade = std::pow(10.0, std::floor(std::log10(value * (1.0 - 1e-6))));
  for (const double part : {5.0, 2.0, 1.0})
    if (part * decade < value * (1.0 - 1e-6)) return part * decade;
  return 0.5 * decade;
}

}  // namespace

LogSpinBox::LogSpinBox(QWidget* parent) : QDoubleSpinBox(parent) {}

void LogSpinBox::stepBy(int steps) {
  double wanted = value();
  for (int n = 0; n < std::abs(steps); ++n) {
    if (steps > 0) {
      wanted = wanted < singleStep() ? singleStep() : next_above(wanted);
    } else {
      wanted = wanted > singleStep() * (1.0 + 1e-6) ? next_below(wanted) : 0.0;
    }
  }
  setValue(std::clamp(wanted, minimum(), maximum()));
  selectAll();
}

QString LogSpinBox::textFromValue(double value) const {
  QString text = QString::number(value, 'f', decimals());
  if (text.contains(QLatin1Char('.'))) {
    while (text.endsWith(QLatin1Char('0'))) text.chop(1);
    if (text.endsWith(QLatin1Char('.'))) text.chop(1);
  }
  const int point = text.indexOf(QLatin1Char('.'));
  for (int place = (point < 0 ? text.size() : point) - 3; place > 0; place -= 3)
    text.insert(place, thin_space);
  return text;
}

QString LogSpinBox::bare(const QString& text) const {
  QString number = text;
  if (!suffix().isEmpty() && number.endsWith(suffix())) number.chop(suffix().size());
  if (!prefix().isEmpty() && number.startsWith(prefix())) number.remove(0, prefix().size());
  static const QRegularExpression spaces(QStringLiteral("\\s"));
  number.remove(spaces);
  number.remove(thin_space);
  return number.replace(QLatin1Char(','), QLatin1Char('.'));
}

double LogSpinBox::valueFromText(const QString& text) const { return bare(text).toDouble(); }

QValidator::State LogSpinBox::validate(QString& text, int&) const {
  const QString number = bare(text);
  bool whole = false;
  const double value = number.toDouble(&whole);
  if (whole && value >= minimum() && value <= maximum()) return QValidator::Acceptable;
  static const QRegularExpression begun(QStringLiteral("^[0-9]*\\.?[0-9]*([eE][+-]?[0-9]?)?$"));
  return begun.match(number).hasMatch() ? QValidator::Intermediate : QValidator::Invalid;
}

}  // namespace palpate::gui
