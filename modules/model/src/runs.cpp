#include "runs.hpp"

#include "union_find.hpp"

namespace palpate::model {
namespace {

/// Joins the touching runs of two rows, given as ranges into `runs`.
void join_rows(const std::vector<Run>& runs, std::array<std::size_t, 2> one, std::array<std::size_t, 2> other,
               int reach, UnionFind& sets) {
  while (one[0] < one[1] && other[0] < other[1]) {
    const Run& a = runs[one[0]];
    const Run& b = runs[other[0]];
    if (a.begin < b.end + reach && b.begin < a.end + reach)
      sets.join(static_cast<std::uint32_t>(one[0]), static_cast<std::uint32_t>(other[0]));
    ++(a.end < b.end ? one[0] : other[0]);
  }
}

}  // namespace

RunComponents components_of_runs(const Occupancy& occupancy, const Touch& touch,
                                 const core::CancelToken& cancel) {
  RunComponents result;
  std::vector<Run>& runs = result.runs;
  const int rows = occupancy.size()[1];
  const int slices = occupancy.size()[2];
  std::vector<std::size_t> first{0};
  for (int c = 0; c < slices; ++c) {
    cancel.check();
    for (int b = 0; b < rows; ++b) {
      const std::size_t start = runs.size();
      occupancy.for_row(b, c, [&](const Cell& site, std::uint32_t) {
        if (touch.along[0] && runs.size() > start && runs.back().end == site[0])
          ++runs.back().end;
        else
          runs.push_back({site[0], site[0] + 1, b, c, 0});
      });
      first.push_back(runs.size());
    }
  }

  UnionFind sets(runs.size());
  // Rows beside each other touch along one axis already, those over a corner along two.
  const int beside = touch.across > 1 && touch.along[0] ? 1 : 0;
  const int over_corner = touch.across > 2 && touch.along[0] ? 1 : 0;
  const auto row = [&](int b, int c) {
    const auto n = static_cast<std::size_t>(c) * static_cast<std::size_t>(rows) + static_cast<std::size_t>(b);
    return std::array<std::size_t, 2>{first[n], first[n + 1]};
  };
  for (int c = 0; c < slices; ++c) {
    cancel.check();
    for (int b = 0; b < rows; ++b) {
      if (touch.along[1] && b > 0) join_rows(runs, row(b, c), row(b - 1, c), beside, sets);
      if (!touch.along[2] || c == 0) continue;
      join_rows(runs, row(b, c), row(b, c - 1), beside, sets);
      if (touch.across < 2 || !touch.along[1]) continue;
      if (b > 0) join_rows(runs, row(b, c), row(b - 1, c - 1), over_corner, sets);
      if (b + 1 < rows) join_rows(runs, row(b, c), row(b + 1, c - 1), over_corner, sets);
    }
  }
  result.points.assign(runs.size(), 0);
  for (std::uint32_t n = 0; n < runs.size(); ++n) {
    runs[n].component = sets.root(n);
    result.points[runs[n].component] += static_cast<std::size_t>(runs[n].end - runs[n].begin);
  }
  return result;
}

}  // namespace palpate::model
