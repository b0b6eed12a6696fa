#include "palpate/simulation/parameters.hpp"

#include "palpate/core/error.hpp"

#include <array>
#include <cmath>
#include <sstream>

namespace palpate::simulation {

namespace {

void check_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;  // not so for NaN
  std::ostringstream text;
  text << name << " is " << value << ", and must lie between " << low << " and " << high << ".";
  core::throw_usage(text.str());
}

}  // namespace

namespace {
struct NamedIntegrator {
  Integrator integrator;
  const char* name;
};
constexpr std::array<NamedIntegrator, 6> names{{{Integrator::euler, "euler"},
                                                {Integrator::symplectic_euler, "symplectic-euler"},
                                                {Integrator::verlet, "verlet"},
                                                {Integrator::velocity_verlet, "velocity-verlet"},
                                                {Integrator::rk4, "rk4"},
                                                {Integrator::implicit_euler, "implicit-euler"}}};
}  // namespace

std::string to_string(Integrator integrator) { return names.at(static_cast<std::size_t>(integrator)).name; }

Integrator integrator_of(const std::string& name) {
  std::string accepted;
  for (const auto& entry : names) {
    if (name == entry.name) return entry.integrator;
    accepted += (accepted.empty() ? "" : ", ") + std::string(entry.name);
  }
  core::throw_usage("There is no integrator \"" + name + "\"; there are " + accepted + ".");
}

const std::vector<Integrator>& all_integrators() {
  static const std::vector<Integrator> all = [] {
    std::vector<Integrator> list;
    for (const auto& entry : names) list.push_back(entry.integrator);
    return list;
  }();
  return all;
}

void check(const Parameters& parameters) {
  check_range("The stiffness k (per s^2)", parameters.stiffness_per_s2, 0.0, 1e9);
  check_range("The damping c (per s)", parameters.damping_per_s, 0.0, 1e6);
  check_range("The drag D (per s)", parameters.drag_per_s, 0.0, 1e4);
  for (int axis = 0; axis < 3; ++axis)
    check_range("Gravity (mm/s^2)", parameters.gravity_mm_per_s2[axis], -1e6, 1e6);
  check_range("The mass", parameters.mass, 1e-3, 1e3);
  check_range("The period of the beat (s)", parameters.beat_period_s, 0.05, 60.0);
  check_range("The amplitude of the beat", parameters.beat_amplitude, 0.0, 0.5);
}

double rest_scale_at(const Parameters& parameters, double time_s) {
  if (parameters.beat_amplitude == 0.0) return 1.0;
  const double sine = std::sin(EIGEN_PI * time_s / parameters.beat_period_s);
  return 1.0 - parameters.beat_amplitude * sine * sine;
}

void check(const Material& material, std::size_t point_count) {
  const auto refuse = [](const std::string& text) {
    throw core::Error(core::ErrorKind::internal, "material", text);
  };
  if (!material.factors.empty() && material.factors.size() != point_count)
    refuse(std::to_string(material.factors.size()) + " factors do not fit a tissue of " +
           std::to_string(point_count) + " points.");
  for (const float factor : material.factors)
    if (!(factor > 0.0F) || !std::isfinite(factor)) refuse("A factor of the material is not above 0.");
  for (const std::uint32_t point : material.anchors)
    if (point >= point_count)
      refuse("Point " + std::to_string(point) + " is an anchor, and there are only " +
             std::to_string(point_count) + ".");
}

}  // namespace palpate::simulation
