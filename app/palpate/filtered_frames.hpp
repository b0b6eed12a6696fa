#pragma once

#include "palpate/core/volume.hpp"
#include "palpate/imaging/filters.hpp"

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace palpate::gui {

/// Frames that one chain of filters was applied to, as far as a budget allows;
/// the longest unused goes first.
class FilteredFrames {
 public:
  void set_budget(std::size_t bytes) { budget_bytes_ = bytes; }
  /// Nothing where it was another chain.
  std::optional<core::Volume> find(const std::vector<imaging::FilterStep>& chain, int frame);
  /// Of another chain than those before: they are dropped.
  void put(const std::vector<imaging::FilterStep>& chain, int frame, const core::Volume& volume);
  void clear() { kept_.clear(); }
  std::size_t size() const { return kept_.size(); }

 private:
  std::size_t budget_bytes_ = std::size_t{1} << 30;
  std::vector<imaging::FilterStep> chain_;
  std::vector<std::pair<int, core::Volume>> kept_;  ///< the last used at the end
};

}  // namespace palpate::gui
