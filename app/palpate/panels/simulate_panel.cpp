#include "panels/simulate_panel.hpp"

#include "panels/more_button.hpp"
#include "text.hpp"
#include "ui_simulate_panel.h"

#include <QSignalBlocker>
#include <QStandardItemModel>

#include <algorithm>
#include <cmath>

namespace palpate::gui {
namespace {

using simulation::Integrator;

constexpr double earth_mm_per_s2 = 9810.0;
constexpr double usual_beat = 0.1;
constexpr int slider_per_decade = 100;
enum Gravity { no_gravity, lying, upright, own };

QString name_of(Integrator integrator) {
  switch (integrator) {
    case Integrator::rk4:
      return QObject::tr("Runge-Kutta 4 (accurate)");
    case Integrator::verlet:
      return QObject::tr("Verlet");
    case Integrator::velocity_verlet:
      return QObject::tr("Velocity Verlet");
    case Integrator::symplectic_euler:
      return QObject::tr("Symplectic Euler");
    case Integrator::euler:
      return QObject::tr("Euler");
    case Integrator::implicit_euler:
      return QObject::tr("Implicit Euler (stiff tissue)");
  }
  return {};
}

Gravity preset_of(const Eigen::Vector3d& gravity) {
  if (gravity.isZero()) return no_gravity;
  if (gravity == Eigen::Vector3d(0.0, earth_mm_per_s2, 0.0)) return lying;
  if (gravity == Eigen::Vector3d(0.0, 0.0, -earth_mm_per_s2)) return upright;
  return own;
}

int slider_of(double stiffness) {
  return stiffness > 1.0 ? static_cast<int>(std::lround(std::log10(stiffness) * slider_per_decade)) : 0;
}

// Two digits: what a hand can mean by where it lets go.
double stiffness_of(int slider) {
  const double exact = std::pow(10.0, static_cast<double>(slider) / slider_per_decade);
  const double decade = std::pow(10.0, std::floor(std::log10(exact)) - 1.0);
  return std::max(1.0, std::round(exact / decade) * decade);
}

}  // namespace

SimulatePanel::SimulatePanel(Workbench& workbench, QWidget* parent)
    : QWidget(parent), workbench_(workbench), ui_(std::make_unique<Ui::SimulatePanel>()) {
  ui_->setupUi(this);
  wire_more(ui_->moreButton, ui_->moreBox);
  for (const Integrator integrator :
       {Integrator::rk4, Integrator::verlet, Integrator::velocity_verlet, Integrator::symplectic_euler,
        Integrator::euler, Integrator::implicit_euler})
    ui_->integratorCombo->addItem(name_of(integrator), static_cast<int>(integrator));
  ui_->stepWarningIcon->setPixmap(icon_pixmap("warning", colors::amber, 20, devicePixelRatioF()));
  ui_->radiusSpin->setValue(workbench_.grab_radius_mm());
  wire_physics();
  wire_step();
  wire_anchors();
  wire_grab();
  connect(ui_->simulateButton, &QPushButton::clicked, this,
          [this] { workbench_.playing() ? workbench_.pause() : workbench_.play(); });
  connect(&workbench_, &Workbench::volumeOpened, this, &SimulatePanel::show_units);
  connect(&workbench_, &Workbench::geometryStated, this, &SimulatePanel::show_units);
  connect(&workbench_, &Workbench::simulationSettingsChanged, this, &SimulatePanel::show_settings);
  for (const auto signal :
       {&Workbench::simulationStarted, &Workbench::simulationReady, &Workbench::simulationStopped,
        &Workbench::tissueBuilt, &Workbench::tissueDropped, &Workbench::frameArrived}) {
    connect(&workbench_, signal, this, &SimulatePanel::refresh);
  }
  name_gravity();
  show_settings();
  refresh();
}

SimulatePanel::~SimulatePanel() = default;

void SimulatePanel::change(const std::function<void(Settings&)>& put) {
  if (filling_) return;
  Settings settings = workbench_.recipe().simulation;
  put(settings);
  workbench_.set_simulation(settings);
}

void SimulatePanel::bind(QDoubleSpinBox* field, std::function<void(Settings&, double)> put) {
  connect(field, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this,
          [this, put = std::move(put)](double value) { change([&](Settings& s) { put(s, value); }); });
}

void SimulatePanel::bind(QCheckBox* field, std::function<void(Settings&, bool)> put) {
  connect(field, &QCheckBox::toggled, this,
          [this, put = std::move(put)](bool on) { change([&](Settings& s) { put(s, on); }); });
}

void SimulatePanel::bind(QComboBox* field, std::function<void(Settings&, int)> put) {
  connect(field, QOverload<int>::of(&QComboBox::activated), this,
          [this, put = std::move(put)](int index) { change([&](Settings& s) { put(s, index); }); });
}

void SimulatePanel::wire_physics() {
  bind(ui_->stiffnessSpin, [](Settings& s, double v) { s.parameters.stiffness_per_s2 = v; });
  connect(ui_->stiffnessSlider, &QSlider::valueChanged, this, [this](int slider) {
    change([&](Settings& s) { s.parameters.stiffness_per_s2 = stiffness_of(slider); });
  });
  bind(ui_->dampingSpin, [](Settings& s, double v) { s.parameters.damping_per_s = v; });
  bind(ui_->dragSpin, [](Settings& s, double v) { s.parameters.drag_per_s = v; });
  bind(ui_->massSpin, [](Settings& s, double v) { s.parameters.mass = v; });
  const std::array<QDoubleSpinBox*, 3> gravity{ui_->gravityX, ui_->gravityY, ui_->gravityZ};
  for (int axis = 0; axis < 3; ++axis) {
    bind(gravity[static_cast<std::size_t>(axis)],
         [this, axis](Settings& s, double v) { s.parameters.gravity_mm_per_s2[axis] = v / per_mm_; });
  }
  bind(ui_->gravityCombo, [](Settings& s, int preset) {
    auto& g = s.parameters.gravity_mm_per_s2;
    if (preset == no_gravity) g.setZero();
    if (preset == lying) g = {0.0, earth_mm_per_s2, 0.0};
    if (preset == upright) g = {0.0, 0.0, -earth_mm_per_s2};
  });
  connect(ui_->gravityCombo, QOverload<int>::of(&QComboBox::activated), this, [this](int preset) {
    if (preset != own) return;
    ui_->moreButton->setChecked(true);
    ui_->gravityX->setFocus();
    ui_->gravityCombo->setCurrentIndex(own);
  });
  bind(ui_->integratorCombo, [this](Settings& s, int index) {
    s.parameters.integrator = static_cast<Integrator>(ui_->integratorCombo->itemData(index).toInt());
  });
  bind(ui_->layoutCombo,
       [](Settings& s, int index) { s.layout = static_cast<simulation::LayoutChoice>(index); });
  bind(ui_->scaleStiffness, [](Settings& s, bool on) { s.scaling.stiffness = on; });
  bind(ui_->scaleDamping, [](Settings& s, bool on) { s.scaling.damping = on; });
  bind(ui_->scaleDrag, [](Settings& s, bool on) { s.scaling.drag = on; });
  bind(ui_->scaleMass, [](Settings& s, bool on) { s.scaling.mass = on; });
  bind(ui_->beatCheck, [](Settings& s, bool on) { s.parameters.beat_amplitude = on ? usual_beat : 0.0; });
  bind(ui_->beatPeriodSpin, [](Settings& s, double v) { s.parameters.beat_period_s = v; });
  bind(ui_->beatAmplitudeSpin, [](Settings& s, double v) { s.parameters.beat_amplitude = v / 100.0; });
  connect(ui_->deviceCombo, QOverload<int>::of(&QComboBox::currentIndexChanged), this, [this](int index) {
    if (!filling_) workbench_.set_device(ui_->deviceCombo->itemData(index).toString());
  });
  connect(&workbench_, &Workbench::devicesFound, this, [this](const QVector<DeviceChoice>& devices) {
    const QSignalBlocker quiet(ui_->deviceCombo);
    ui_->deviceCombo->clear();
    for (const auto& device : devices) ui_->deviceCombo->addItem(device.text, device.selector);
    ui_->deviceCombo->setCurrentIndex(std::max(0, ui_->deviceCombo->findData(workbench_.device())));
  });
}

void SimulatePanel::wire_grab() {
  connect(ui_->radiusSpin, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this,
          &SimulatePanel::take_grab);
  connect(ui_->grabKindCombo, QOverload<int>::of(&QComboBox::currentIndexChanged), this,
          &SimulatePanel::take_grab);
  connect(ui_->brushFreesCheck, &QCheckBox::toggled, &workbench_, &Workbench::set_brush_frees);
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
    ui_->radiusSpin->setToolTip(
        tr("Radius of what the grab holds and the anchor brush fixes, in %1").arg(unit.trimmed()));
    ui_->radiusSpin->setAccessibleName(ui_->radiusSpin->toolTip());
    ui_->radiusSpin->setValue(radius_mm * per_mm_);
  }
  name_gravity();
  show_settings();
}

// Where the patient lies is known only where the scan's axes are.
void SimulatePanel::name_gravity() {
  const bool patient = workbench_.info().patient_axes;
  ui_->gravityCombo->setItemText(lying, patient ? tr("Down (lying)") : tr("Along +y of the scan"));
  ui_->gravityCombo->setItemText(upright, patient ? tr("Down (upright)") : tr("Along −z of the scan"));
  const QString unit = QLatin1Char(' ') + length_unit(workbench_.info()) + QStringLiteral("/s²");
  const std::pair<QDoubleSpinBox*, QString> fields[] = {
      {ui_->gravityX, patient ? tr("the left of the patient") : tr("+x of the scan")},
      {ui_->gravityY, patient ? tr("the back of the patient") : tr("+y of the scan")},
      {ui_->gravityZ, patient ? tr("the head of the patient") : tr("+z of the scan")}};
  for (const auto& [field, side] : fields) {
    field->setSuffix(unit);
    field->setToolTip(tr("Gravity towards %1,%2").arg(side, unit));
    field->setAccessibleName(field->toolTip());
  }
}

void SimulatePanel::show_settings() {
  filling_ = true;
  const auto& settings = workbench_.recipe().simulation;
  const auto& parameters = settings.parameters;
  ui_->stiffnessSpin->setValue(parameters.stiffness_per_s2);
  ui_->stiffnessSlider->setValue(slider_of(parameters.stiffness_per_s2));
  ui_->dampingSpin->setValue(parameters.damping_per_s);
  ui_->dragSpin->setValue(parameters.drag_per_s);
  ui_->massSpin->setValue(parameters.mass);
  ui_->gravityCombo->setCurrentIndex(preset_of(parameters.gravity_mm_per_s2));
  ui_->gravityX->setValue(parameters.gravity_mm_per_s2.x() * per_mm_);
  ui_->gravityY->setValue(parameters.gravity_mm_per_s2.y() * per_mm_);
  ui_->gravityZ->setValue(parameters.gravity_mm_per_s2.z() * per_mm_);
  ui_->integratorCombo->setCurrentIndex(
      ui_->integratorCombo->findData(static_cast<int>(parameters.integrator)));
  ui_->layoutCombo->setCurrentIndex(static_cast<int>(settings.layout));
  ui_->scaleStiffness->setChecked(settings.scaling.stiffness);
  ui_->scaleDamping->setChecked(settings.scaling.damping);
  ui_->scaleDrag->setChecked(settings.scaling.drag);
  ui_->scaleMass->setChecked(settings.scaling.mass);
  ui_->stepAuto->setChecked(!settings.step_s.has_value());
  if (settings.step_s) ui_->stepSpin->setValue(*settings.step_s * 1000.0);
  ui_->stepSpin->setEnabled(settings.step_s.has_value());
  ui_->deviceCombo->setCurrentIndex(std::max(0, ui_->deviceCombo->findData(workbench_.device())));
  show_beat();
  filling_ = false;
  show_anchors();
  show_limit();
  show_layout();
}

void SimulatePanel::show_beat() {
  const auto& parameters = workbench_.recipe().simulation.parameters;
  const bool beats = parameters.beat_amplitude > 0.0;
  ui_->beatCheck->setChecked(beats);
  for (auto* field : {ui_->beatPeriodSpin, ui_->beatAmplitudeSpin}) field->setEnabled(beats);
  ui_->beatPeriodSpin->setValue(parameters.beat_period_s);
  ui_->beatPeriodSpin->setSuffix(tr(" s  (%1 a minute)").arg(short_number(60.0 / parameters.beat_period_s)));
  ui_->beatAmplitudeSpin->setValue(100.0 * (beats ? parameters.beat_amplitude : usual_beat));
}

void SimulatePanel::show_layout() {
  const auto& frame = workbench_.last_frame();
  QString text;
  if (frame && !frame->layout.empty()) {
    text = tr("In use: %1").arg(QString::fromStdString(frame->layout));
    if (!frame->layout_reason.empty())
      text += QStringLiteral(" – ") + QString::fromStdString(frame->layout_reason);
  }
  if (ui_->layoutReason->text() != text) ui_->layoutReason->setText(text);
  ui_->layoutReason->setVisible(!text.isEmpty());
  // Points without a lattice cannot be laid out as one.
  const bool lattice = !workbench_.has_tissue() || workbench_.tissue()->tissue->on_lattice;
  auto* choices = qobject_cast<QStandardItemModel*>(ui_->layoutCombo->model());
  if (choices != nullptr) choices->item(1)->setEnabled(lattice);
}

void SimulatePanel::refresh() {
  const bool playing = workbench_.playing();
  ui_->simulateButton->setEnabled(workbench_.simulation_ready());
  const QString text = playing ? tr("Pause") : tr("Play");
  if (ui_->simulateButton->text() != text || ui_->simulateButton->icon().isNull()) {
    ui_->simulateButton->setText(text);
    ui_->simulateButton->setIcon(icon(playing ? "pause" : "play", colors::ground));
  }
  show_limit();
  show_layout();
  const auto& frame = workbench_.last_frame();
  const int recoveries = frame ? frame->recoveries : 0;
  ui_->recoveryLabel->setVisible(recoveries > 0);
  if (recoveries > 0)
    ui_->recoveryLabel->setText(
        tr("Brought back %n time(s) since the last reset: a part was done again with a smaller step.",
           nullptr, recoveries));
}

}  // namespace palpate::gui
