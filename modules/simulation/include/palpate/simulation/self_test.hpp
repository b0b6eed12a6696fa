#pragma once

#include "palpate/compute/device.hpp"
#include "palpate/core/progress.hpp"

#include <cstddef>
#include <string>
#include <vector>

namespace palpate::simulation {

/// One layout of a device against the CPU reference.
struct SelfTestCase {
  std::string layout;      ///< "lattice", "explicit"
  std::string integrator;  ///< "rk4"
  std::size_t points = 0;
  std::size_t links = 0;  ///< undirected
  int steps = 0;          ///< that were compared
  double step_s = 0.0;
  double motion_mm = 0.0;          ///< the farthest that a point of the reference went
  double max_difference_mm = 0.0;  ///< between the two; infinite for what is not finite
  double tolerance_mm = 0.0;
  double ms_per_step = 0.0;             ///< best of several batches
  double link_evaluations_per_s = 0.0;  ///< both directions of a link counted, four stages a step
  bool passed = false;
  std::string failure;  ///< for people; empty where it passed
};

struct SelfTest {
  std::vector<SelfTestCase> cases;
  bool passed() const;
};

/// A jittered cube of side^3 points, mutual 12 nearest links, stretched,
/// sheared and set moving: ten RK4 steps in each layout against the reference
/// in double precision, then timed. Never throws for what the device does:
/// that is the case's failure. Throws Error(cancelled).
///
/// The tolerance: a position of up to 25 mm in float32 is rounded by 1e-6 mm,
/// and a link's extension with it, which k = 10 000 /s^2 over 12 links, four
/// stages and ten steps of 0.004 s turns into at most 5e-5 mm; ten times that
/// leaves room for a driver's own square root, and is under a thousandth of the
/// motion that is compared.
SelfTest self_test(const compute::Device& device, int side = 27, const core::Progress& progress = {});

}  // namespace palpate::simulation
