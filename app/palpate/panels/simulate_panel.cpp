#include "panels/simulate_panel.hpp"

#include "panels/more_button.hpp"
#include "text.hpp"
#include "ui_simulate_panel.h"

#include <QSignalBlocker>

namespace palpate::gui {

SimulatePanel::SimulatePanel(Workbench& workbench, QWidget* parent)
    : QWidget(parent), workbench_(workbench), ui_(std::make_unique<Ui::SimulatePanel>()) {
  ui_->setupUi(this);
  wire_more(ui_->moreButton, ui_->moreBox);
  ui_->radiusSpin->setValue(workbench_.grab_radius_mm());
  show_settings();
  for (auto* box : {ui_->stiffnessSpin, ui_->dampingSpin, ui_->dragSpin, ui_->gravityX, ui_->gravityY,
                    ui_->gravityZ, ui_->stepSpin}) {
    connect(box, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, &SimulatePanel::take_settings);
  }
  connect(ui_->stepAuto, &QCheckBox::toggled, this, &SimulatePanel::take_settings);
  connect(ui_->radiusSpin, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this,
          &SimulatePanel::take_grab);
  connect(ui_->grabKindCombo, QOverload<int>::of(&QComboBox::currentIndexChanged), this,
          &SimulatePanel::take_grab);
  connect(ui_->deviceCombo, QOverload<int>::of(&QComboBox::currentIndexChanged), this,
          [this](int index) { workbench_.set_device(ui_->deviceCombo->itemData(index).toString()); });
  connect(ui_->simulateButton, &QPushButton::clicked, this,
          [this] { workbench_.playing() ? workbench_.pause() : workbench_.play(); });
  connect(&workbench_, &Workbench::devicesFound, this, [this](const QVector<DeviceChoice>& devices) {
    const QSignalBlocker quiet(ui_->deviceCombo);
    ui_->deviceCombo->clear();
    for (const auto& device : devices) ui_->deviceCombo->addItem(device.text, device.selector);
    ui_->deviceCombo->setCurrentIndex(std::max(0, ui_->deviceCombo->findData(workbench_.device())));
  });
  connect(&workbench_, &Workbench::volumeOpened, this, &SimulatePanel::show_units);
  connect(&workbench_, &Workbench::geometryStated, this, &SimulatePanel::show_units);
  connect(&workbench_, &Workbench::simulationSettingsChanged, this, &SimulatePanel::show_settings);
  for (const auto signal : {&Workbench::simulationStarted, &Workbench::simulationReady,
                            &Workbench::tissueDropped, &Workbench::frameArrived}) {
    connect(&workbench_, signal, this, &SimulatePanel::refresh);
  }
  refresh();
}

SimulatePanel::~SimulatePanel() = default;

void SimulatePanel::take_settings() {
  if (filling_) return;
  session::SimulationSettings settings = workbench_.recipe().simulation;
  settings.parameters.stiffness_per_s2 = ui_->stiffnessSpin->value();
  settings.parameters.damping_per_s = ui_->dampingSpin->value();
  settings.parameters.drag_per_s = ui_->dragSpin->value();
  settings.parameters.gravity_mm_per_s2 = {ui_->gravityX->value() / per_mm_, ui_->gravityY->value() / per_mm_,
                                           ui_->gravityZ->value() / per_mm_};
  if (ui_->stepAuto->isChecked()) {
    settings.step_s.reset();
  } else {
    settings.step_s = ui_->stepSpin->value() / 1000.0;
  }
  workbench_.set_simulation(settings);
}

void SimulatePanel::take_grab() {
  using interaction::SelectionKind;
  constexpr SelectionKind kinds[] = {SelectionKind::connected, SelectionKind::sphere, SelectionKind::fuzzy};
  workbench_.set_grab(ui_->radiusSpin->value() / per_mm_, kinds[ui_->grabKindCombo->currentIndex()]);
}

// Lengths are told in voxels where nobody said how large one is.
void SimulatePanel::show_units() {
  const QString unit = QLatin1Char(' ') + length_unit(workbench_.info());
  const double radius_mm = workbench_.grab_radius_mm();
  per_mm_ = in_length_unit(1.0, workbench_.info());
  {
    const QSignalBlocker quiet(ui_->radiusSpin);
    ui_->radiusSpin->setSuffix(unit);
    ui_->radiusSpin->setToolTip(tr("Radius of what the grab holds, in %1").arg(unit.trimmed()));
    ui_->radiusSpin->setAccessibleName(ui_->radiusSpin->toolTip());
    ui_->radiusSpin->setValue(radius_mm * per_mm_);
  }
  for (auto* box : {ui_->gravityX, ui_->gravityY, ui_->gravityZ})
    box->setSuffix(unit + QStringLiteral("/s²"));
  show_settings();
}

void SimulatePanel::show_settings() {
  filling_ = true;
  const auto& settings = workbench_.recipe().simulation;
  ui_->stiffnessSpin->setValue(settings.parameters.stiffness_per_s2);
  ui_->dampingSpin->setValue(settings.parameters.damping_per_s);
  ui_->dragSpin->setValue(settings.parameters.drag_per_s);
  ui_->gravityX->setValue(settings.parameters.gravity_mm_per_s2.x() * per_mm_);
  ui_->gravityY->setValue(settings.parameters.gravity_mm_per_s2.y() * per_mm_);
  ui_->gravityZ->setValue(settings.parameters.gravity_mm_per_s2.z() * per_mm_);
  ui_->stepAuto->setChecked(!settings.step_s.has_value());
  if (settings.step_s) ui_->stepSpin->setValue(*settings.step_s * 1000.0);
  ui_->stepSpin->setEnabled(settings.step_s.has_value());
  ui_->deviceCombo->setCurrentIndex(std::max(0, ui_->deviceCombo->findData(workbench_.device())));
  filling_ = false;
}

void SimulatePanel::refresh() {
  const bool playing = workbench_.playing();
  ui_->simulateButton->setEnabled(workbench_.simulation_ready());
  ui_->simulateButton->setText(playing ? tr("Pause") : tr("Play"));
  ui_->simulateButton->setIcon(icon(playing ? "pause" : "play", colors::ground));
  // The automatic step is shown where it would be set by hand.
  const auto& frame = workbench_.last_frame();
  if (frame && ui_->stepAuto->isChecked() && frame->step_s > 0.0) {
    const QSignalBlocker quiet(ui_->stepSpin);
    ui_->stepSpin->setValue(frame->step_s * 1000.0);
  }
}

}  // namespace palpate::gui
