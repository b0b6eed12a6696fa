#pragma once

namespace palpate::cli {

/// Beyond this two processors do not share a cache, in nanoseconds.
constexpr double far_apart_ns = 150.0;

/// How long a number takes from one processor to another and back, of the first
/// two that this process may run on, in nanoseconds. On a virtual machine it
/// changes while a program runs, as the host moves its processors about. 0 where
/// there is only one, where threads cannot be bound, or where the machine is too busy to tell.
double core_round_trip_ns();

}  // namespace palpate::cli
