#include "explicit_solver.hpp"
#include "lattice_layout.hpp"
#include "lattice_solver.hpp"
#include "tuning.hpp"

#include "palpate/simulation/solver.hpp"

#include <string>
#include <utility>

namespace palpate::simulation {

std::unique_ptr<Solver> make_opencl_solver(const compute::Device& device,
                                           std::shared_ptr<const model::Tissue> tissue,
                                           const Parameters& parameters, const OpenclOptions& options,
                                           const Material& material) {
  std::string reason = options.layout == LayoutChoice::automatic ? "" : "This layout was asked for.";
  bool on_lattice = options.layout == LayoutChoice::lattice;
  if (options.layout == LayoutChoice::automatic && tissue) {
    LayoutVerdict verdict = choose_layout(*tissue);
    // A lattice's work-items are long sweeps, one a core; a graphics card wants many short ones.
    const bool suits_device = device.info().type == compute::DeviceType::cpu;
    on_lattice = verdict.lattice && suits_device;
    reason = suits_device || !verdict.lattice ? std::move(verdict.reason)
                                              : "Explicit links suit a device with many small cores.";
  }
  if (on_lattice)
    return make_lattice_solver(device, std::move(tissue), parameters,
                               tuned(device, options, LayoutChoice::lattice), material, reason);
  return make_explicit_solver(device, std::move(tissue), parameters,
                              tuned(device, options, LayoutChoice::explicit_links), material, reason);
}

}  // namespace palpate::simulation
