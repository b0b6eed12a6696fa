#include "provenance_badge.hpp"

#include "text.hpp"
#include "theme.hpp"

#include <QPainter>
#include <QPainterPath>

#include <algorithm>

namespace palpate::gui {
namespace {

constexpr int mark_px = 8;
constexpr int side_px = 6;
constexpr int height_px = 18;

// From what nobody knows to what the file says.
int certainty(core::Provenance provenance) {
  switch (provenance) {
    case core::Provenance::absent:
      return 0;
    case core::Provenance::assumed:
      return 1;
    case core::Provenance::derived:
      return 2;
    case core::Provenance::user:
      return 3;
    case core::Provenance::private_tag:
      return 4;
    case core::Provenance::stated:
      return 5;
  }
  return 0;
}

// Filled: said. Half: worked out. Hollow: not said. A diamond is the maker's,
// a square the user's.
void draw_mark(QPainter& painter, const QRectF& box, core::Provenance provenance) {
  QPainterPath diamond;
  diamond.moveTo(box.center().x(), box.top());
  diamond.lineTo(box.right(), box.center().y());
  diamond.lineTo(box.center().x(), box.bottom());
  diamond.lineTo(box.left(), box.center().y());
  diamond.closeSubpath();
  const QColor color = painter.pen().color();
  switch (provenance) {
    case core::Provenance::stated:
      painter.setBrush(color);
      painter.drawEllipse(box);
      break;
    case core::Provenance::private_tag:
      painter.setBrush(color);
      painter.drawPath(diamond);
      break;
    case core::Provenance::derived:
      painter.drawEllipse(box);
      painter.setBrush(color);
      painter.drawChord(box, 90 * 16, 180 * 16);
      break;
    case core::Provenance::user:
      painter.setBrush(color);
      painter.drawRect(box.adjusted(0.5, 0.5, -0.5, -0.5));
      break;
    case core::Provenance::assumed:
      painter.drawEllipse(box);
      break;
    case core::Provenance::absent:
      painter.drawEllipse(box);
      painter.drawLine(box.bottomLeft(), box.topRight());
      break;
  }
}

}  // namespace

core::Provenance least_certain(const std::vector<core::Provenance>& provenances) {
  const auto found = std::min_element(provenances.begin(), provenances.end(),
                                      [](auto one, auto other) { return certainty(one) < certainty(other); });
  return found == provenances.end() ? core::Provenance::absent : *found;
}

std::vector<core::Provenance> spacing_provenances(const core::VolumeInfo& info) {
  std::vector<core::Provenance> axes;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (info.geometry.dims()[axis] > 1) axes.push_back(info.spacing_provenance[axis]);
  return axes;
}

bool is_uncertain(core::Provenance provenance) {
  return provenance == core::Provenance::assumed;
}

ProvenanceBadge::ProvenanceBadge(QWidget* parent) : QWidget(parent) {
  setSizePolicy(QSizePolicy::Fixed, QSizePolicy::Fixed);
  QFont small = font();
  small.setPointSizeF(small.pointSizeF() * 0.9);
  setFont(small);
  show_provenance(tr("This"), core::Provenance::absent);
}

void ProvenanceBadge::show_provenance(const QString& subject, core::Provenance provenance) {
  provenance_ = provenance;
  word_ = QString::fromStdString(core::to_string(provenance));
  setToolTip(QStringLiteral("%1: %2").arg(subject, describe_provenance(provenance)));
  setAccessibleName(toolTip());
  updateGeometry();
  update();
}

void ProvenanceBadge::show_axes(const QString& subject, const std::vector<core::Provenance>& axes) {
  show_provenance(subject, least_certain(axes));
  if (axes.empty() || std::all_of(axes.begin(), axes.end(), [&](auto one) { return one == axes.front(); }))
    return;
  QString text = subject;
  const QString names = QStringLiteral("ijk");
  for (std::size_t axis = 0; axis < axes.size(); ++axis)
    text += QStringLiteral("\n%1: %2").arg(names.at(static_cast<int>(axis)), describe_provenance(axes[axis]));
  setToolTip(text);
  setAccessibleName(text);
}

QSize ProvenanceBadge::sizeHint() const {
  return {fontMetrics().horizontalAdvance(word_) + mark_px + 3 * side_px, height_px};
}

void ProvenanceBadge::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  const QColor color = is_uncertain(provenance_) ? colors::amber : colors::quiet_text;
  painter.setPen(QPen(is_uncertain(provenance_) ? colors::amber : colors::line, 1.0));
  const QRectF pill = QRectF(rect()).adjusted(0.5, 0.5, -0.5, -0.5);
  painter.setBrush(Qt::NoBrush);
  painter.drawRoundedRect(pill, 4, 4);
  painter.setPen(QPen(color, 1.2));
  draw_mark(painter, QRectF(side_px, (height() - mark_px) / 2.0, mark_px, mark_px), provenance_);
  painter.drawText(rect().adjusted(2 * side_px + mark_px, 0, 0, 0), Qt::AlignVCenter | Qt::AlignLeft, word_);
}

}  // namespace palpate::gui
