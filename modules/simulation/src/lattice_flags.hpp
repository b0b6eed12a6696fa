#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate::simulation {

// What kernels/lattice.cl is told of a segment.
constexpr std::uint32_t own_row_flag = 1;                                ///< has links along its row
constexpr std::uint32_t row_flag(std::size_t row) { return 2U << row; }  ///< has links to a row beside it
constexpr std::uint32_t own_flag = 32;                                   ///< is stepped by this chunk
constexpr std::uint32_t writes_flag(std::size_t row) {
  return 64U << row;
}  ///< the row beside it is the chunk's
constexpr std::uint32_t overflow_flag = 1024;  ///< has links outside the stencil
constexpr std::uint32_t first_flag(std::size_t row) {
  return 2048U << row;
}  ///< of all that leave forces in the row beside it, this one is the first
constexpr std::uint32_t waits_flag = 32768;  ///< others left forces for it

}  // namespace palpate::simulation
