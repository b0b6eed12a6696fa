#pragma once

#include "palpate/simulation/solver.hpp"

#include <cstddef>
#include <deque>
#include <optional>

namespace palpate::session {

/// States to go back to, newest last, capped by bytes: the oldest go first.
class History {
 public:
  explicit History(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  /// A new change: `before` is what undo gives. What was undone is forgotten.
  void push(simulation::State before);
  bool can_undo() const noexcept { return !undo_.empty(); }
  bool can_redo() const noexcept { return !redo_.empty(); }
  /// The state to restore; `now` is kept for redo.
  std::optional<simulation::State> undo(simulation::State now);
  std::optional<simulation::State> redo(simulation::State now);
  std::size_t bytes() const noexcept;

 private:
  void trim();

  std::size_t most_bytes_;
  std::deque<simulation::State> undo_;
  std::deque<simulation::State> redo_;
};

}  // namespace palpate::session
