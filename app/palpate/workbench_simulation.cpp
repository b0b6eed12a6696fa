// The half of the workbench that speaks with the simulation's thread.
#include "text.hpp"
#include "workbench.hpp"

#include "palpate/compute/device.hpp"

#include <algorithm>
#include <chrono>

namespace palpate::gui {
namespace {
// One frame a refresh of a 60 Hz screen; what lies between is dropped by the driver.
constexpr int frame_interval_ms = 16;
}  // namespace

void Workbench::start_driver() {
  stop_driver();
  const quint64 epoch = ++driver_epoch_;
  session::DriverSetup setup;
  setup.tissue = *built_;
  setup.surface = surface_;
  setup.settings = recipe_.simulation;
  setup.device = device_.toStdString();
  since_frame_.start();
  emit simulationStarted();
  // Both callbacks come from the simulation's thread and only post.
  driver_ = std::make_unique<session::SimulationDriver>(
      std::move(setup),
      [this, epoch] {
        QMetaObject::invokeMethod(
            this,
            [this, epoch] {
              if (epoch != driver_epoch_ || frame_delay_.isActive()) return;
              const qint64 left = frame_interval_ms - since_frame_.elapsed();
              if (left <= 0) {
                take_frame();
              } else {
                frame_delay_.start(static_cast<int>(left));
              }
            },
            Qt::QueuedConnection);
      },
      [this, epoch](const session::DriverEvent& event) {
        QMetaObject::invokeMethod(
            this, [this, epoch, event] { on_event(epoch, event); }, Qt::QueuedConnection);
      });
}

void Workbench::stop_driver() {
  ++driver_epoch_;
  frame_delay_.stop();
  retire_driver();
  ready_ = false;
  frame_.reset();
}

// A driver that builds its kernels, or takes a slow step, ends only after that;
// the window does not wait for it.
void Workbench::retire_driver() {
  retired_.erase(std::remove_if(retired_.begin(), retired_.end(),
                                [](const std::future<void>& one) {
                                  return one.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
                                }),
                 retired_.end());
  if (!driver_) return;
  std::shared_ptr<session::SimulationDriver> ending = std::move(driver_);
  retired_.push_back(std::async(std::launch::async, [last = std::move(ending)]() mutable { last.reset(); }));
}

void Workbench::take_frame() {
  if (!driver_) return;
  auto frame = driver_->take_frame();
  if (!frame) return;
  since_frame_.restart();
  frame_ = std::move(frame);
  if (!ready_) {
    ready_ = true;
    emit simulationReady();
  }
  emit frameArrived();
}

void Workbench::on_event(quint64 epoch, const session::DriverEvent& event) {
  if (epoch != driver_epoch_) return;
  using Kind = session::DriverEvent::Kind;
  if (event.kind == Kind::ready) {
    if (!ready_) {
      ready_ = true;
      emit simulationReady();
    }
    return;
  }
  Problem problem;
  problem.text = QString::fromStdString(event.text);
  problem.code = QString::fromStdString(event.code);
  problem.details = QString::fromStdString(event.details);
  problem.warning = event.kind == Kind::recovered;
  // Whatever failed in the device, the reference needs none.
  if (event.kind == Kind::failed && device_ != QStringLiteral("reference")) {
    problem.offer = Problem::Offer::reference_device;
  }
  emit problemFound(problem);
}

void Workbench::set_simulation(const session::SimulationSettings& settings) {
  recipe_.simulation = settings;
  if (driver_) {
    driver_->set_parameters(settings.parameters);
    driver_->set_step_s(settings.step_s);
  }
  emit simulationSettingsChanged();
}

void Workbench::set_device(const QString& selector) {
  device_ = selector;
  if (built_) start_driver();
  emit simulationSettingsChanged();
}

// Asking the drivers may take a second; the window does not wait for it.
void Workbench::find_devices() {
  jobs_.start(
      JobLane::devices, QString(),
      [this](const core::Progress&) -> JobTracker::Delivery {
        QVector<DeviceChoice> devices;
        devices.append({QString(), tr("Automatic")});
        for (const auto& device : compute::list_devices()) {
          if (!device.usable) continue;
          devices.append({QString::number(device.index), short_device(QString::fromStdString(device.name))});
        }
        devices.append({QStringLiteral("reference"), tr("CPU reference (slow, exact)")});
        return [this, devices] { emit devicesFound(devices); };
      },
      {});
}

void Workbench::play() {
  if (driver_) driver_->play();
}
void Workbench::pause() {
  if (driver_) driver_->pause();
}
void Workbench::step_once() {
  if (driver_) driver_->step_once();
}
void Workbench::reset() {
  if (driver_) driver_->reset();
}

void Workbench::set_grab(double radius_mm, interaction::SelectionKind kind) {
  grab_radius_mm_ = radius_mm;
  grab_kind_ = kind;
}

// Who pulls wants to see it give way: a grab sets a resting simulation going.
void Workbench::grab(const interaction::Ray& ray, const interaction::PickReach& reach) {
  if (!driver_) return;
  driver_->grab(ray, reach, grab_radius_mm_, grab_kind_);
  if (!playing()) driver_->play();
}
void Workbench::drag(const interaction::Ray& ray) {
  if (driver_) driver_->drag(ray);
}
void Workbench::release() {
  if (driver_) driver_->release();
}

}  // namespace palpate::gui
