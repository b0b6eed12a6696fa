#include "filter_history.hpp"

#include <utility>

namespace palpate::gui {
namespace {

std::size_t bytes_of(const std::vector<AppliedFilters>& states) {
  std::size_t bytes = 0;
  for (const auto& state : states) bytes += state.volume.size() * sizeof(float);
  return bytes;
}

AppliedFilters take_last(std::vector<AppliedFilters>& states) {
  AppliedFilters last = std::move(states.back());
  states.pop_back();
  return last;
}

}  // namespace

void FilterHistory::clear() {
  undo_.clear();
  redo_.clear();
}

void FilterHistory::put(AppliedFilters now) {
  redo_.clear();
  undo_.push_back(std::move(now));
  trim();
}

AppliedFilters FilterHistory::undo(AppliedFilters now) {
  AppliedFilters before = take_last(undo_);
  redo_.push_back(std::move(now));
  trim();
  return before;
}

AppliedFilters FilterHistory::redo(AppliedFilters now) {
  AppliedFilters after = take_last(redo_);
  undo_.push_back(std::move(now));
  return after;
}

std::size_t FilterHistory::held_bytes() const { return bytes_of(undo_) + bytes_of(redo_); }

// The last step back is kept whatever it takes: who applied the wrong filter
// gets back.
void FilterHistory::trim() {
  while (held_bytes() > budget_bytes_) {
    if (undo_.size() > 1) {
      undo_.erase(undo_.begin());
    } else if (redo_.size() > 1) {
      redo_.erase(redo_.begin());
    } else {
      return;
    }
  }
}

}  // namespace palpate::gui
