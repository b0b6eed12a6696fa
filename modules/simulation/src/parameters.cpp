#include "palpate/simulation/parameters.hpp"

#include "palpate/core/error.hpp"

#include <sstream>

namespace palpate::simulation {

namespace {

void check_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;  // not so for NaN
  std::ostringstream text;
  text << name << " is " << value << ", and must lie between " << low << " and " << high << ".";
  core::throw_usage(text.str());
}

}  // namespace

std::string to_string(Integrator integrator) {
  switch (integrator) {
    case Integrator::rk4:
      return "rk4";
  }
  return "rk4";
}

void check(const Parameters& parameters) {
  check_range("The stiffness k (per s^2)", parameters.stiffness_per_s2, 0.0, 1e9);
  check_range("The damping c (per s)", parameters.damping_per_s, 0.0, 1e6);
  check_range("The drag D (per s)", parameters.drag_per_s, 0.0, 1e4);
  for (int axis = 0; axis < 3; ++axis)
    check_range("Gravity (mm/s^2)", parameters.gravity_mm_per_s2[axis], -1e6, 1e6);
}

}  // namespace palpate::simulation
