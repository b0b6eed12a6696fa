#include "frame_slider.hpp"

#include "theme.hpp"

#include <QMouseEvent>
#include <QPainter>

#include <algorithm>
#include <cmath>

namespace palpate::gui {
namespace {
constexpr int margin_px = 8;
constexpr double least_tick_gap_px = 5.0;
constexpr double handle_radius_px = 6.0;
}  // namespace

FrameSlider::FrameSlider(QWidget* parent) : QSlider(Qt::Horizontal, parent) {
  setFocusPolicy(Qt::StrongFocus);
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
  setSingleStep(1);
  setPageStep(1);
}

void FrameSlider::set_tissue_frame(int frame) {
  tissue_frame_ = frame;
  update();
}

double FrameSlider::x_of(int frame) const {
  const int steps = std::max(1, maximum() - minimum());
  return margin_px + static_cast<double>(width() - 2 * margin_px) * (frame - minimum()) / steps;
}

int FrameSlider::frame_at(int x) const {
  const double share = static_cast<double>(x - margin_px) / std::max(1, width() - 2 * margin_px);
  return minimum() + static_cast<int>(std::lround(std::clamp(share, 0.0, 1.0) * (maximum() - minimum())));
}

void FrameSlider::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setPen(Qt::NoPen);
  const double middle = height() / 2.0;
  const double here = x_of(sliderPosition());
  painter.setBrush(QColor(0x1a, 0x1d, 0x21));
  painter.drawRoundedRect(QRectF(margin_px, middle - 2, width() - 2.0 * margin_px, 4), 2, 2);
  painter.setBrush(isEnabled() ? colors::accent : colors::line);
  painter.drawRoundedRect(QRectF(margin_px, middle - 2, here - margin_px, 4), 2, 2);
  const int steps = maximum() - minimum();
  if (steps > 0 && (width() - 2.0 * margin_px) / steps >= least_tick_gap_px) {
    painter.setBrush(colors::faint_text);
    for (int frame = minimum(); frame <= maximum(); ++frame)
      painter.drawRect(QRectF(x_of(frame) - 0.5, middle + 7, 1, 3));
  }
  if (tissue_frame_ >= minimum() && tissue_frame_ <= maximum()) {
    const double x = x_of(tissue_frame_);
    const QPointF mark[] = {{x - 4, height() - 0.5}, {x + 4, height() - 0.5}, {x, middle + 5}};
    painter.setBrush(colors::amber);
    painter.drawPolygon(mark, 3);
  }
  painter.setBrush(hasFocus() ? colors::accent : colors::text);
  painter.drawEllipse(QPointF(here, middle), handle_radius_px, handle_radius_px);
  if (hasFocus()) {
    painter.setBrush(Qt::NoBrush);
    painter.setPen(QPen(colors::text, 1.5));
    painter.drawEllipse(QPointF(here, middle), handle_radius_px, handle_radius_px);
  }
}

void FrameSlider::mousePressEvent(QMouseEvent* event) {
  if (event->button() != Qt::LeftButton) return;
  setSliderDown(true);
  setSliderPosition(frame_at(event->pos().x()));
  event->accept();
}

void FrameSlider::mouseMoveEvent(QMouseEvent* event) {
  if (!isSliderDown()) return;
  setSliderPosition(frame_at(event->pos().x()));
  event->accept();
}

void FrameSlider::mouseReleaseEvent(QMouseEvent* event) {
  if (event->button() != Qt::LeftButton || !isSliderDown()) return;
  setSliderDown(false);
  event->accept();
}

}  // namespace palpate::gui
