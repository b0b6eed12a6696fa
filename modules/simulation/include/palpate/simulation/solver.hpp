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

/// Masses are in units of the thesis' one, so that energies are in mm^2/s^2.
struct Energy {
  double kinetic = 0.0;    ///< sum m |v|^2 / 2
  double potential = 0.0;  ///< sum k (l - L0)^2 / 2 over living links at the present beat, minus m g.x
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();  ///< sum m v, mm/s
};

/// What a run is watched by; computed on the device, cheap.
struct Health {
  bool finite = true;
  float max_displacement_mm = 0.0F;  ///< from rest
  float max_speed_mm_per_s = 0.0F;
};

/// What the links say of a run; a pass over all of them on the device.
struct LinkHealth {
  double kinetic = 0.0;    ///< sum m |v|^2 / 2
  double potential = 0.0;  ///< sum k (l - L0)^2 / 2 over undirected links at the present beat, minus m g.x
  /// Largest |dl/dt| / L0 over links whose ends are both free (selectance 0, no anchor).
  float max_strain_rate_per_s = 0.0F;
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
  /// Any integrator may be chosen in mid-run; the state stays.
  virtual void set_parameters(const Parameters& parameters) = 0;
  /// Points that never move, whatever holds or pulls them; their velocity is
  /// zero from now on. Replaces the list; throws as check(Material) does.
  virtual void set_anchors(const std::vector<std::uint32_t>& points);
  /// Cuts links (indices into the tissue's LinkGraph) or brings them back. A
  /// dead link gives no force and no energy. Throws Error(internal) for a link
  /// that is not there.
  virtual void set_links_alive(const std::vector<std::uint32_t>& links, bool alive);
  const std::vector<std::uint8_t>& link_alive() const noexcept { return link_alive_; }
  const Material& material() const noexcept { return material_; }
  virtual const Parameters& parameters() const = 0;

  virtual State state() const = 0;           ///< waits for the queue
  virtual void set_state(const State&) = 0;  ///< sizes must agree; Error(internal)
  virtual void save_snapshot() = 0;          ///< kept beside the state, on the device
  virtual void restore_snapshot() = 0;       ///< of the last save, time included; Error(internal) without one
  virtual double time_s() const = 0;
  virtual Health health() = 0;  ///< waits for the queue
  /// Waits for the queue. The solver's own is a host-side sum in double over
  /// state(); the device's layouts do it in kernels.
  virtual LinkHealth link_health();
  /// Sums in double over state(), with the masses and stiffnesses of the
  /// material; host-side.
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
  virtual std::string layout() const = 0;                   ///< "lattice" or "explicit"
  virtual std::string layout_reason() const { return {}; }  ///< for people: why this layout
  virtual std::size_t bytes() const = 0;                    ///< of device memory
  /// What the passes of one step read and write, each array once a pass, wherever
  /// it is cached; 0 if unknown.
  virtual std::size_t bytes_per_step() const { return 0; }

 protected:
  explicit Solver(std::shared_ptr<const model::Tissue> tissue, Material material = {});
  const model::Tissue& tissue() const noexcept { return *tissue_; }
  /// Of every point, the factor of its derivative: 1 - selectance, 0 for an
  /// anchor. The solver's own knows of no held points.
  virtual std::vector<float> freedom() const;

 private:
  double rest_length(std::size_t link) const {
    return static_cast<double>(tissue_->links.rest_lengths_mm[link]);
  }
  /// use(link, first point, second point) for links that act.
  template <typename Use>
  void for_living_links(const Use& use) const {
    const model::LinkGraph& links = tissue_->links;
    for (std::size_t link = 0; link < links.size(); ++link)
      if (link_alive_[link] != 0 && links.rest_lengths_mm[link] != 0.0F)
        use(link, links.pairs[link][0], links.pairs[link][1]);
  }

  std::shared_ptr<const model::Tissue> tissue_;
  Material material_;
  std::vector<std::uint8_t> link_alive_;  ///< one a link
  double extent_mm_ = 0.0;
  double link_length_mm_ = std::numeric_limits<double>::infinity();
};

enum class LayoutChoice { automatic, lattice, explicit_links };
std::string to_string(LayoutChoice choice);  ///< "auto", "lattice", "explicit"
/// Throws Error(usage) naming what is accepted.
LayoutChoice layout_of(const std::string& name);

/// How the OpenCL solver runs; results differ in rounding only.
struct OpenclOptions {
  /// Points that a work-item takes as vector lanes: 1, 4, 8 or 16. 0: by the
  /// device's float_vector_width. Error(internal) for others.
  unsigned points_per_item = 0;
  /// `lattice` throws Error(usage) for a tissue whose points do not lie on one.
  LayoutChoice layout = LayoutChoice::automatic;
  /// Lattice: a launch for every stage and slab, as on a graphics card, also
  /// where the device is a processor.
  bool launches_every_stage = false;
};
/// A link with a rest length of zero does not act, in every layout: that is
/// how a cut link is stored.
///
/// Lattice (kernels/lattice.cl): segments of consecutive voxels of a row, a
/// stencil of neighbours with a rest length each, other links in an overflow
/// list. Explicit (kernels/explicit.cl): separate arrays, links stored in
/// columns, a block of points at a time. Neither adds
/// with atomics: every sum has one order. Compiles and
/// warms its kernels up, so that the first step is as fast as the next. Throws
/// Error(device), and Error(usage) as check() does.
std::unique_ptr<Solver> make_opencl_solver(const compute::Device& device,
                                           std::shared_ptr<const model::Tissue> tissue,
                                           const Parameters& parameters, const OpenclOptions& options = {},
                                           const Material& material = {});
/// The same model in Eigen and double precision: the independent check, and
/// what runs where there is no device.
std::unique_ptr<Solver> make_reference_solver(std::shared_ptr<const model::Tissue> tissue,
                                              const Parameters& parameters, const Material& material = {});

}  // namespace palpate::simulation
