#pragma once

#include <Eigen/Core>

#include <string>

namespace palpate::simulation {

enum class Integrator { rk4 };
std::string to_string(Integrator integrator);

/// Per unit mass, every point has mass one (thesis 3.1 and 3.2).
struct Parameters {
  double stiffness_per_s2 = 10000.0;  ///< k: spring force per mm of extension, per unit mass
  double damping_per_s = 3.0;         ///< c: damper force along the link, per unit mass
  double drag_per_s = 0.1;            ///< D: -D v on every point
  /// Added to the acceleration; scaled by (1 - selectance) like all of it.
  Eigen::Vector3d gravity_mm_per_s2 = Eigen::Vector3d::Zero();
  Integrator integrator = Integrator::rk4;
};
/// Throws Error(usage) naming the parameter and its range: k in [0, 1e9],
/// c in [0, 1e6], D in [0, 1e4], each component of gravity in [-1e6, 1e6].
void check(const Parameters& parameters);

}  // namespace palpate::simulation
