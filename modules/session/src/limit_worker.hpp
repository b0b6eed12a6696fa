#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/simulation/stability.hpp"

#include <atomic>
#include <functional>
#include <optional>
#include <thread>

namespace palpate::session {

/// Finds a stable step beside the simulation's thread, one at a time.
class LimitWorker {
 public:
  using Work = std::function<simulation::StableStep(const core::Progress&)>;
  /// Called from the worker at its end; with nothing where it failed or was cancelled.
  using Done = std::function<void(const std::optional<simulation::StableStep>&)>;

  LimitWorker() = default;
  LimitWorker(const LimitWorker&) = delete;
  LimitWorker& operator=(const LimitWorker&) = delete;
  ~LimitWorker();

  bool is_busy() const noexcept { return busy_; }
  /// Not while it is busy.
  void start(Work work, Done done);
  /// Returns at once; what is in hand ends within a pass over the links.
  void cancel();

 private:
  std::atomic<bool> busy_{false};
  core::CancelToken cancel_;
  std::thread thread_;
};

}  // namespace palpate::session
