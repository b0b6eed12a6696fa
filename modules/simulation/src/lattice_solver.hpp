#pragma once

#include "palpate/compute/device.hpp"
#include "palpate/simulation/solver.hpp"

#include <memory>
#include <string>

namespace palpate::simulation {

/// Segments of a lattice's rows (kernels/lattice.cl, lattice_layout.hpp).
/// `reason` is what layout_reason() says. Throws Error(usage) for a tissue
/// that does not lie on a lattice.
std::unique_ptr<Solver> make_lattice_solver(const compute::Device& device,
                                            std::shared_ptr<const model::Tissue> tissue,
                                            const Parameters& parameters, const OpenclOptions& options,
                                            const Material& material, const std::string& reason = {});

}  // namespace palpate::simulation
