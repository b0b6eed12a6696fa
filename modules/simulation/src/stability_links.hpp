#pragma once

#include "palpate/simulation/stability.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace palpate::simulation {

/// What the stability of a state is found from: links with their weights,
/// points with their masses and drags, in the units of the parameters.
class StabilityField {
 public:
  /// Throws Error(internal) where sizes do not fit. The arguments must outlive it.
  /// `sees_stretch`: a stretched link pulls across its direction too.
  StabilityField(const model::Tissue& tissue, const Parameters& parameters, const StabilityCase& at,
                 bool sees_stretch);

  struct Link {
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();
    double stiffness = 0.0;  ///< along; 0 for a link that does not act
    double damping = 0.0;
    double across = 0.0;  ///< stiffness across, of a stretched link
  };
  Link link(std::size_t index) const;
  const model::LinkGraph& links() const noexcept { return tissue_.links; }
  std::size_t points() const noexcept { return tissue_.points.size(); }
  double mass(std::size_t point) const;
  double drag(std::size_t point) const;  ///< per mass
  bool equal_masses() const noexcept { return !scales_mass_; }

 private:
  double factor(std::size_t point, bool scaled) const;

  const model::Tissue& tissue_;
  const Parameters& parameters_;
  const std::vector<Eigen::Vector3f>& positions_mm_;
  const std::vector<std::uint8_t>* alive_ = nullptr;
  const std::vector<float>* factors_ = nullptr;
  bool scales_stiffness_ = false, scales_damping_ = false, scales_drag_ = false, scales_mass_ = false;
  bool sees_stretch_ = true;
  double rest_scale_ = 1.0;  ///< at the shortest of the beat
};

/// Points in as many slices on every machine, so that sums do not depend on
/// the number of threads; the links of a slice are those whose first point it has.
class Slices {
 public:
  static constexpr std::size_t count = 8;
  Slices(const model::LinkGraph& links, std::size_t points);
  std::size_t begin(std::size_t slice) const { return points_[slice]; }
  std::size_t end(std::size_t slice) const { return points_[slice + 1]; }
  std::size_t links_begin(std::size_t slice) const { return links_[slice]; }
  std::size_t links_end(std::size_t slice) const { return links_[slice + 1]; }
  /// Calls work(slice) for every slice, on all cores where it is worth it.
  void run(const std::function<void(std::size_t)>& work) const;

 private:
  std::array<std::size_t, count + 1> points_{};
  std::array<std::size_t, count + 1> links_{};
};

/// The per-point bounds, and between what the damping of a mode lies.
struct PointBounds {
  double stiffness = 0.0;  ///< of omega^2: max (2/m) lambda_max(S)
  std::size_t stiffness_point = 0;
  double across = 0.0;   ///< the part of it that stretching makes
  double damping = 0.0;  ///< mu
  std::size_t damping_point = 0;
  double slope_low = 0.0, slope_high = 0.0;  ///< c/k of the links
  double drag_low = 0.0, drag_high = 0.0;    ///< of the points, per mass
  std::vector<float> by_point;               ///< about each point's own bound of omega^2
};
PointBounds point_bounds(const StabilityField& field, const Slices& slices);

}  // namespace palpate::simulation
