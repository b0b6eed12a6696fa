#include "filtered_frames.hpp"

#include <algorithm>

namespace palpate::gui {

std::optional<core::Volume> FilteredFrames::find(const std::vector<imaging::FilterStep>& chain, int frame) {
  if (!(chain == chain_)) return std::nullopt;
  const auto found =
      std::find_if(kept_.begin(), kept_.end(), [&](const auto& one) { return one.first == frame; });
  if (found == kept_.end()) return std::nullopt;
  std::rotate(found, found + 1, kept_.end());
  return kept_.back().second;
}

void FilteredFrames::put(const std::vector<imaging::FilterStep>& chain, int frame,
                         const core::Volume& volume) {
  if (!(chain == chain_)) kept_.clear();
  chain_ = chain;
  kept_.erase(std::remove_if(kept_.begin(), kept_.end(), [&](const auto& one) { return one.first == frame; }),
              kept_.end());
  kept_.emplace_back(frame, volume);
  std::size_t bytes = 0;
  for (const auto& one : kept_) bytes += one.second.size() * sizeof(float);
  while (bytes > budget_bytes_ && kept_.size() > 1) {
    bytes -= kept_.front().second.size() * sizeof(float);
    kept_.erase(kept_.begin());
  }
}

}  // namespace palpate::gui
