#include "transport_bar.hpp"

#include "icons.hpp"
#include "text.hpp"
#include "theme.hpp"
#include "ui_transport_bar.h"

#include <cmath>

namespace palpate::gui {
namespace {

// Rounded as it is shown, and never "-0.0".
double tenths(double value) { return std::round(value * 10.0) / 10.0 + 0.0; }

}  // namespace

TransportBar::TransportBar(Workbench& workbench, QWidget* parent)
    : QFrame(parent), workbench_(workbench), ui_(std::make_unique<Ui::TransportBar>()) {
  ui_->setupUi(this);
  ui_->simulationIcon->setPixmap(icon_pixmap("surface", colors::quiet_text, 20, devicePixelRatioF()));
  ui_->stepButton->setIcon(icon("step"));
  ui_->resetButton->setIcon(icon("reset"));
  for (auto* button : {ui_->playPauseButton, ui_->stepButton, ui_->resetButton})
    button->setIconSize({20, 20});
  connect(ui_->playPauseButton, &QToolButton::clicked, this,
          [this] { workbench_.playing() ? workbench_.pause() : workbench_.play(); });
  connect(ui_->stepButton, &QToolButton::clicked, &workbench_, &Workbench::step_once);
  connect(ui_->resetButton, &QToolButton::clicked, &workbench_, &Workbench::reset);
  for (const auto signal :
       {&Workbench::simulationStarted, &Workbench::simulationReady, &Workbench::simulationStopped,
        &Workbench::tissueDropped, &Workbench::frameArrived}) {
    connect(&workbench_, signal, this, &TransportBar::refresh);
  }
  refresh();
}

TransportBar::~TransportBar() = default;

void TransportBar::refresh() {
  const bool ready = workbench_.simulation_ready();
  const bool playing = workbench_.playing();
  for (auto* button : {ui_->playPauseButton, ui_->stepButton, ui_->resetButton}) button->setEnabled(ready);
  ui_->playPauseButton->setIcon(icon(playing ? "pause" : "play"));
  ui_->playPauseButton->setToolTip(playing ? tr("Pause the simulation (Space)")
                                           : tr("Play the simulation (Space)"));
  ui_->playPauseButton->setAccessibleName(playing ? tr("Pause the simulation") : tr("Play the simulation"));
  const auto& frame = workbench_.last_frame();
  if (!workbench_.has_tissue()) {
    ui_->timeLabel->setText(QString());
  } else if (workbench_.simulation_stopped()) {
    ui_->timeLabel->setText(tr("Stopped at t = %1 s").arg(frame ? frame->time_s : 0.0, 0, 'f', 2));
  } else if (!ready) {
    ui_->timeLabel->setText(tr("Preparing the device…"));
  } else {
    ui_->timeLabel->setText(QStringLiteral("t = %1 s").arg(frame ? frame->time_s : 0.0, 0, 'f', 2));
  }
}

void TransportBar::show_cursor(bool inside, double x_mm, double y_mm, double z_mm) {
  if (!inside || !workbench_.has_volume()) {
    ui_->cursorLabel->clear();
    return;
  }
  const auto& volume = workbench_.filtered();
  const Eigen::Vector3d ijk = volume.geometry().to_ijk({x_mm, y_mm, z_mm});
  std::array<int, 3> voxel{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    voxel[axis] = std::clamp(static_cast<int>(std::lround(ijk[static_cast<Eigen::Index>(axis)])), 0,
                             volume.dims()[axis] - 1);
  }
  // A picture has no depth; what has no known size has no millimetres.
  const bool deep = volume.dims()[2] > 1;
  QStringList parts{deep ? tr("voxel %1, %2, %3").arg(voxel[0]).arg(voxel[1]).arg(voxel[2])
                         : tr("pixel %1, %2").arg(voxel[0]).arg(voxel[1])};
  if (!workbench_.info().spacing_is_assumed()) {
    QString place = QStringLiteral("%1, %2").arg(tenths(x_mm), 0, 'f', 1).arg(tenths(y_mm), 0, 'f', 1);
    if (deep) place += QStringLiteral(", %1").arg(tenths(z_mm), 0, 'f', 1);
    parts << place + QStringLiteral(" mm");
  }
  parts << tr("value %1").arg(short_number(volume.at(voxel[0], voxel[1], voxel[2])));
  ui_->cursorLabel->setText(parts.join(QStringLiteral("   ·   ")));
}

}  // namespace palpate::gui
