#pragma once

#include "palpate/core/error.hpp"

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace palpate::core {

/// A shared flag; copies refer to the same request. Safe from any thread.
class CancelToken {
 public:
  CancelToken() : flag_(std::make_shared<std::atomic<bool>>(false)) {}
  void cancel() const noexcept { flag_->store(true, std::memory_order_relaxed); }
  bool cancelled() const noexcept { return flag_->load(std::memory_order_relaxed); }
  /// Throws Error(cancelled) once cancel() was called.
  void check() const {
    if (cancelled()) throw_cancelled();
  }

 private:
  std::shared_ptr<std::atomic<bool>> flag_;
};

/// How far a long call is, told to whoever asked, with the way to stop it.
/// A default Progress reports to nobody. `report` throws Error(cancelled)
/// when the token was cancelled, so that every report is a place to stop.
class Progress {
 public:
  using Callback = std::function<void(double fraction, const std::string& what)>;

  Progress() = default;
  Progress(Callback callback, CancelToken cancel)
      : callback_(std::move(callback)), cancel_(std::move(cancel)) {}

  /// fraction in [0, 1] of this call's own work.
  void report(double fraction, const std::string& what) const {
    cancel_.check();
    if (callback_) callback_(from_ + (to_ - from_) * std::clamp(fraction, 0.0, 1.0), what);
  }
  const CancelToken& cancel() const noexcept { return cancel_; }

  /// The part [from, to] of this progress, handed to a callee.
  Progress part(double from, double to) const {
    Progress sub = *this;
    sub.from_ = from_ + (to_ - from_) * from;
    sub.to_ = from_ + (to_ - from_) * to;
    return sub;
  }

 private:
  Callback callback_;
  CancelToken cancel_;
  double from_ = 0.0;
  double to_ = 1.0;
};

}  // namespace palpate::core
