#include "history.hpp"

#include <gtest/gtest.h>

using palpate::session::History;
using palpate::simulation::State;

namespace {

State state_at(double time_s, std::size_t points = 1) {
  State state;
  state.time_s = time_s;
  state.positions_mm.resize(points);
  state.velocities_mm_per_s.resize(points);
  return state;
}

}  // namespace

TEST(History, UndoAndRedoWalkTheSameStates) {
  History history(1 << 20);
  EXPECT_FALSE(history.can_undo());
  EXPECT_FALSE(history.undo(state_at(0)).has_value());
  history.push(state_at(1));
  history.push(state_at(2));
  EXPECT_EQ(history.undo(state_at(3))->time_s, 2);
  EXPECT_EQ(history.undo(state_at(2))->time_s, 1);
  EXPECT_FALSE(history.can_undo());
  EXPECT_EQ(history.redo(state_at(1))->time_s, 2);
  EXPECT_EQ(history.redo(state_at(2))->time_s, 3);
  EXPECT_FALSE(history.can_redo());
}

TEST(History, ANewChangeForgetsWhatWasUndone) {
  History history(1 << 20);
  history.push(state_at(1));
  history.undo(state_at(2));
  EXPECT_TRUE(history.can_redo());
  history.push(state_at(1));
  EXPECT_FALSE(history.can_redo());
}

TEST(History, TheOldestGoWhenTheBytesAreSpent) {
  constexpr std::size_t points = 1000;  // 24 bytes each, and the header
  History history(100000);
  for (int n = 0; n < 10; ++n) history.push(state_at(n, points));
  EXPECT_LE(history.bytes(), 100000U);
  int kept = 0;
  double oldest = -1;
  while (auto state = history.undo(state_at(99, points))) {
    oldest = state->time_s;
    ++kept;
  }
  EXPECT_EQ(kept, 4);
  EXPECT_EQ(oldest, 6);
}
