#include "history.hpp"

#include <utility>

namespace palpate::session {
namespace {

std::size_t bytes_of(const simulation::State& state) {
  return sizeof(state) +
         (state.positions_mm.size() + state.velocities_mm_per_s.size()) * sizeof(Eigen::Vector3f);
}

std::optional<simulation::State> exchange(std::deque<simulation::State>& from,
                                          std::deque<simulation::State>& to, simulation::State now) {
  if (from.empty()) return std::nullopt;
  std::optional<simulation::State> restored = std::move(from.back());
  from.pop_back();
  to.push_back(std::move(now));
  return restored;
}

}  // namespace

void History::push(simulation::State before) {
  redo_.clear();
  undo_.push_back(std::move(before));
  trim();
}

std::optional<simulation::State> History::undo(simulation::State now) {
  return exchange(undo_, redo_, std::move(now));
}

std::optional<simulation::State> History::redo(simulation::State now) {
  return exchange(redo_, undo_, std::move(now));
}

std::size_t History::bytes() const noexcept {
  std::size_t sum = 0;
  for (const auto& state : undo_) sum += bytes_of(state);
  for (const auto& state : redo_) sum += bytes_of(state);
  return sum;
}

void History::trim() {
  while (!undo_.empty() && bytes() > most_bytes_) undo_.pop_front();
}

}  // namespace palpate::session
