#pragma once

#include "device_solver.hpp"
#include "lattice_layout.hpp"
#include "lattice_passes.hpp"

#include "palpate/compute/kernel_library.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace palpate::simulation {

/// Many steps over a lattice in one launch (kernels/lattice_march.cl), for a
/// processor's cores. Its arrays are the solver's.
class LatticeMarch {
 public:
  /// Passes that one launch takes at most: a stop is not asked for meanwhile.
  static constexpr int most_passes = 256;

  LatticeMarch(const compute::Device& device, const LatticeLayout& layout);
  /// Segments behind the last that work-items may write nonsense to.
  static std::uint32_t trash_segments(const compute::Device& device);
  std::size_t bytes() const noexcept;

  struct Arrays {
    std::array<const compute::Buffer*, 4> states{};  ///< y, s2, s3, s4; null where there is none
    const compute::Buffer* second = nullptr;         ///< of kernels/lattice.cl; null where no pass reads it
    const compute::Buffer* third = nullptr;
    const compute::Buffer* waiting = nullptr;
    const compute::Buffer* rest = nullptr;
    const compute::Buffer* rows = nullptr;
    const compute::Buffer* overflow_begins = nullptr;
    const compute::Buffer* overflow = nullptr;
    const compute::Buffer* factors = nullptr;
  };
  /// What the kernel takes of the parameters, in its units.
  struct Numbers {
    double stiffness = 0.0;
    double damping = 0.0;
    double drag = 0.0;
    double mass = 1.0;
  };
  /// Explicit steps to come. gravity in the lattice's frame. Throws Error(device).
  void use(compute::KernelLibrary& library, const std::vector<std::string>& defines, const Arrays& arrays,
           const Parameters& parameters, const Eigen::Vector3d& gravity_mm_per_s2);
  /// Passes to come that the caller lists. Throws Error(device).
  void use(compute::KernelLibrary& library, const std::vector<std::string>& defines, const Arrays& arrays,
           const Numbers& numbers);
  void set_freedom(const compute::Buffer& freedom, bool all_free);
  /// Whether a step can write over the state that it reads: of one pass, and
  /// with nobody who looks at a place again once its forces are whole.
  bool is_in_place(Integrator integrator) const noexcept;
  /// Steps of the scheme in use that one launch takes at most.
  int most_steps() const;
  /// Queues `count` steps, at most most_steps(); is_beside: the state is in s2.
  /// Returns whether it is there afterwards.
  bool run(int count, double step_s, double time_s, bool is_beside);

  /// A pass as the kernel reads it: its pass, and rest lengths and gravity as kernels/lattice.cl takes them.
  struct NumberedPass {
    Pass pass;
    float h = 0.0F;
    float rest_scale = 0.0F;
    float rest_offset = 0.0F;
    float length_scale = 1.0F;
    Float4 gravity{};
  };
  /// Queues `count` passes, which are those of the table again and again, from its `first` on.
  void run(const std::vector<NumberedPass>& table, std::size_t count, std::size_t first = 0);

 private:
  void write(const std::vector<NumberedPass>& table);

  const LatticeLayout& layout_;
  compute::Device device_;
  MarchSchedule schedule_;  ///< but for its lists, which are the device's
  std::uint32_t queues_ = 1;
  compute::Buffer entries_, chunks_, progress_, passes_;
  std::map<std::vector<std::string>, compute::Kernel> kernels_;  ///< by their defines
  compute::Kernel* kernel_ = nullptr;
  Parameters parameters_;
  Float4 gravity_{};
  std::vector<Float4> passes_written_;
};

}  // namespace palpate::simulation
