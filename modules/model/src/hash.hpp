#pragma once

#include <cstdint>

namespace palpate::model {

/// The finalizer of a 64-bit hash: every input bit flips half of the output's.
inline std::uint64_t mixed(std::uint64_t x) noexcept {
  x ^= x >> 30U;
  x *= 0xBF58476D1CE4E5B9ULL;
  x ^= x >> 27U;
  x *= 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}
inline constexpr std::uint64_t golden = 0x9E3779B97F4A7C15ULL;

}  // namespace palpate::model
