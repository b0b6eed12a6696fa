#pragma once

#include "palpate/compute/device.hpp"
#include "palpate/model/tissue.hpp"
#include "palpate/simulation/parameters.hpp"
#include "palpate/simulation/solver.hpp"

#include <memory>

namespace palpate::simulation {

/// The thesis' own layout (3.2 and appendix A; kernels/published.cl): what the
/// bench compares with. RK4 alone, nothing held, no gravity, unit masses.
class PublishedSimulation {
 public:
  /// Throws Error(device), and Error(usage) as check() does or for parameters
  /// that the published kernels do not know.
  PublishedSimulation(const compute::Device& device, const model::Tissue& tissue,
                      const Parameters& parameters);
  ~PublishedSimulation();
  PublishedSimulation(PublishedSimulation&&) noexcept;
  PublishedSimulation& operator=(PublishedSimulation&&) noexcept;

  void step(int count, double step_s);  ///< queues; wait by Device::finish()
  State state() const;                  ///< waits for the queue; time_s counts steps
  void set_state(const State& state);   ///< Error(internal) where sizes differ
  std::size_t bytes() const;            ///< of device memory

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::simulation
