#include "explicit_solver.hpp"
#include "lattice_solver.hpp"
#include "tuning.hpp"

#include "palpate/simulation/solver.hpp"

#include <utility>

namespace palpate::simulation {

std::unique_ptr<Solver> make_opencl_solver(const compute::Device& device,
                                           std::shared_ptr<const model::Tissue> tissue,
                                           const Parameters& parameters, const OpenclOptions& options,
                                           const Material& material) {
  if (options.layout == LayoutChoice::lattice)
    return make_lattice_solver(device, std::move(tissue), parameters,
                               tuned(device, options, LayoutChoice::lattice), material,
                               "The lattice layout was asked for.");
  return make_explicit_solver(device, std::move(tissue), parameters,
                              tuned(device, options, LayoutChoice::explicit_links), material);
}

}  // namespace palpate::simulation
