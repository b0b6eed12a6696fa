#include "frame_clock.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::gui {
namespace {

bool are_usable(const std::vector<double>& times_s, std::size_t frames) {
  if (times_s.size() != frames || frames < 2) return false;
  for (std::size_t n = 0; n < frames; ++n) {
    if (!std::isfinite(times_s[n]) || (n > 0 && times_s[n] <= times_s[n - 1])) return false;
  }
  return true;
}

}  // namespace

FrameClock::FrameClock(int frames, const std::vector<double>& times_s) {
  const auto count = static_cast<std::size_t>(std::max(1, frames));
  known_ = are_usable(times_s, count);
  starts_s_.resize(count);
  for (std::size_t n = 0; n < count; ++n)
    starts_s_[n] = known_ ? times_s[n] - times_s[0] : static_cast<double>(n) / assumed_frames_per_s;
  const double mean_s =
      count > 1 ? starts_s_.back() / static_cast<double>(count - 1) : 1.0 / assumed_frames_per_s;
  period_s_ = starts_s_.back() + mean_s;
}

double FrameClock::frames_per_s() const { return static_cast<double>(frames()) / period_s_; }

double FrameClock::start_of(int frame) const {
  return starts_s_[static_cast<std::size_t>(std::clamp(frame, 0, frames() - 1))];
}

int FrameClock::frame_at(int from, double elapsed_s, bool loop) const {
  double place_s = start_of(from) + std::max(0.0, elapsed_s);
  if (loop) {
    place_s = std::fmod(place_s, period_s_);
  } else if (place_s >= starts_s_.back()) {
    return frames() - 1;
  }
  // A tick that comes a rounding too early shall not show the frame before.
  const double slack_s = 1e-9 * period_s_;
  const auto next = std::upper_bound(starts_s_.begin(), starts_s_.end(), place_s + slack_s);
  return static_cast<int>(next - starts_s_.begin()) - 1;
}

double FrameClock::wait_s(int from, double elapsed_s) const {
  const double place_s = std::fmod(start_of(from) + std::max(0.0, elapsed_s), period_s_);
  const auto next = std::upper_bound(starts_s_.begin(), starts_s_.end(), place_s + 1e-9 * period_s_);
  return (next == starts_s_.end() ? period_s_ : *next) - place_s;
}

}  // namespace palpate::gui
