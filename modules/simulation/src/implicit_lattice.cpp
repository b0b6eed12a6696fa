#include "implicit_lattice.hpp"

#include "lattice_passes.hpp"

#include <algorithm>
#include <cstdint>
#include <string>

namespace palpate::simulation {

namespace {

constexpr std::uint32_t parts = 256;  // of the search for the largest bound
constexpr std::size_t together = 4;   // iterations that go through the slabs one behind the other

}  // namespace

std::string ImplicitLatticeStep::define_of(Pass pass) {
  return "IMPLICIT=" + std::to_string(pass == iterate_back ? 4 : static_cast<int>(pass) + 1);
}

ImplicitLatticeStep::ImplicitLatticeStep(compute::KernelLibrary& library, const Lattice& lattice,
                                         const Arguments& arguments, const ImplicitSpread& spread)
    : lattice_(lattice),
      arguments_(arguments),
      spread_(spread),
      partial_(compute::Buffer::allocate(library.device(), parts * sizeof(float))),
      largest_(compute::Buffer::allocate(library.device(), sizeof(float))) {
  const std::vector<std::string> defines{"LANES=" + std::to_string(lattice.lanes)};
  const auto build = [&](const char* name) {
    return library.build("implicit_lattice_points.cl", name, defines);
  };
  largest_of_parts_ = build("implicit_largest");
  largest_of_all_ = build("implicit_largest");
  largest_of_all_.set_all(partial_, largest_, parts, std::uint32_t{1}, std::uint32_t{1}, std::uint32_t{0},
                          std::uint32_t{1});
  advance_ = build("implicit_advance");
}

void ImplicitLatticeStep::begin_steps(const Parameters& parameters, const std::array<float, 4>& gravity,
                                      double step_s, const Kernels& passes, const compute::Buffer& state,
                                      const compute::Buffer& freedom, const compute::Buffer& loads,
                                      const std::array<const compute::Buffer*, 2>& corrections) {
  parameters_ = parameters;
  plan_ = implicit_plan(spread_, parameters, step_s);
  for (compute::Kernel* pass : passes) {
    pass->set(arguments_.h, static_cast<float>(step_s));
    pass->set(arguments_.stiffness, static_cast<float>(step_s * step_s * parameters.stiffness_per_s2));
    pass->set(arguments_.damping, static_cast<float>(step_s * parameters.damping_per_s));
    pass->set(arguments_.drag, static_cast<float>(step_s * parameters.drag_per_s));
  }
  passes[load]->set(arguments_.gravity, gravity);
  set_rest_scale(1.0, passes);
  const auto segments = static_cast<std::uint32_t>(lattice_.segments);
  const std::uint32_t lanes = lattice_.lanes;
  largest_of_parts_.set_all(loads, partial_, segments * lanes, lanes, 6 * lanes, 3 * lanes, parts);
  // The first iteration, the second of all, writes corrections[1].
  advance_.set_all(state, *corrections[(plan_.iterations.size() + 1) % 2], freedom, segments,
                   static_cast<float>(step_s));
}

void ImplicitLatticeStep::set_rest_scale(double scale, const Kernels& passes) const {
  for (compute::Kernel* pass : passes) {
    pass->set(arguments_.rest_scale, static_cast<float>(scale * lattice_.rest_quantum_mm));
    pass->set(arguments_.rest_offset, static_cast<float>(scale * lattice_.rest_offset_mm));
    pass->set(arguments_.length_scale, static_cast<float>(scale));
  }
}

std::array<float, 4> ImplicitLatticeStep::numbers_of(std::size_t n) const {
  const auto& [momentum, rate] = plan_.iterations[n];
  const auto first_rate = static_cast<float>(plan_.iterations[0].rate);
  // Until they are written once, the first correction is scaled as it is read.
  return {static_cast<float>(momentum), static_cast<float>(rate), n == 1 ? first_rate : 0.0F,
          n == 2 ? first_rate : 0.0F};
}

void ImplicitLatticeStep::run_step(double step_s, double time_s, const Kernels& passes, std::size_t slabs,
                                   const Run& run, const Iterate& iterate_all) {
  const double scale = rest_scale_at(parameters_, time_s + step_s);
  if (parameters_.beat_amplitude != 0.0) set_rest_scale(scale, passes);
  staggered(3, slabs, [&](std::size_t n, std::size_t slab) { run(static_cast<Pass>(load + n), slab); });
  largest_of_parts_.run(parts, 1);
  largest_of_all_.run(1, 1);
  const std::size_t count = plan_.iterations.size();
  if (iterate_all) {
    std::vector<std::array<float, 4>> numbers;
    for (std::size_t n = 1; n < count; ++n) numbers.push_back(numbers_of(n));
    iterate_all(numbers, scale);
  } else {
    for (std::size_t first = 1; first < count; first += together)
      staggered(std::min(together, count - first), slabs, [&](std::size_t n, std::size_t slab) {
        const Pass pass = (first + n) % 2 == 1 ? iterate : iterate_back;
        passes[pass]->set(arguments_.gravity, numbers_of(first + n));
        run(pass, slab);
      });
  }
  advance_.run(lattice_.segments);
}

}  // namespace palpate::simulation
