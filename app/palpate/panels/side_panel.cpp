#include "panels/side_panel.hpp"

#include "icons.hpp"
#include "theme.hpp"

#include <QAbstractSpinBox>
#include <QComboBox>
#include <QPainter>
#include <QScrollBar>
#include <QSlider>
#include <QStyle>
#include <QVBoxLayout>

namespace palpate::gui {
namespace {
constexpr int badge_px = 24;
constexpr int side_margin_px = 12;
}  // namespace

StepHeader::StepHeader(int number, const QString& title, QWidget* parent)
    : QAbstractButton(parent), number_(number) {
  setText(title);
  setCheckable(true);
  setFocusPolicy(Qt::TabFocus);
  setCursor(Qt::PointingHandCursor);
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
  name_for_readers();
}

void StepHeader::set_result(const QString& result, bool done) {
  result_ = result;
  done_ = done;
  setToolTip(result);
  name_for_readers();
  updateGeometry();
  update();
}

void StepHeader::name_for_readers() {
  QString name = tr("Step %1, %2").arg(number_).arg(text());
  if (done_) name += tr(", done");
  if (!result_.isEmpty()) name += QStringLiteral(": ") + result_;
  setAccessibleName(name);
}

QSize StepHeader::sizeHint() const { return {200, 48}; }

void StepHeader::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.fillRect(rect(), underMouse() ? colors::raised : colors::panel);
  painter.fillRect(QRect(0, 0, width(), 1), colors::ground);
  if (isChecked()) painter.fillRect(QRect(0, 1, 3, height() - 1), colors::accent);
  if (hasFocus()) {
    painter.setPen(colors::accent);
    painter.drawRect(rect().adjusted(1, 2, -2, -2));
  }

  const QRectF badge(side_margin_px, (height() - badge_px) / 2.0, badge_px, badge_px);
  painter.setPen(QPen(isChecked() || done_ ? colors::accent : colors::line, 1.5));
  painter.setBrush(done_ ? QBrush(colors::accent) : Qt::NoBrush);
  painter.drawEllipse(badge.adjusted(1, 1, -1, -1));
  if (done_) {
    painter.drawPixmap(QPointF(badge.left() + 5, badge.top() + 5),
                       icon_pixmap("check", colors::ground, 14, devicePixelRatioF()));
  } else {
    painter.setPen(isChecked() ? colors::text : colors::quiet_text);
    painter.drawText(badge, Qt::AlignCenter, QString::number(number_));
  }

  const int left = side_margin_px + badge_px + 12;
  const QRect words(left, 0, width() - left - 32, height());
  QFont bold = font();
  bold.setWeight(QFont::DemiBold);
  painter.setFont(bold);
  painter.setPen(isEnabled() ? colors::text : colors::faint_text);
  if (result_.isEmpty()) {
    painter.drawText(words, Qt::AlignVCenter | Qt::AlignLeft, text());
  } else {
    painter.drawText(words.adjusted(0, 6, 0, -height() / 2), Qt::AlignVCenter | Qt::AlignLeft, text());
    painter.setFont(font());
    painter.setPen(colors::quiet_text);
    const QString line = painter.fontMetrics().elidedText(result_, Qt::ElideRight, words.width());
    painter.drawText(words.adjusted(0, height() / 2 - 2, 0, -4), Qt::AlignVCenter | Qt::AlignLeft, line);
  }
  painter.drawPixmap(QPointF(width() - 28, (height() - 16) / 2.0),
                     icon_pixmap(isChecked() ? "chevron-down" : "chevron-right", colors::quiet_text, 16,
                                 devicePixelRatioF()));
}

SidePanel::SidePanel(QWidget* parent) : QScrollArea(parent), contents_(new QWidget(this)) {
  setObjectName(QStringLiteral("sidePanel"));
  setWidgetResizable(true);
  setFrameShape(QFrame::NoFrame);
  setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  contents_->setObjectName(QStringLiteral("sideContents"));
  auto* column = new QVBoxLayout(contents_);
  column->setContentsMargins(0, 0, 0, 0);
  column->setSpacing(0);
  column->addStretch();
  setWidget(contents_);
}

void SidePanel::add_step(const QString& id, const QString& title, QWidget* body) {
  const int step = headers_.size();
  auto* header = new StepHeader(step + 1, title, contents_);
  header->setObjectName(id + QStringLiteral("Header"));
  body->setParent(contents_);
  auto* column = qobject_cast<QVBoxLayout*>(contents_->layout());
  column->insertWidget(2 * step, header);
  column->insertWidget(2 * step + 1, body);
  // Wide ranges and long choices give way to the panel's width, not the other way round.
  for (auto* field : body->findChildren<QWidget*>()) {
    if (qobject_cast<QAbstractSpinBox*>(field) != nullptr || qobject_cast<QComboBox*>(field) != nullptr) {
      field->setMinimumWidth(64);
      field->setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
    } else if (qobject_cast<QSlider*>(field) == nullptr) {
      continue;
    }
    field->setFocusPolicy(Qt::StrongFocus);
    field->installEventFilter(this);
  }
  body->hide();
  headers_.append(header);
  bodies_.append(body);
  connect(header, &QAbstractButton::clicked, this, [this, step] { open_step(open_ == step ? -1 : step); });
}

// The wheel scrolls the panel: a field that happens to lie under the pointer
// takes it only once it was chosen. A scroll area watches its bars this way too.
bool SidePanel::eventFilter(QObject* watched, QEvent* event) {
  auto* field = qobject_cast<QWidget*>(watched);
  const bool is_bar = qobject_cast<QScrollBar*>(watched) != nullptr;
  if (event->type() == QEvent::Wheel && !is_bar && field != nullptr && !field->hasFocus()) {
    event->ignore();
    return true;
  }
  return QScrollArea::eventFilter(watched, event);
}

void SidePanel::open_step(int step) {
  open_ = step;
  for (int at = 0; at < headers_.size(); ++at) {
    headers_[at]->setChecked(at == step);
    bodies_[at]->setVisible(at == step);
  }
}

}  // namespace palpate::gui
