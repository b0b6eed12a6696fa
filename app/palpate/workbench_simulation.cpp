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

void Workbench::start_driver(std::optional<simulation::State> from) {
  stop_driver();
  const quint64 epoch = ++driver_epoch_;
  session::DriverSetup setup;
  setup.tissue = *built_;
  setup.surface = surface_;
  setup.settings = recipe_.simulation;
  setup.device = device_.toStdString();
  setup.start = std::move(from);
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
  stopped_ = false;
  pulls_ = 0;
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
  const bool other_point = limit_shown_ && frame_ && frame_->worst_point != frame->worst_point;
  frame_ = std::move(frame);
  // The last frame may come after the word that there will be no more.
  if (stopped_) frame_->playing = false;
  if (!ready_ && !stopped_) {
    ready_ = true;
    emit simulationReady();
  }
  emit frameArrived();
  if (other_point && !playing()) emit limitShown();
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
  if (event.kind == Kind::failed) offer_way_on(problem);
  emit problemFound(problem);
}

// The last state stays on the screen, and can be saved as a picture or session.
void Workbench::offer_way_on(Problem& problem) {
  ready_ = false;
  stopped_ = true;
  if (frame_) frame_->playing = false;
  emit simulationStopped();
  // Whatever failed in the device, the reference needs none.
  if (device_ == QStringLiteral("reference")) return;
  problem.offer = Problem::Offer::reference_device;
  if (problem.code != QStringLiteral("device-lost") || !frame_) return;
  const QString lost = short_device(QString::fromStdString(frame_->device));
  for (const auto& device : devices_) {
    const bool usable = !device.selector.isEmpty() && device.selector != QStringLiteral("reference");
    if (!usable || device.selector == device_ || device.text == lost) continue;
    problem.offer = Problem::Offer::other_device;
    problem.other_device = device.selector;
    problem.other_device_name = device.text;
    return;
  }
}

void Workbench::go_on_with(const QString& selector) {
  device_ = selector;
  std::optional<simulation::State> from;
  if (built_ && frame_ && frame_->positions_mm) {
    from.emplace();
    from->time_s = frame_->time_s;
    from->positions_mm = *frame_->positions_mm;
    from->velocities_mm_per_s.assign(from->positions_mm.size(), Eigen::Vector3f::Zero());
  }
  if (built_) start_driver(std::move(from));
  emit simulationSettingsChanged();
}

std::optional<StepLimit> Workbench::step_limit() const {
  if (!built_) return std::nullopt;
  const auto points = built_->tissue->points.size();
  StepLimit limit;
  if (frame_) {
    limit = {frame_->stable_step_s, static_cast<std::uint32_t>(frame_->worst_point),
             frame_->stable_step_is_estimate};
  } else {
    limit = {built_->stable_step.step_s, static_cast<std::uint32_t>(built_->stable_step.worst_point),
             built_->stable_step.is_estimate};
  }
  if (limit.worst_point >= points) return std::nullopt;
  return limit;
}

std::optional<Eigen::Vector3d> Workbench::limiting_place_mm() const {
  const auto limit = step_limit();
  if (!limit) return std::nullopt;
  return visualization::place_of(content(), limit->worst_point);
}

void Workbench::show_limiting_point(bool shown) {
  if (limit_shown_ == shown) return;
  limit_shown_ = shown;
  emit limitShown();
}

void Workbench::set_simulation(const session::SimulationSettings& settings) {
  using Rule = session::AnchorSettings::Rule;
  const session::AnchorSettings before = recipe_.simulation.anchors;
  const session::AnchorSettings& wanted = settings.anchors;
  const bool other = wanted.rule != before.rule || wanted.file != before.file;
  const bool unread = other && wanted.rule == Rule::file && wanted.file != before.file;
  recipe_.simulation = settings;
  if (unread) recipe_.simulation.anchors = before;
  if (stopped_ && !frame_) {
    start_driver();  // it never began: perhaps it does with these
  } else if (driver_) {
    driver_->set_settings(recipe_.simulation);
  }
  emit simulationSettingsChanged();
  if (unread) {
    check_anchor_file(wanted);
  } else if (other) {
    find_anchors();
  }
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
        return [this, devices] {
          devices_ = devices;
          emit devicesFound(devices);
        };
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
  if (!driver_) return;
  driver_->reset();
  ++pulls_;
  anchor_redo_.clear();
}

void Workbench::set_grab(double radius_mm, interaction::SelectionKind kind) {
  grab_radius_mm_ = radius_mm;
  grab_kind_ = kind;
}

// Who pulls wants to see it give way: a grab sets a resting simulation going.
void Workbench::grab(const interaction::Ray& ray, const interaction::PickReach& reach) {
  if (!driver_) return;
  driver_->grab(ray, reach, grab_radius_mm_, grab_kind_);
  ++pulls_;
  anchor_redo_.clear();
  if (!playing()) driver_->play();
}
void Workbench::drag(const interaction::Ray& ray) {
  if (driver_) driver_->drag(ray);
}
void Workbench::release() {
  if (driver_) driver_->release();
}

}  // namespace palpate::gui
