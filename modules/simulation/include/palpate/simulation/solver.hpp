#pragma once

#include "palpate/compute/buffer.hpp"
#include "palpate/model/tissue.hpp"
#include "palpate/simulation/parameters.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace palpate::simulation {

/// A copy of the state. Positions are relative to the tissue's centre_mm.
struct State {
  double time_s = 0.0;
  std::vector<Eigen::Vector3f> positions_mm;
  std::vector<Eigen::Vector3f> velocities_mm_per_s;
};

/// A selected point (thesis 3.4.1): its derivative is scaled by
/// (1 - selectance), and it follows the grab by selectance.
struct HeldPoint {
  std::uint32_t point = 0;
  float selectance = 1.0F;  ///< alpha in [0, 1]
};

struct Energy {
  double kinetic = 0.0;    ///< sum |v|^2 / 2, mm^2/s^2 (unit mass)
  double potential = 0.0;  ///< sum k (l - L0)^2 / 2 over undirected links, minus g.x
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();  ///< mm/s
};

/// What a run is watched by; computed on the device, cheap.
struct Health {
  bool finite = true;
  float max_displacement_mm = 0.0F;  ///< from rest
  float max_speed_mm_per_s = 0.0F;
};

/// Integrates one tissue. Owned by one thread.
class Solver {
 public:
  virtual ~Solver() = default;

  /// Queues `count` steps of step_s. While points are held and
  /// set_grab_velocity is not zero, each step ends with x += alpha u h and
  /// v = (1 - alpha) v + alpha u of every held point.
  virtual void step(int count, double step_s) = 0;
  /// Replaces the held points. With an empty list all are free again. The
  /// velocity of a point held with alpha is scaled by (1 - alpha) at once.
  /// A point listed twice counts with its last selectance. Throws
  /// Error(internal) for a point that is not there, Error(usage) for an alpha
  /// outside [0, 1].
  virtual void hold(const std::vector<HeldPoint>& held) = 0;
  /// u, LPS, for the steps to come; zero at rest. Coming to rest scales the
  /// velocity of each held point by (1 - alpha) once more, so that no stale
  /// grab velocity feeds the dampers.
  virtual void set_grab_velocity(const Eigen::Vector3d& mm_per_s) = 0;
  virtual void set_parameters(const Parameters& parameters) = 0;
  virtual const Parameters& parameters() const = 0;

  virtual State state() const = 0;           ///< waits for the queue
  virtual void set_state(const State&) = 0;  ///< sizes must agree; Error(internal)
  virtual void save_snapshot() = 0;          ///< kept beside the state, on the device
  virtual void restore_snapshot() = 0;       ///< of the last save, time included; Error(internal) without one
  virtual double time_s() const = 0;
  virtual Health health() = 0;  ///< waits for the queue
  /// Sums in double over state(); host-side.
  Energy energy() const;
  /// Diagonal of the box around the points at rest; what is far is measured by it.
  double extent_mm() const noexcept { return extent_mm_; }
  /// Mean rest length of the links; infinite without links.
  double link_length_mm() const noexcept { return link_length_mm_; }
  /// The device's positions, four floats a point (x, y, z, unused), for the
  /// surface; the same buffer as long as the solver lives, possibly a few
  /// points longer than the tissue. Null for the reference solver.
  virtual const compute::Buffer* positions_buffer() const = 0;
  virtual std::string device_name() const = 0;
  virtual std::string driver() const = 0;
  virtual std::string layout() const = 0;  ///< "explicit"
  virtual std::size_t bytes() const = 0;   ///< of device memory

 protected:
  explicit Solver(std::shared_ptr<const model::Tissue> tissue);
  const model::Tissue& tissue() const noexcept { return *tissue_; }

 private:
  std::shared_ptr<const model::Tissue> tissue_;
  double extent_mm_ = 0.0;
  double link_length_mm_ = std::numeric_limits<double>::infinity();
};

/// How the OpenCL solver runs; results differ in rounding only.
struct OpenclOptions {
  /// Points that a work-item takes as vector lanes: 1, 4, 8 or 16. 0: by the
  /// device's float_vector_width. Error(internal) for others.
  unsigned points_per_item = 0;
};
/// kernels/explicit_rk4.cl: separate arrays, explicit links stored column
/// by column, four fused stage kernels, no atomics. Compiles and warms its
/// kernels up, so that the first step is as fast as the next. Throws
/// Error(device), and Error(usage) as check() does.
std::unique_ptr<Solver> make_opencl_solver(const compute::Device& device,
                                           std::shared_ptr<const model::Tissue> tissue,
                                           const Parameters& parameters, const OpenclOptions& options = {});
/// The same model in Eigen and double precision: the independent check, and
/// what runs where there is no device.
std::unique_ptr<Solver> make_reference_solver(std::shared_ptr<const model::Tissue> tissue,
                                              const Parameters& parameters);

}  // namespace palpate::simulation
