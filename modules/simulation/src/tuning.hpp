#pragma once

#include "palpate/compute/device.hpp"
#include "palpate/simulation/solver.hpp"

#include <functional>
#include <memory>
#include <string>

namespace palpate::simulation {

/// The options, with the points that a work-item takes where they leave that
/// open. Measured the first time on a small model, remembered by device, driver
/// and kernels (compute::TuningStore), and then the same for ever. Left open,
/// for the layout's own rule, where nothing can be remembered, PALPATE_TUNING
/// is "off", or no trial runs. `layout`: lattice or explicit_links.
OpenclOptions tuned(const compute::Device& device, const OpenclOptions& options, LayoutChoice layout);

/// How a solver of `tissue` is made for a trial of a width.
using MakeTrial = std::function<std::unique_ptr<Solver>(std::shared_ptr<const model::Tissue> tissue,
                                                        unsigned points_per_item)>;
/// The same, from trials that the caller makes; `key` names what is chosen.
/// 0 where it stays open.
unsigned tuned_points_per_item(const compute::Device& device, const std::string& key, const MakeTrial& make);

}  // namespace palpate::simulation
