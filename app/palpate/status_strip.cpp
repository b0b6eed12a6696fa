#include "status_strip.hpp"

#include "text.hpp"
#include "theme.hpp"

#include <QHBoxLayout>
#include <QLabel>
#include <QMenu>
#include <QPainter>
#include <QWidgetAction>

#include <cmath>

namespace palpate::gui {
namespace {

constexpr double amber_above = 0.9;
constexpr int bar_width_px = 64;
constexpr int longest_device_name = 28;

QColor color_of(StepGauge::State state) {
  switch (state) {
    case StepGauge::State::stable:
      return colors::good;
    case StepGauge::State::near_limit:
      return colors::amber;
    case StepGauge::State::too_large:
      return colors::red;
    case StepGauge::State::none:
      break;
  }
  return colors::faint_text;
}

}  // namespace

StepGauge::StepGauge(QWidget* parent) : QAbstractButton(parent) {
  setObjectName(QStringLiteral("stepGauge"));
  setFocusPolicy(Qt::TabFocus);
  setCursor(Qt::PointingHandCursor);
  setToolTip(tr("Time step against the largest stable one. Click: what limits it"));
  setAccessibleName(tr("Time step"));
  hide();
}

void StepGauge::set_steps(double step_s, double stable_step_s, int parts) {
  share_ = stable_step_s > 0.0 ? step_s / stable_step_s : 2.0;  // no step at all is stable
  QString word = tr("stable");
  state_ = State::stable;
  // The automatic step is 0.9 of the bound; rounding shall not turn it amber.
  if (share_ > 1.0) {
    state_ = State::too_large;
    word = parts > 1 ? tr("too large: taken in %1 parts").arg(parts) : tr("too large");
  } else if (share_ > amber_above + 1e-6) {
    state_ = State::near_limit;
    word = tr("near the limit");
  }
  setText(std::isfinite(stable_step_s)
              ? tr("step %1 of %2, %3").arg(short_time(step_s), short_time(stable_step_s), word)
              : tr("step %1, %2").arg(short_time(step_s), word));
  setAccessibleName(text());
  updateGeometry();
  update();
}

QSize StepGauge::sizeHint() const {
  return {fontMetrics().horizontalAdvance(text()) + bar_width_px + 20, 24};
}

void StepGauge::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  if (hasFocus()) {
    painter.setPen(colors::accent);
    painter.drawRoundedRect(QRectF(rect()).adjusted(0.5, 1.5, -0.5, -1.5), 4, 4);
  }
  const QColor color = color_of(state_);
  painter.setPen(state_ == State::stable ? (underMouse() ? colors::text : colors::quiet_text) : color);
  painter.drawText(rect().adjusted(4, 0, 0, 0), Qt::AlignVCenter | Qt::AlignLeft, text());
  const QRectF groove(width() - bar_width_px - 4, height() / 2.0 - 4, bar_width_px, 8);
  painter.setPen(Qt::NoPen);
  painter.setBrush(colors::line);
  painter.drawRoundedRect(groove, 4, 4);
  QRectF filled = groove;
  filled.setWidth(std::max(8.0, groove.width() * std::min(1.0, share_)));
  painter.setBrush(color);
  painter.drawRoundedRect(filled, 4, 4);
}

StatusStrip::StatusStrip(Workbench& workbench, QWidget* parent)
    : QFrame(parent), workbench_(workbench), gauge_(new StepGauge(this)) {
  setObjectName(QStringLiteral("statusStrip"));
  auto* line = new QHBoxLayout(this);
  line->setContentsMargins(12, 0, 12, 0);
  line->setSpacing(16);
  const auto label = [&](const char* name, const QString& what) {
    auto* made = new QLabel(this);
    made->setObjectName(QString::fromLatin1(name));
    made->setToolTip(what);
    line->addWidget(made);
    return made;
  };
  device_ = label("deviceLabel", tr("Device that the simulation runs on"));
  points_ = label("pointsLabel", tr("Points and links of the tissue"));
  step_time_ = label("stepTimeLabel", tr("Time that one step takes"));
  real_time_ = label("realTimeLabel", tr("Simulated time over real time"));
  line->addWidget(gauge_);
  line->addStretch();
  fps_ = label("fpsLabel", tr("Pictures a second in the 3-D view"));
  renderer_ = label("rendererLabel", tr("What draws the views"));
  setMinimumHeight(28);
  connect(gauge_, &StepGauge::clicked, this, &StatusStrip::explain_step);
  for (const auto signal : {&Workbench::simulationStarted, &Workbench::simulationReady,
                            &Workbench::tissueDropped, &Workbench::tissueBuilt, &Workbench::volumeOpened}) {
    connect(&workbench_, signal, this, &StatusStrip::refresh);
  }
  // Numbers that change sixty times a second are not read.
  ticker_.setInterval(250);
  connect(&ticker_, &QTimer::timeout, this, [this] {
    refresh();
    refresh_drawing();
  });
  ticker_.start();
  refresh();
}

void StatusStrip::watch(std::function<double()> frames_per_second, std::function<QString()> renderer) {
  frames_per_second_ = std::move(frames_per_second);
  renderer_name_ = std::move(renderer);
}

void StatusStrip::refresh() {
  const auto& frame = workbench_.last_frame();
  const auto& tissue = workbench_.tissue();
  points_->setText(tissue ? tr("%1 points").arg(short_count(static_cast<double>(tissue->statistics.points)))
                          : QString());
  if (!frame || !tissue) {
    device_->setText(tissue                    ? tr("preparing the device…")
                     : workbench_.has_volume() ? tr("no tissue yet")
                                               : tr("no scan open"));
    step_time_->clear();
    real_time_->clear();
    gauge_->hide();
    return;
  }
  const QString name = QString::fromStdString(frame->device);
  const QString known = short_device(name);
  device_->setText(known.size() > longest_device_name ? known.left(longest_device_name - 1) + QChar(0x2026)
                                                      : known);
  device_->setToolTip(tr("The simulation runs on %1").arg(name));
  step_time_->setText(frame->ms_per_step > 0.0 ? tr("%1 ms/step").arg(short_number(frame->ms_per_step, 2))
                                               : QString());
  real_time_->setText(frame->playing && frame->realtime_factor > 0.0
                          ? tr("%1× real time").arg(short_number(frame->realtime_factor, 2))
                          : QString());
  gauge_->setVisible(frame->step_s > 0.0);
  const auto& named_s = workbench_.recipe().simulation.step_s;
  const bool above = named_s && *named_s > frame->stable_step_s;
  gauge_->set_steps(above ? *named_s : frame->step_s, frame->stable_step_s, above ? frame->substeps : 1);
}

void StatusStrip::refresh_drawing() {
  if (!frames_per_second_) return;
  const double fps = frames_per_second_();
  fps_->setText(fps >= 1.0 ? tr("%1 fps").arg(std::lround(fps)) : QString());
  const QString name = renderer_name_();
  renderer_->setText(is_software_renderer(name) ? tr("software GL") : name);
  renderer_->setToolTip(name.isEmpty() ? tr("What draws the views")
                                       : tr("The views are drawn by %1").arg(name));
}

void StatusStrip::explain_step() {
  const auto& frame = workbench_.last_frame();
  const auto& tissue = workbench_.tissue();
  if (!frame || !tissue || frame->worst_point >= tissue->tissue->points.size()) return;
  const auto& points = tissue->tissue->points;
  const Eigen::Vector3d place =
      frame->positions_mm && frame->worst_point < frame->positions_mm->size()
          ? points.center_mm + (*frame->positions_mm)[frame->worst_point].cast<double>()
          : points.lps_mm(frame->worst_point);
  QMenu menu(this);
  menu.setObjectName(QStringLiteral("stepMenu"));
  auto* text =
      new QLabel(tr("Point %1 at %2, %3, %4 %5 limits the step:\nits links are the stiffest. Stiffness and "
                    "damping move the limit.")
                     .arg(grouped(frame->worst_point))
                     .arg(in_length_unit(place.x(), workbench_.info()), 0, 'f', 1)
                     .arg(in_length_unit(place.y(), workbench_.info()), 0, 'f', 1)
                     .arg(in_length_unit(place.z(), workbench_.info()), 0, 'f', 1)
                     .arg(length_unit(workbench_.info())),
                 &menu);
  text->setMargin(8);
  auto* words = new QWidgetAction(&menu);
  words->setDefaultWidget(text);
  menu.addAction(words);
  menu.addSeparator();
  QAction* automatic = menu.addAction(tr("Use the automatic step"));
  automatic->setObjectName(QStringLiteral("automaticStep"));
  automatic->setEnabled(workbench_.recipe().simulation.step_s.has_value());
  QAction* show = menu.addAction(tr("Show the point that limits it"));
  const QAction* chosen = menu.exec(gauge_->mapToGlobal(QPoint(0, -menu.sizeHint().height())));
  if (chosen == automatic && automatic->isEnabled()) {
    session::SimulationSettings settings = workbench_.recipe().simulation;
    settings.step_s.reset();
    workbench_.set_simulation(settings);
  } else if (chosen == show) {
    workbench_.show_limiting_point(true);
    emit placeRequested(place.x(), place.y(), place.z());
  }
}

}  // namespace palpate::gui
