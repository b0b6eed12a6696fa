#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::simulation {

/// How time is stepped (docs/physics.md, "Integrators"), in every layout and
/// the reference alike: with h the step, f = 1 - selectance (0 for an anchor)
/// and a(x, v, t) the acceleration by links, drag and gravity.
enum class Integrator {
  /// x+ = x + h f v, v+ = v + h f a(x, v, t)
  euler,
  /// v+ = v + h f a(x, v, t), x+ = x + h f v+
  symplectic_euler,
  /// The papers' position form x+ = 2x - x- + h^2 a(x, v, t) with the velocity
  /// by differences, v = (x - x-)/h, which dampers see and State holds. The
  /// same sequence as symplectic Euler, but for rounding; a state that is set
  /// starts from x- = x - h v.
  verlet,
  /// Carries velocity, so that damping is of second order too: with
  /// a0 = a(x, v, t): x+ = x + h f (v + h/2 f a0),
  /// v+ = v + h/2 f (a0 + a(x+, v + h f a0, t + h)). Two evaluations a step.
  velocity_verlet,
  rk4,
  implicit_euler  ///< stable at any step, for stiff tissue
};
std::string to_string(Integrator integrator);  ///< "symplectic-euler" and so on, as --integrator has them
/// Throws Error(usage) naming what is accepted.
Integrator integrator_of(const std::string& name);
const std::vector<Integrator>& all_integrators();

/// Per unit mass (thesis 3.1 and 3.2).
struct Parameters {
  double stiffness_per_s2 = 10000.0;  ///< k: spring force per mm of extension, per unit mass
  double damping_per_s = 3.0;         ///< c: damper force along the link, per unit mass
  double drag_per_s = 0.1;            ///< D: -D v on every point
  /// Added to the acceleration; scaled by (1 - selectance) like all of it.
  Eigen::Vector3d gravity_mm_per_s2 = Eigen::Vector3d::Zero();
  Integrator integrator = Integrator::rk4;
  /// Of every point, in units of the thesis' one: a = (links + drag)/mass + g.
  double mass = 1.0;
  /// Beating: every rest length is L0 rest_scale_at(t). Off where the amplitude is 0.
  double beat_period_s = 1.0;
  double beat_amplitude = 0.0;  ///< the largest shortening, as a part of L0
};
/// Throws Error(usage) naming the parameter and its range: k in [0, 1e9],
/// c in [0, 1e6], D in [0, 1e4], each component of gravity in [-1e6, 1e6],
/// mass in [1e-3, 1e3], the period in [0.05, 60], the amplitude in [0, 0.5].
void check(const Parameters& parameters);

/// 1 - A sin^2(pi t / T): at rest at t = 0, shortest in the middle of a beat.
double rest_scale_at(const Parameters& parameters, double time_s);

/// What is not alike at every point. A link's stiffness and damping are scaled
/// by the mean of its ends' factors; a point's drag and mass by its own.
struct Material {
  std::vector<float> factors;  ///< > 0, one a point; empty: 1 everywhere
  bool scales_stiffness = false;
  bool scales_damping = false;
  bool scales_drag = false;
  bool scales_mass = false;
  std::vector<std::uint32_t> anchors;  ///< points that never move

  bool is_scaled() const noexcept {
    return !factors.empty() && (scales_stiffness || scales_damping || scales_drag || scales_mass);
  }
};
/// Throws Error(internal) where sizes or point numbers do not fit, or a factor is not above 0.
void check(const Material& material, std::size_t point_count);

}  // namespace palpate::simulation
