#include "lattice_passes.hpp"

namespace palpate::simulation {

std::vector<Pass> passes_of(Integrator integrator) {
  using S = Stored;
  switch (integrator) {
    case Integrator::euler:
      return {{Mode::from_source, 1.0, 0.0, S::y, S::y, S::s2}};
    case Integrator::symplectic_euler:
    case Integrator::verlet:
      return {{Mode::symplectic, 1.0, 0.0, S::y, S::y, S::s2}};
    case Integrator::velocity_verlet:
      return {{Mode::drift, 1.0, 0.0, S::y, S::y, S::s2}, {Mode::finish_verlet, 0.5, 1.0, S::s2, S::y, S::y}};
    case Integrator::rk4:
      return {{Mode::from_source, 0.5, 0.0, S::y, S::y, S::s2},
              {Mode::from_base, 0.5, 0.5, S::s2, S::y, S::s3},
              {Mode::from_base, 1.0, 0.5, S::s3, S::y, S::s4},
              {Mode::finish_rk4, 1.0 / 6.0, 1.0, S::s4, S::y, S::y}};
    case Integrator::implicit_euler:
      break;
  }
  return {};
}

bool ends_beside(Integrator integrator) noexcept {
  return integrator == Integrator::euler || integrator == Integrator::symplectic_euler ||
         integrator == Integrator::verlet;
}

std::vector<Pass> back(std::vector<Pass> passes) {
  const auto turned = [](Stored state) {
    return state == Stored::y ? Stored::s2 : state == Stored::s2 ? Stored::y : state;
  };
  for (Pass& pass : passes) {
    pass.source = turned(pass.source);
    pass.base = turned(pass.base);
    pass.target = turned(pass.target);
  }
  return passes;
}

}  // namespace palpate::simulation
