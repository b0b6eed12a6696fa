#pragma once

#include "palpate/compute/device.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/evaluation/result.hpp"

#include <optional>
#include <string>
#include <vector>

namespace palpate::evaluation {

/// Where and how thoroughly.
struct Setup {
  std::optional<compute::Device> device;  ///< none: the CPU reference
  bool quick = false;                     ///< fewer and smaller cases
};

/// A figure of the thesis, measured again by this program's own solvers.
struct Experiment {
  std::string name;    ///< "stability-stiffness"
  std::string figure;  ///< "figure 12", as the thesis counts
  std::string text;
  bool uses_device = true;    ///< else it always runs on the CPU reference
  bool needs_device = false;  ///< it measures the device
};
/// In the thesis' order.
const std::vector<Experiment>& experiments();

/// Runs one. Error(usage) for an unknown name, naming all, and for one that
/// needs a device where there is none; Error(cancelled); Error(device).
Result run(const std::string& name, const Setup& setup, const core::Progress& progress = {});

}  // namespace palpate::evaluation
