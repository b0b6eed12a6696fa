#include "palpate/session/simulation_driver.hpp"

#include "driver_loop.hpp"

#include "palpate/core/error.hpp"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <new>
#include <thread>
#include <utility>

namespace palpate::session {

struct SimulationDriver::Impl {
  Impl(DriverSetup given, Notify notify_, Tell tell_)
      : setup(std::move(given)),
        notify(std::move(notify_)),
        tell(std::move(tell_)),
        thread([this] { work(); }) {}

  ~Impl() {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      stop.cancel();
    }
    wake.notify_one();
    thread.join();
  }

  void push(Command command) {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      if (ended) return;
      // Only the newest place of a drag counts; a slow device gets no queue of them.
      const bool replaces = std::holds_alternative<command::DragTo>(command) && !commands.empty() &&
                            std::holds_alternative<command::DragTo>(commands.back());
      if (replaces) commands.pop_back();
      commands.push_back(std::move(command));
    }
    wake.notify_one();
  }

  /// Nothing throws across the thread: errors leave it as events.
  void work() noexcept {
    try {
      simulate();
    } catch (const core::Error& error) {
      if (error.kind() != core::ErrorKind::cancelled)
        say({DriverEvent::Kind::failed, error.what(), error.code(), error.details()});
    } catch (const std::bad_alloc&) {
      say({DriverEvent::Kind::failed,
           "There is not enough memory to simulate this tissue. Take a larger stride or a smaller crop box.",
           "memory", ""});
    } catch (const std::exception& error) {
      say({DriverEvent::Kind::failed, std::string("The simulation stopped: ") + error.what(), "internal",
           ""});
    }
    const std::lock_guard<std::mutex> lock(mutex);
    ended = true;
    commands.clear();
  }

  void say(const DriverEvent& event) noexcept {
    try {
      if (tell) tell(event);
    } catch (...) {  // a listener's failure is not the simulation's
    }
  }

  void show(Frame frame) {
    if (!latest.publish(std::move(frame)) || !notify) return;
    try {
      notify();
    } catch (...) {  // as above
    }
  }

  void simulate() {
    DriverLoop loop(
        setup, [this](Frame frame) { show(std::move(frame)); },
        [this](const DriverEvent& event) { say(event); },
        [this](Command command) { push(std::move(command)); }, stop);
    loop.publish_if_changed();
    say({DriverEvent::Kind::ready, "Ready.", "", ""});
    auto next = DriverLoop::Clock::now();
    while (true) {
      std::deque<Command> taken;
      {
        std::unique_lock<std::mutex> lock(mutex);
        const auto called = [this] { return stop.cancelled() || !commands.empty(); };
        if (loop.playing())
          wake.wait_until(lock, next, called);
        else
          wake.wait(lock, called);
        if (stop.cancelled()) return;
        taken.swap(commands);
      }
      for (const auto& command : taken) {
        if (stop.cancelled()) return;
        apply(loop, command);
      }
      next = loop.advance(DriverLoop::Clock::now());
      loop.publish_if_changed();
    }
  }

  /// A command with a parameter out of its range, or a file that cannot be used,
  /// is refused; the simulation goes on.
  void apply(DriverLoop& loop, const Command& command) {
    try {
      loop.apply(command);
    } catch (const core::Error& error) {
      if (error.kind() != core::ErrorKind::usage && error.kind() != core::ErrorKind::input) throw;
      say({DriverEvent::Kind::refused, error.what(), error.code(), error.details()});
    }
  }

  const DriverSetup setup;
  const Notify notify;
  const Tell tell;
  core::LatestValue<Frame> latest;
  std::mutex mutex;
  std::condition_variable wake;
  std::deque<Command> commands;
  const core::CancelToken stop;
  bool ended = false;
  std::thread thread;  // last: it uses all of the above
};

SimulationDriver::SimulationDriver(DriverSetup setup, Notify notify, Tell tell)
    : impl_(std::make_unique<Impl>(std::move(setup), std::move(notify), std::move(tell))) {}
SimulationDriver::~SimulationDriver() = default;

void SimulationDriver::play() { impl_->push(command::Play{}); }
void SimulationDriver::pause() { impl_->push(command::Pause{}); }
void SimulationDriver::step_once() { impl_->push(command::StepOnce{}); }
void SimulationDriver::reset() { impl_->push(command::Reset{}); }
void SimulationDriver::set_parameters(const simulation::Parameters& parameters) {
  impl_->push(command::SetParameters{parameters});
}
void SimulationDriver::set_settings(const SimulationSettings& settings) {
  impl_->push(command::SetSettings{settings});
}
void SimulationDriver::set_step_s(std::optional<double> step_s) { impl_->push(command::SetStep{step_s}); }
void SimulationDriver::grab(const interaction::Ray& ray, const interaction::PickReach& reach,
                            double radius_mm, interaction::SelectionKind kind) {
  impl_->push(command::GrabAt{ray, reach, radius_mm, kind});
}
void SimulationDriver::drag(const interaction::Ray& ray) { impl_->push(command::DragTo{ray}); }
void SimulationDriver::release() { impl_->push(command::Release{}); }
void SimulationDriver::undo() { impl_->push(command::Undo{}); }
void SimulationDriver::redo() { impl_->push(command::Redo{}); }

std::optional<Frame> SimulationDriver::take_frame() { return impl_->latest.take(); }

}  // namespace palpate::session
