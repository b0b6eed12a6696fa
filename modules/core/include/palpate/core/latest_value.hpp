#pragma once

#include <mutex>
#include <optional>
#include <utility>

namespace palpate::core {

/// Hands the newest value from one thread to another; older ones that nobody
/// took are dropped, so the reader is never behind. Never a queue.
template <typename T>
class LatestValue {
 public:
  /// Returns true when the slot was empty, so that the reader needs a wake-up.
  bool publish(T value) {
    std::lock_guard<std::mutex> lock(mutex_);
    const bool was_empty = !slot_.has_value();
    slot_ = std::move(value);
    return was_empty;
  }
  std::optional<T> take() {
    std::lock_guard<std::mutex> lock(mutex_);
    std::optional<T> taken = std::move(slot_);
    slot_.reset();
    return taken;
  }

 private:
  std::mutex mutex_;
  std::optional<T> slot_;
};

}  // namespace palpate::core
