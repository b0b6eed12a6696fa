#pragma once

#include "explicit_arrays.hpp"
#include "implicit_plan.hpp"

#include "palpate/compute/kernel_library.hpp"
#include "palpate/simulation/parameters.hpp"

#include <string>
#include <vector>

namespace palpate::simulation {

/// The implicit step on the explicit layout's arrays (kernels/implicit_explicit.cl).
/// Uses the arrays of the stages; the state stays in y.
class ImplicitExplicitStep {
 public:
  /// `arrays` outlives it. defines: those of the layout's own kernels.
  ImplicitExplicitStep(compute::KernelLibrary& library, ExplicitArrays& arrays,
                       const std::vector<std::string>& defines, const ImplicitSpread& spread);
  void use(const Parameters& parameters) { parameters_ = parameters; }
  void begin_steps(double step_s);
  void run_step(double step_s, double time_s);
  std::size_t bytes() const noexcept { return partial_.bytes() + largest_.bytes(); }

 private:
  ExplicitArrays& arrays_;
  ImplicitSpread spread_;
  Parameters parameters_;
  ImplicitPlan plan_;
  compute::Buffer partial_;
  compute::Buffer largest_;
  compute::Kernel load_;
  compute::Kernel largest_of_parts_;
  compute::Kernel largest_of_all_;
  compute::Kernel advance_;
  compute::Kernel iterate_[2];  ///< from one array of corrections to the other, and back
};

}  // namespace palpate::simulation
