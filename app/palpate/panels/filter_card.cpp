#include "panels/filter_card.hpp"

#include "icons.hpp"
#include "theme.hpp"

#include <QCheckBox>
#include <QDoubleSpinBox>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QToolButton>
#include <QVBoxLayout>

#include <algorithm>
#include <cmath>

namespace palpate::gui {
namespace {

const imaging::FilterDescription& description_of(const std::string& name) {
  const auto& all = imaging::filters();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const auto& filter) { return filter.name == name; });
  return found != all.end() ? *found : all.front();
}

/// A tenth of a usual value, as 1, 2 or 5 times a power of ten.
double usual_step(const imaging::FilterParameter& parameter) {
  if (parameter.whole_number) return 1.0;
  const double usual = parameter.standard > 0.0 ? parameter.standard : 0.01 * parameter.max;
  const double tenth = std::pow(10.0, std::floor(std::log10(usual) - 1.0 + 1e-9));
  return usual / tenth >= 50.0 ? 5.0 * tenth : tenth;
}

QString unit_of(const imaging::FilterParameter& parameter, const QString& length_unit) {
  const QString unit = QString::fromStdString(parameter.unit);
  if (unit == QStringLiteral("mm")) return length_unit;
  // Where nobody said how large a voxel is.
  if (unit == QStringLiteral("mm²") && length_unit != QStringLiteral("mm")) return QStringLiteral("voxels²");
  return unit;
}

}  // namespace

FilterCard::FilterCard(int number, bool last, const imaging::FilterStep& step, bool on,
                       const QString& length_unit, QWidget* parent)
    : QFrame(parent), name_(step.name) {
  const auto& filter = description_of(step.name);
  const QString title = QString::fromStdString(filter.title);
  const QString tail = QString::number(number);
  setObjectName(QStringLiteral("filterCard") + tail);
  setProperty("block", QStringLiteral("card"));
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(8, 4, 4, 8);
  column->setSpacing(4);

  auto* head = new QHBoxLayout;
  head->setSpacing(0);
  on_ = new QCheckBox(title, this);
  on_->setObjectName(QStringLiteral("filterOn") + tail);
  on_->setChecked(on);
  on_->setToolTip(tr("Take this filter out of the chain for now, or back in"));
  on_->setAccessibleName(tr("%1 filter, number %2 of the chain").arg(title).arg(number));
  head->addWidget(on_, 1);
  auto* up = add_button(QStringLiteral("filterUp") + tail, "chevron-up", tr("Apply %1 earlier").arg(title));
  auto* down =
      add_button(QStringLiteral("filterDown") + tail, "chevron-down", tr("Apply %1 later").arg(title));
  auto* remove = add_button(QStringLiteral("filterRemove") + tail, "close", tr("Remove %1").arg(title));
  up->setEnabled(number > 1);
  down->setEnabled(!last);
  for (auto* button : {up, down, remove}) head->addWidget(button);
  column->addLayout(head);

  auto* body = new QWidget(this);
  auto* grid = new QGridLayout(body);
  grid->setContentsMargins(0, 0, 4, 0);
  grid->setHorizontalSpacing(8);
  grid->setVerticalSpacing(4);
  grid->setColumnStretch(0, 1);
  auto* text = new QLabel(QString::fromStdString(filter.text), body);
  text->setWordWrap(true);
  text->setProperty("role", QStringLiteral("quiet"));
  grid->addWidget(text, 0, 0, 1, 2);
  for (const auto& parameter : filter.parameters) {
    const auto given = step.parameters.find(parameter.name);
    add_parameter(*grid, number, parameter,
                  given != step.parameters.end() ? given->second : parameter.standard, length_unit);
  }
  column->addWidget(body);
  body->setVisible(on);

  connect(on_, &QCheckBox::toggled, this, [this, body](bool checked) {
    body->setVisible(checked);
    emit changed();
  });
  connect(up, &QToolButton::clicked, this, [this] { emit moveRequested(-1); });
  connect(down, &QToolButton::clicked, this, [this] { emit moveRequested(1); });
  connect(remove, &QToolButton::clicked, this, &FilterCard::removeRequested);
}

QToolButton* FilterCard::add_button(const QString& name, const char* picture, const QString& text) {
  auto* button = new QToolButton(this);
  button->setObjectName(name);
  button->setIcon(icon(picture));
  button->setIconSize({16, 16});
  button->setAutoRaise(true);
  button->setToolTip(text);
  button->setAccessibleName(text);
  return button;
}

void FilterCard::add_parameter(QGridLayout& grid, int number, const imaging::FilterParameter& parameter,
                               double value, const QString& length_unit) {
  const QString text = QString::fromStdString(parameter.text);
  const QString unit = unit_of(parameter, length_unit);
  auto* box = new QDoubleSpinBox(grid.parentWidget());
  box->setObjectName(QStringLiteral("filter%1_%2").arg(number).arg(QString::fromStdString(parameter.name)));
  const double step = usual_step(parameter);
  box->setDecimals(
      parameter.whole_number ? 0 : std::clamp(1 - static_cast<int>(std::floor(std::log10(step))), 2, 5));
  box->setRange(parameter.min, parameter.max);
  box->setSingleStep(step);
  const auto show_unit = [box, unit](double now) {
    if (!unit.isEmpty())
      box->setSuffix(QStringLiteral(" ") +
                     (unit == QStringLiteral("voxels") && now == 1.0 ? tr("voxel") : unit));
  };
  // A step of no length is one that the program chooses.
  if (parameter.name == "time_step") box->setSpecialValueText(tr("automatic"));
  box->setValue(value);
  show_unit(box->value());
  connect(box, QOverload<double>::of(&QDoubleSpinBox::valueChanged), box, show_unit);
  box->setMinimumWidth(104);
  box->setToolTip(tr("%1, %2 to %3%4")
                      .arg(text, QLocale::c().toString(parameter.min, 'g', 6),
                           QLocale::c().toString(parameter.max, 'g', 6),
                           unit.isEmpty() ? QString() : QStringLiteral(" ") + unit));
  box->setAccessibleName(text);
  // What stands in brackets is for the tooltip and for screen readers.
  auto* label = new QLabel(text.section(QStringLiteral(" ("), 0, 0), grid.parentWidget());
  label->setToolTip(text);
  label->setWordWrap(true);
  label->setProperty("role", QStringLiteral("quiet"));
  label->setBuddy(box);
  const int row = grid.rowCount();
  grid.addWidget(label, row, 0);
  grid.addWidget(box, row, 1, Qt::AlignVCenter);
  fields_.append({parameter.name, box});
  connect(box, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, &FilterCard::changed);
}

bool FilterCard::on() const { return on_->isChecked(); }

imaging::FilterStep FilterCard::step() const {
  imaging::FilterStep step{name_, {}};
  for (const auto& field : fields_) step.parameters[field.name] = field.box->value();
  return step;
}

}  // namespace palpate::gui
