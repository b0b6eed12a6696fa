#include "time_bar.hpp"

#include "icons.hpp"
#include "text.hpp"
#include "theme.hpp"
#include "ui_time_bar.h"

#include <QAction>
#include <QKeyEvent>
#include <QSignalBlocker>

#include <algorithm>
#include <cmath>

namespace palpate::gui {
namespace {
// No screen shows more, and a slower tick than the frames is made up for.
constexpr double shortest_wait_s = 0.015;
constexpr double longest_wait_s = 1.0;
// A frame that comes sooner is not announced.
constexpr int announced_after_ms = 150;

// What comes and goes keeps its place: the slider must not move under the hand.
void keep_place(QWidget* widget, bool keep) {
  QSizePolicy policy = widget->sizePolicy();
  policy.setRetainSizeWhenHidden(keep);
  widget->setSizePolicy(policy);
}
}  // namespace

TimeBar::TimeBar(Workbench& workbench, QWidget* parent)
    : QFrame(parent), workbench_(workbench), ui_(std::make_unique<Ui::TimeBar>()) {
  ui_->setupUi(this);
  ui_->scanIcon->setPixmap(icon_pixmap("film", colors::quiet_text, 20, devicePixelRatioF()));
  ui_->frameBackButton->setIcon(icon("frame-back"));
  ui_->frameNextButton->setIcon(icon("frame-next"));
  ui_->loopButton->setIcon(icon("loop"));
  ui_->loopButton->setChecked(true);
  for (auto* button : {ui_->frameBackButton, ui_->scanPlayButton, ui_->frameNextButton, ui_->loopButton}) {
    button->setIconSize({20, 20});
    button->installEventFilter(this);
  }
  play_action_ = new QAction(this);
  play_action_->setObjectName(QStringLiteral("actionPlayScan"));
  play_action_->setShortcut(QKeySequence(QStringLiteral("Shift+Space")));
  addAction(play_action_);
  ticker_.setSingleShot(true);
  ticker_.setTimerType(Qt::PreciseTimer);
  announce_.setSingleShot(true);
  announce_.setInterval(announced_after_ms);
  keep_place(ui_->frameStateLabel, true);
  wire();
  hide();
}

TimeBar::~TimeBar() = default;

void TimeBar::wire() {
  const auto toggle = [this] { playing() ? stop() : play(); };
  connect(play_action_, &QAction::triggered, this, toggle);
  connect(ui_->scanPlayButton, &QToolButton::clicked, this, toggle);
  connect(ui_->frameBackButton, &QToolButton::clicked, this, [this] { step(-1); });
  connect(ui_->frameNextButton, &QToolButton::clicked, this, [this] { step(1); });
  // Also while it is dragged: frames that are there follow the hand.
  connect(ui_->frameSlider, &QSlider::valueChanged, this, [this](int frame) {
    stop();
    workbench_.show_frame(frame);
  });
  connect(ui_->buildFrameButton, &QPushButton::clicked, &workbench_, &Workbench::build_tissue);
  connect(&ticker_, &QTimer::timeout, this, &TimeBar::tick);
  connect(&workbench_, &Workbench::volumeOpened, this, &TimeBar::take_scan);
  connect(&workbench_, &Workbench::frameShown, this, &TimeBar::refresh);
  connect(&workbench_, &Workbench::frameWanted, this, [this] {
    if (!announce_.isActive()) announce_.start();
  });
  connect(&announce_, &QTimer::timeout, this, &TimeBar::refresh_state);
  for (const auto signal : {&Workbench::tissueBuilt, &Workbench::tissueDropped, &Workbench::volumeFiltered}) {
    connect(&workbench_, signal, this, &TimeBar::refresh_state);
  }
}

void TimeBar::take_scan() {
  ticker_.stop();
  const auto& info = workbench_.info();
  clock_ = FrameClock(info.frames, info.frame_times_s);
  setVisible(info.frames > 1);
  const QSignalBlocker quiet(ui_->frameSlider);
  ui_->frameSlider->setRange(0, std::max(0, info.frames - 1));
  ui_->timeBadge->show_provenance(tr("Times"), info.time_provenance);
  // Room for the longest, so that nothing moves while it plays.
  ui_->frameLabel->setMinimumWidth(fontMetrics().horizontalAdvance(tr("frame %1 of %1").arg(info.frames)) +
                                   4);
  ui_->frameStateLabel->setMinimumWidth(
      fontMetrics().horizontalAdvance(tr("tissue is of frame %1").arg(info.frames)) + 4);
  refresh();
}

void TimeBar::refresh() {
  if (!workbench_.has_volume()) return;
  const int frame = workbench_.frame();
  const auto& info = workbench_.info();
  if (!ui_->frameSlider->isSliderDown()) {
    const QSignalBlocker quiet(ui_->frameSlider);
    ui_->frameSlider->setValue(workbench_.wanted_frame());
  }
  ui_->frameLabel->setText(tr("frame %1 of %2").arg(frame + 1).arg(info.frames));
  const QString rate = tr("%1 frames/s").arg(clock_.frames_per_s(), 0, 'g', 3);
  if (clock_.rate_is_known()) {
    const QString last = describe_frame_time(info, info.frames - 1);
    ui_->frameTimeLabel->setText(describe_frame_time(info, frame));
    ui_->frameTimeLabel->setMinimumWidth(fontMetrics().horizontalAdvance(last) + 4);
    ui_->scanPlayButton->setToolTip(
        (playing() ? tr("Stop the scan (Shift+Space)") : tr("Play the scan (Shift+Space)")) +
        tr("\nAs it was recorded: %1").arg(rate));
  } else {
    ui_->frameTimeLabel->setText(tr("time not known · plays at %1").arg(rate));
    ui_->scanPlayButton->setToolTip(
        (playing() ? tr("Stop the scan (Shift+Space)") : tr("Play the scan (Shift+Space)")) +
        tr("\nThe file does not say how fast it was recorded; %1 are taken.").arg(rate));
  }
  refresh_state();
}

// One quiet line says what differs from what one would think.
void TimeBar::refresh_state() {
  if (!workbench_.has_volume()) return;
  ui_->scanPlayButton->setIcon(icon(playing() ? "pause" : "play"));
  ui_->scanPlayButton->setAccessibleName(playing() ? tr("Stop the scan") : tr("Play the scan"));
  const int tissue = workbench_.tissue_frame();
  const bool of_another = tissue >= 0 && tissue != workbench_.frame();
  keep_place(ui_->buildFrameButton, tissue >= 0);
  ui_->frameSlider->set_tissue_frame(tissue);
  QString state;
  if (workbench_.wanted_frame() != workbench_.frame() && !playing()) {
    state = tr("loading frame %1…").arg(workbench_.wanted_frame() + 1);
  } else if (!workbench_.frame_is_filtered()) {
    state = tr("not filtered");
  } else if (of_another) {
    state = tr("tissue is of frame %1").arg(tissue + 1);
  }
  ui_->frameStateLabel->setText(state);
  ui_->frameStateLabel->setVisible(!state.isEmpty());
  ui_->buildFrameButton->setVisible(of_another && !playing());
  ui_->buildFrameButton->setToolTip(
      tr("Build tissue from frame %1; it replaces that of frame %2 and its pulls")
          .arg(workbench_.frame() + 1)
          .arg(tissue + 1));
}

void TimeBar::play() {
  if (workbench_.frame_count() < 2) return;
  start_frame_ = workbench_.wanted_frame();
  if (!ui_->loopButton->isChecked() && start_frame_ == workbench_.frame_count() - 1) start_frame_ = 0;
  workbench_.set_scan_playing(true);
  since_start_.start();
  workbench_.show_frame(start_frame_);
  refresh();
  tick();
}

void TimeBar::stop() {
  ticker_.stop();
  if (!playing()) return;
  workbench_.set_scan_playing(false);
  refresh();
}

void TimeBar::tick() {
  if (!playing()) return;
  const double elapsed_s = static_cast<double>(since_start_.nsecsElapsed()) * 1e-9;
  const bool loop = ui_->loopButton->isChecked();
  const int due = clock_.frame_at(start_frame_, elapsed_s, loop);
  // One that is still on its way is let come; the one after it is the newest then.
  if (workbench_.wanted_frame() == workbench_.frame()) workbench_.show_frame(due);
  if (!loop && due == clock_.frames() - 1 && workbench_.frame() == due) {
    stop();
    return;
  }
  const double wait_s = std::clamp(clock_.wait_s(start_frame_, elapsed_s), shortest_wait_s, longest_wait_s);
  ticker_.start(static_cast<int>(std::ceil(wait_s * 1000.0)));
}

void TimeBar::step(int count) {
  stop();
  const int frames = workbench_.frame_count();
  if (frames > 1) workbench_.show_frame((workbench_.wanted_frame() + count + frames) % frames);
}

// The arrows step frames wherever in the bar the focus is.
bool TimeBar::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::KeyPress) {
    const int key = static_cast<QKeyEvent*>(event)->key();
    if (key == Qt::Key_Left || key == Qt::Key_Right) {
      step(key == Qt::Key_Right ? 1 : -1);
      return true;
    }
  }
  return QFrame::eventFilter(watched, event);
}

}  // namespace palpate::gui
