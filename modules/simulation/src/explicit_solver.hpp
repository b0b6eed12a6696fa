#pragma once

#include "palpate/compute/device.hpp"
#include "palpate/simulation/solver.hpp"

#include <memory>
#include <string>

namespace palpate::simulation {

/// Separate arrays and explicit links (kernels/explicit.cl): for any graph.
/// `reason` is what layout_reason() says.
std::unique_ptr<Solver> make_explicit_solver(const compute::Device& device,
                                             std::shared_ptr<const model::Tissue> tissue,
                                             const Parameters& parameters, const OpenclOptions& options,
                                             const Material& material, const std::string& reason = {});

}  // namespace palpate::simulation
