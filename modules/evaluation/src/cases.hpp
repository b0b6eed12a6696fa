#pragma once

#include "palpate/evaluation/experiment.hpp"

// The experiments themselves, a function each.
namespace palpate::evaluation {

Result integrator_euler(const Setup& setup, const core::Progress& progress);
Result integrator_verlet(const Setup& setup, const core::Progress& progress);
Result integrator_rk4(const Setup& setup, const core::Progress& progress);
Result time_by_points(const Setup& setup, const core::Progress& progress);
Result time_by_links(const Setup& setup, const core::Progress& progress);
Result noise(const Setup& setup, const core::Progress& progress);
Result stiffness(const Setup& setup, const core::Progress& progress);
Result recovery_links(const Setup& setup, const core::Progress& progress);
Result recovery_noise(const Setup& setup, const core::Progress& progress);
Result stability_stiffness(const Setup& setup, const core::Progress& progress);
Result stability_links(const Setup& setup, const core::Progress& progress);

}  // namespace palpate::evaluation
