#pragma once

#include <vector>

namespace palpate::gui {

/// Which frame of a 4-D scan is due when it plays at its recorded rate. Frames
/// are dropped rather than shown late: the clock never waits.
class FrameClock {
 public:
  /// Where no times are known.
  static constexpr double assumed_frames_per_s = 20.0;

  FrameClock() = default;
  /// Times that are missing, do not rise or are not finite count as unknown.
  FrameClock(int frames, const std::vector<double>& times_s);

  int frames() const { return static_cast<int>(starts_s_.size()); }
  bool rate_is_known() const { return known_; }
  /// Of one run through all frames; the last frame is shown as long as the
  /// frames are on average.
  double period_s() const { return period_s_; }
  double frames_per_s() const;
  /// When a frame begins, from the first one.
  double start_of(int frame) const;
  /// The frame that is due, `elapsed_s` after frame `from` was shown. Without
  /// loop it ends at the last frame.
  int frame_at(int from, double elapsed_s, bool loop) const;
  /// How long until the next frame is due after that.
  double wait_s(int from, double elapsed_s) const;

 private:
  std::vector<double> starts_s_{0.0};
  double period_s_ = 1.0 / assumed_frames_per_s;
  bool known_ = false;
};

}  // namespace palpate::gui
