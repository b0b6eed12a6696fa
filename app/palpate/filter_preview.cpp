#include "filter_preview.hpp"

#include <cstddef>
#include <memory>
#include <utility>

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

void FilterPreview::run() {
  if (!active()) return;
  std::vector<std::pair<int, int>> slices;
  for (int axis = 0; axis < 3; ++axis)
    if (missing(axis)) slices.emplace_back(axis, *wanted_[static_cast<std::size_t>(axis)]);
  if (slices.empty()) return;
  jobs_.start(
      JobLane::preview, QString(),
      [this, slices, source = source_, chain = chain_,
       options = options_](const core::Progress& progress) -> JobTracker::Delivery {
        auto made = std::make_shared<std::vector<core::Volume>>();
        for (const auto& [axis, index] : slices)
          made->push_back(imaging::filter_slice(source, chain, axis, index, options, progress));
        return [this, slices, made] {
          for (std::size_t n = 0; n < slices.size(); ++n)
            made_[static_cast<std::size_t>(slices[n].first)] = Slice{slices[n].second, (*made)[n], true};
          emit changed();
        };
      },
      [this](const core::Error& error) {
        made_ = {};
        emit changed();
        emit failed(QString::fromUtf8(error.what()));
      });
}

}  // namespace palpate::gui
