#pragma once

#include "lattice.hpp"

#include <array>
#include <vector>

namespace palpate::model {

/// Neighbouring sites along i that all hold a point.
struct Run {
  int begin = 0;
  int end = 0;
  int b = 0;
  int c = 0;
  std::uint32_t component = 0;  ///< a run of the same component
};

/// Which sites count as touching.
struct Touch {
  int across = 3;                               ///< axes at once: 1, 2 or 3 for 6, 18 or 26 neighbours
  std::array<bool, 3> along{true, true, true};  ///< whether points touch across this axis at all
};

struct RunComponents {
  std::vector<Run> runs;
  std::vector<std::size_t> points;  ///< of the component, at the index Run::component; 0 elsewhere
};

/// The connected components of the lattice, a run at a time.
RunComponents components_of_runs(const Occupancy& occupancy, const Touch& touch,
                                 const core::CancelToken& cancel);

}  // namespace palpate::model
