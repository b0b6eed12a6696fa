#pragma once

#include "palpate/simulation/parameters.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::simulation {

/// What a pass over the lattice does with the forces; see kernels/lattice.cl.
enum class Mode : std::uint32_t {
  from_source = 0,
  from_base = 1,
  finish_rk4 = 2,
  symplectic = 3,
  drift = 4,
  finish_verlet = 5
};

/// The states that passes read and write: y is the solver's, s2 to s4 stages of a step.
enum class Stored : std::uint32_t { y, s2, s3, s4 };

struct Pass {
  Mode mode;
  double h;   ///< of the step
  double at;  ///< when in the step its forces are
  Stored source, base, target;
};

/// The passes of one explicit step that starts from y; none for implicit Euler.
std::vector<Pass> passes_of(Integrator integrator);
/// Whether a step leaves the state in s2; the next one then goes back to y.
bool ends_beside(Integrator integrator) noexcept;
/// The step that goes back: y and s2 change places.
std::vector<Pass> back(std::vector<Pass> passes);

/// Passes over the slabs, each a slab behind the one before it, while the slab
/// is in the caches. One slab behind is enough: a pass needs of the one before
/// it the slab and the next one's first plane. So what waits there is not in the
/// way of another pass, and what an implicit iteration writes over is behind
/// all that the one before it still reads.
template <typename Launch>
void staggered(std::size_t passes, std::size_t slabs, const Launch& launch) {
  for (std::size_t turn = 0; turn + 1 < slabs + passes; ++turn)
    for (std::size_t n = 0; n < passes; ++n)
      if (turn >= n && turn - n < slabs) launch(n, turn - n);
}

}  // namespace palpate::simulation
