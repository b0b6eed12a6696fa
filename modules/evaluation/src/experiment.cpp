#include "palpate/evaluation/experiment.hpp"

#include "cases.hpp"

#include "palpate/core/error.hpp"

#include <array>

namespace palpate::evaluation {
namespace {

using Run = Result (*)(const Setup&, const core::Progress&);

struct Entry {
  Experiment experiment;
  Run run;
};

const std::vector<Entry>& entries() {
  static const std::vector<Entry> all{
      {{"integrator-euler", "figure 1", "Euler's method on one damped spring, and its order", false, false},
       integrator_euler},
      {{"integrator-verlet", "figure 2", "Verlet's method on the same spring, in two forms", false, false},
       integrator_verlet},
      {{"integrator-rk4", "figure 3", "the fourth-order Runge-Kutta method on the same spring", false, false},
       integrator_rk4},
      {{"recovery-links", "section 3.1", "what is left of a deformation after release, against links", true,
        false},
       recovery_links},
      {{"recovery-noise", "section 3.1", "the same against the noise of the points", true, false},
       recovery_noise},
      {{"time-by-points", "figure 7", "time of 1000 steps against points, for several numbers of links", true,
        true},
       time_by_points},
      {{"time-by-links", "figure 8", "time of 1000 steps against links", true, true}, time_by_links},
      {{"noise", "figure 10", "deflection under a fixed force against noise", true, false}, noise},
      {{"stiffness", "figure 11", "deflection under a fixed force against stiffness", true, false},
       stiffness},
      {{"stability-stiffness", "figure 12", "the stiffness at which a run explodes, against the step", true,
        false},
       stability_stiffness},
      {{"stability-links", "figure 13", "the number of links at which a run explodes, against the step", true,
        false},
       stability_links},
  };
  return all;
}

}  // namespace

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all = [] {
    std::vector<Experiment> list;
    for (const auto& entry : entries()) list.push_back(entry.experiment);
    return list;
  }();
  return all;
}

Result run(const std::string& name, const Setup& setup, const core::Progress& progress) {
  std::string names;
  for (const auto& [experiment, function] : entries()) {
    if (experiment.name == name) {
      if (experiment.needs_device && !setup.device)
        core::throw_usage("The experiment " + name +
                          " measures an OpenCL device and cannot run on the reference. Choose a device.");
      progress.report(0.0, name);
      return function(setup, progress);
    }
    names += (names.empty() ? "" : ", ") + experiment.name;
  }
  core::throw_usage("There is no experiment \"" + name + "\"; there are " + names + ".");
}

}  // namespace palpate::evaluation
