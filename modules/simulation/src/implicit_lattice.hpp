#pragma once

#include "implicit_plan.hpp"

#include "palpate/compute/kernel_library.hpp"

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

namespace palpate::simulation {

/// The implicit step on the lattice's arrays: passes of lattice.cl's sweep, as
/// kernels/implicit_lattice.cl makes them, and what is done between them. The
/// sweeps are the layout's to make and to launch.
class ImplicitLatticeStep {
 public:
  /// In the order of a step. The last two go from one array of corrections to the other, and back.
  enum Pass : std::size_t { load, diagonal, bound, iterate, iterate_back, pass_count };
  /// The define that makes a sweep the pass.
  static std::string define_of(Pass pass);
  /// The sweep's arguments that a pass sets, by their place.
  struct Arguments {
    unsigned h, stiffness, rest_scale, rest_offset, damping, length_scale, drag, gravity;
  };
  struct Lattice {
    unsigned lanes = 16;
    std::size_t segments = 0;  ///< with the two that are not there
    double rest_quantum_mm = 0.0;
    double rest_offset_mm = 0.0;
  };
  using Kernels = std::vector<compute::Kernel*>;       ///< of the passes
  using Run = std::function<void(Pass, std::size_t)>;  ///< launches a slab of a pass
  /// All iterations of a step, as the passes' gravity argument has them; odd ones
  /// are `iterate`, beginning with that, even ones `iterate_back`. Empty: run() takes them.
  using Iterate = std::function<void(const std::vector<std::array<float, 4>>&, double rest_scale)>;

  ImplicitLatticeStep(compute::KernelLibrary& library, const Lattice& lattice, const Arguments& arguments,
                      const ImplicitSpread& spread);
  const compute::Buffer& largest() const noexcept { return largest_; }
  std::size_t bytes() const noexcept { return partial_.bytes() + largest_.bytes(); }

  /// gravity in the lattice's frame. loads: the array that the passes call
  /// second; corrections: those that `iterate` reads and writes.
  void begin_steps(const Parameters& parameters, const std::array<float, 4>& gravity, double step_s,
                   const Kernels& passes, const compute::Buffer& state, const compute::Buffer& freedom,
                   const compute::Buffer& loads, const std::array<const compute::Buffer*, 2>& corrections);
  void run_step(double step_s, double time_s, const Kernels& passes, std::size_t slabs, const Run& run,
                const Iterate& iterate = {});

 private:
  std::array<float, 4> numbers_of(std::size_t iteration) const;
  void set_rest_scale(double scale, const Kernels& passes) const;

  Lattice lattice_;
  Arguments arguments_;
  ImplicitSpread spread_;
  Parameters parameters_;
  ImplicitPlan plan_;
  compute::Buffer partial_;
  compute::Buffer largest_;
  compute::Kernel largest_of_parts_;
  compute::Kernel largest_of_all_;
  compute::Kernel advance_;
};

}  // namespace palpate::simulation
