#include "filter_preview.hpp"

#include <cstddef>

namespace palpate::gui {
namespace {
// Long enough that a slider does not start a hundred of them, short enough to feel live.
constexpr int delay_ms = 80;
}  // namespace

FilterPreview::FilterPreview(QObject* parent) : QObject(parent) {
  delay_.setSingleShot(true);
  delay_.setInterval(delay_ms);
  connect(&delay_, &QTimer::timeout, this, &FilterPreview::run);
}

void FilterPreview::show(const core::Volume& source, const std::vector<imaging::FilterStep>& chain,
                         const imaging::FilterOptions& options) {
  if (chain.empty()) {
    stop();
    return;
  }
  const bool same = source.data() == source_.data() && source.geometry() == source_.geometry();
  if (same && chain == chain_ && options.device == options_.device) return;
  // Another frame or geometry: what was shown does not lie there any more.
  if (!same) made_ = {};
  for (auto& slice : made_)
    if (slice) slice->fresh = false;
  source_ = source;
  chain_ = chain;
  options_ = options;
  wait();
  emit changed();
}

void FilterPreview::stop() {
  if (!active()) return;
  delay_.stop();
  jobs_.cancel_all();
  chain_.clear();
  source_ = {};
  made_ = {};
  emit changed();
}

void FilterPreview::want(int axis, std::optional<int> index) {
  auto& wanted = wanted_[static_cast<std::size_t>(axis)];
  if (wanted == index) return;
  wanted = index;
  if (active() && missing(axis)) wait();
}

bool FilterPreview::missing(int axis) const {
  const auto& wanted = wanted_[static_cast<std::size_t>(axis)];
  const auto& made = made_[static_cast<std::size_t>(axis)];
  return wanted && (!made || !made->fresh || made->index != *wanted);
}

std::optional<core::Volume> FilterPreview::slice(int axis, int index) const {
  const auto& made = made_[static_cast<std::size_t>(axis)];
  if (!active() || !made || made->index != index) return std::nullopt;
  return made->volume;
}

bool FilterPreview::settled() const {
  for (int axis = 0; axis < 3; ++axis)
    if (missing(axis)) return false;
  return active();
}

void FilterPreview::wait() {
  jobs_.cancel_all();
  delay_.start();
}

// One slice after the other, so that the first is seen while the rest is made.
void FilterPreview::run() {
  int axis = 0;
  while (axis < 3 && !missing(axis)) ++axis;
  if (!active() || axis == 3) return;
  const int index = *wanted_[static_cast<std::size_t>(axis)];
  jobs_.start(
      JobLane::preview, QString(),
      [this, axis, index, source = source_, chain = chain_,
       options = options_](const core::Progress& progress) -> JobTracker::Delivery {
        const core::Volume made = imaging::filter_slice(source, chain, axis, index, options, progress);
        return [this, axis, index, made] {
          made_[static_cast<std::size_t>(axis)] = Slice{index, made, true};
          emit changed();
          if (!delay_.isActive()) run();
        };
      },
      [this](const core::Error& error) {
        made_ = {};
        emit changed();
        emit failed(QString::fromUtf8(error.what()));
      });
}

}  // namespace palpate::gui
