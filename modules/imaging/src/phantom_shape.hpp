#pragma once

#include "palpate/core/mesh.hpp"

#include <Eigen/Core>

namespace palpate::imaging {

/// The phantom heart's form at one moment of the beat, in mm. Coordinates of
/// the probe: origin at the apex of the outer wall, depth along +y (away from
/// the probe), x to the patient's left, z to the head.
///
/// At rest (end diastole) outer and inner wall are prolate spheroids cut off
/// at the valve plane. Contraction c in [0, 1] shortens y by 14 %, leaves 42 %
/// of the cavity's volume, and thickens the wall so that at every depth the
/// tissue's volume is kept: r_o'^2 - r_i'^2 = (r_o^2 - r_i^2) / shortening.
/// Only + - * / and sqrt are used: the same bits on every machine.
class HeartShape {
 public:
  explicit HeartShape(double contraction);

  static constexpr double length_mm = 92.0;        ///< apex to valve plane, end diastole
  static constexpr double outer_radius_mm = 33.0;  ///< short semi-axis
  static constexpr double inner_radius_mm = 23.5;
  static constexpr double outer_half_mm = 68.0;    ///< long semi-axes
  static constexpr double inner_half_mm = 60.0;    ///< 8 mm of wall at the apex
  static constexpr double papillary_depth = 0.28;  ///< largest share of the inner radius taken

  double base_mm() const noexcept { return length_mm * shortening_; }
  double shortening() const noexcept { return shortening_; }
  /// Squared radius of the outer wall at depth y; negative above the apex.
  double outer_radius_squared(double y) const noexcept;
  /// Squared radius of the inner wall at depth y towards (x, z), papillary
  /// muscles included; negative above the cavity's end.
  double inner_radius_squared(double y, double x, double z) const noexcept;

  /// Signed distances to first order (negative inside).
  struct Distances {
    double outer, inner, base;
    double wall;  ///< to the muscle
  };
  Distances distances(const Eigen::Vector3d& point) const noexcept;
  /// Depth of the closed valve's middle at the given distance from the axis.
  double valve_depth_mm(double radius_squared, double opening) const noexcept;
  /// Where the tissue at `point` was at end diastole.
  Eigen::Vector3d rest_place(const Eigen::Vector3d& point) const noexcept;
  /// The wall's surface, closed by a ring in the valve plane, wound outwards.
  core::TriangleMesh wall_surface(int rings, int sectors) const;

 private:
  double smooth_inner_squared(double y) const noexcept;
  double shortening_;
  double inner_scale_squared_;
};

/// Contraction, 0 to 1, and opening of the mitral valve at a phase in [0, 1).
double contraction_at(double phase);
double valve_opening_at(double phase);

/// 3 t^2 - 2 t^3 between the edges.
double smooth_step(double from, double to, double value);

}  // namespace palpate::imaging
