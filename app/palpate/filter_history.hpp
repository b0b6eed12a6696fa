#pragma once

#include "palpate/core/volume.hpp"
#include "palpate/imaging/filters.hpp"
#include "palpate/imaging/speckle.hpp"

#include <cstddef>
#include <optional>
#include <vector>

namespace palpate::gui {

/// Speckle in the scan and in what the filters made of it, at the same places.
struct SpeckleChange {
  imaging::SpeckleStatistics before, after;
};

/// A chain of filters that was applied, with what came out.
struct AppliedFilters {
  std::vector<imaging::FilterStep> chain;
  int frame = 0;
  core::Volume volume;  ///< empty where the chain is
  std::optional<SpeckleChange> speckle;
};

/// What was applied before and what was undone, volumes and all, so that
/// neither is computed again; the oldest go where a budget ends.
class FilterHistory {
 public:
  void set_budget(std::size_t bytes) { budget_bytes_ = bytes; }
  void clear();
  /// Before another chain takes the place of `now`.
  void put(AppliedFilters now);
  bool can_undo() const { return !undo_.empty(); }
  bool can_redo() const { return !redo_.empty(); }
  /// What was there before; `now` can then be redone. Only where can_undo().
  AppliedFilters undo(AppliedFilters now);
  AppliedFilters redo(AppliedFilters now);
  std::size_t held_bytes() const;

 private:
  void trim();

  std::size_t budget_bytes_ = std::size_t{1} << 30;
  std::vector<AppliedFilters> undo_;  ///< the newest at the end
  std::vector<AppliedFilters> redo_;  ///< the next at the end
};

}  // namespace palpate::gui
