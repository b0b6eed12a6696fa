#pragma once

#include "palpate/simulation/solver.hpp"

#include <cstddef>
#include <vector>

namespace palpate::simulation {

/// The list in point order, each point once with its last selectance.
/// Throws as Solver::hold says.
std::vector<HeldPoint> checked(std::vector<HeldPoint> held, std::size_t point_count);

/// Throws Error(internal) unless both arrays have a value for every point.
void check_size(const State& state, std::size_t point_count);

}  // namespace palpate::simulation
