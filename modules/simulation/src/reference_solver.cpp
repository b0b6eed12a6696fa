// The model once more, in double precision and as plainly as the thesis says
// it: what the OpenCL kernels are measured against. No code is shared with them.
#include "held.hpp"
#include "implicit_reference.hpp"

#include "palpate/core/error.hpp"
#include "palpate/simulation/solver.hpp"

#include <cmath>
#include <optional>
#include <vector>

namespace palpate::simulation {

namespace {

using Vectors = std::vector<Eigen::Vector3d>;

/// Positions and velocities, or their derivatives.
struct Phase {
  Vectors x;
  Vectors v;
};

Phase plus(const Phase& y, double h, const Phase& k) {
  Phase sum = y;
  for (std::size_t n = 0; n < sum.x.size(); ++n) {
    sum.x[n] += h * k.x[n];
    sum.v[n] += h * k.v[n];
  }
  return sum;
}

class ReferenceSolver final : public Solver {
 public:
  ReferenceSolver(std::shared_ptr<const model::Tissue> tissue_given, const Parameters& parameters,
                  const Material& material_given)
      : Solver(std::move(tissue_given), material_given) {
    for (const auto& position : tissue().points.positions_mm) y_.x.push_back(position.cast<double>());
    y_.v.assign(y_.x.size(), Eigen::Vector3d::Zero());
    set_parameters(parameters);
    free_or_hold();
  }

  void step(int count, double step_s) override {
    for (int n = 0; n < count; ++n) {
      one_step(step_s);
      if (!grab_velocity_.isZero(0.0)) move_held(step_s);
      time_s_ += step_s;
    }
  }

  void hold(const std::vector<HeldPoint>& held) override {
    held_ = checked(held, y_.x.size());
    free_or_hold();
    for (const auto& [point, selectance] : held_) y_.v[point] *= 1.0 - static_cast<double>(selectance);
  }

  void set_grab_velocity(const Eigen::Vector3d& mm_per_s) override {
    const bool comes_to_rest = mm_per_s.isZero(0.0) && !grab_velocity_.isZero(0.0);
    grab_velocity_ = mm_per_s;
    if (comes_to_rest) move_held(0.0);
  }

  void set_parameters(const Parameters& parameters) override {
    check(parameters);
    parameters_ = parameters;
    mass_.clear();
    drag_per_s_.clear();
    for (std::size_t n = 0; n < y_.x.size(); ++n) {
      mass_.push_back(parameters.mass * factor(material().scales_mass, n));
      drag_per_s_.push_back(parameters.drag_per_s * factor(material().scales_drag, n));
    }
  }
  const Parameters& parameters() const override { return parameters_; }

  void set_anchors(const std::vector<std::uint32_t>& points) override {
    Solver::set_anchors(points);
    free_or_hold();
  }

  State state() const override {
    State copy;
    copy.time_s = time_s_;
    for (const auto& x : y_.x) copy.positions_mm.push_back(x.cast<float>());
    for (const auto& v : y_.v) copy.velocities_mm_per_s.push_back(v.cast<float>());
    return copy;
  }

  void set_state(const State& state) override {
    check_size(state, y_.x.size());
    for (std::size_t n = 0; n < y_.x.size(); ++n) {
      y_.x[n] = state.positions_mm[n].cast<double>();
      y_.v[n] = state.velocities_mm_per_s[n].cast<double>();
    }
    still_anchors();
    time_s_ = state.time_s;
  }

  void save_snapshot() override { snapshot_ = Snapshot{y_, time_s_}; }
  void restore_snapshot() override {
    if (!snapshot_) throw core::Error(core::ErrorKind::internal, "no-snapshot", "No snapshot was saved.");
    y_ = snapshot_->y;
    still_anchors();  // points may have become anchors since
    time_s_ = snapshot_->time_s;
  }

  double time_s() const override { return time_s_; }

  Health health() override {
    Health health;
    double displacement = 0.0;
    double speed = 0.0;
    for (std::size_t n = 0; n < y_.x.size(); ++n) {
      if (!y_.x[n].allFinite() || !y_.v[n].allFinite()) {
        health.finite = false;
        continue;
      }
      displacement =
          std::max(displacement, (y_.x[n] - tissue().points.positions_mm[n].cast<double>()).norm());
      speed = std::max(speed, y_.v[n].norm());
    }
    health.max_displacement_mm = static_cast<float>(displacement);
    health.max_speed_mm_per_s = static_cast<float>(speed);
    return health;
  }

  const compute::Buffer* positions_buffer() const override { return nullptr; }
  std::string device_name() const override { return "CPU reference"; }
  std::string driver() const override { return "double precision, one thread"; }
  std::string layout() const override { return "explicit"; }
  std::size_t bytes() const override { return 0; }

 protected:
  std::vector<float> freedom() const override {
    std::vector<float> copy;
    for (const double freedom : freedom_) copy.push_back(static_cast<float>(freedom));
    return copy;
  }

 private:
  struct Snapshot {
    Phase y;
    double time_s;
  };

  double factor(bool scaled, std::size_t point) const {
    return scaled && !material().factors.empty() ? static_cast<double>(material().factors[point]) : 1.0;
  }

  void one_step(double h) {
    switch (parameters_.integrator) {
      case Integrator::euler:
        y_ = plus(y_, h, derivative(y_, time_s_));
        return;
      case Integrator::symplectic_euler:
        return symplectic_euler(h);
      case Integrator::verlet:
        return verlet(h);
      case Integrator::velocity_verlet:
        return velocity_verlet(h);
      case Integrator::rk4:
        return rk4(h);
      case Integrator::implicit_euler:
        return implicit_euler(h);
    }
  }

  void symplectic_euler(double h) {
    const Vectors f = derivative(y_, time_s_).v;
    for (std::size_t n = 0; n < y_.x.size(); ++n) {
      y_.v[n] += h * f[n];
      y_.x[n] += h * freedom_[n] * y_.v[n];
    }
  }

  /// Position form: the place before is as far behind as the velocity says, so
  /// that a state that was set, or another step, starts it anew.
  void verlet(double h) {
    if (h == 0.0) return;
    const Vectors f = derivative(y_, time_s_).v;
    for (std::size_t n = 0; n < y_.x.size(); ++n) {
      const Eigen::Vector3d before = y_.x[n] - h * y_.v[n];
      const Eigen::Vector3d next = 2.0 * y_.x[n] - before + h * h * f[n];
      const Eigen::Vector3d moved = next - y_.x[n];
      y_.v[n] = moved / h;
      y_.x[n] += freedom_[n] * moved;
    }
  }

  /// The second force is at the new place, with the velocity predicted.
  void velocity_verlet(double h) {
    const Vectors f = derivative(y_, time_s_).v;
    Phase ahead = y_;
    for (std::size_t n = 0; n < y_.x.size(); ++n) {
      ahead.x[n] += h * freedom_[n] * (y_.v[n] + h / 2.0 * f[n]);
      ahead.v[n] += h * f[n];
    }
    const Vectors f_ahead = derivative(ahead, time_s_ + h).v;
    y_.x = ahead.x;
    for (std::size_t n = 0; n < y_.x.size(); ++n) y_.v[n] += h / 2.0 * (f[n] + f_ahead[n]);
  }

  void rk4(double h) {
    const Phase k1 = derivative(y_, time_s_);
    const Phase k2 = derivative(plus(y_, h / 2, k1), time_s_ + h / 2);
    const Phase k3 = derivative(plus(y_, h / 2, k2), time_s_ + h / 2);
    const Phase k4 = derivative(plus(y_, h, k3), time_s_ + h);
    y_ = plus(plus(plus(plus(y_, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
  }

  void implicit_euler(double h) {
    if (!implicit_spread_) implicit_spread_ = implicit_spread(tissue(), material());
    ImplicitSystem system;
    const model::LinkGraph& links = tissue().links;
    const double rest_scale = rest_scale_at(parameters_, time_s_ + h);
    for (std::size_t n = 0; n < links.size(); ++n) {
      if (link_alive()[n] == 0 || links.rest_lengths_mm[n] == 0.0F) continue;
      const auto [i, j] = links.pairs[n];
      system.links.push_back({{i, j},
                              rest_scale * static_cast<double>(links.rest_lengths_mm[n]),
                              parameters_.stiffness_per_s2 * mean_factor(material().scales_stiffness, i, j),
                              parameters_.damping_per_s * mean_factor(material().scales_damping, i, j)});
    }
    system.mass = mass_;
    system.drag = drag_per_s_;
    system.freedom = freedom_;
    system.gravity_mm_per_s2 = parameters_.gravity_mm_per_s2;
    implicit_step(system, implicit_plan(*implicit_spread_, parameters_, h), h, y_.x, y_.v);
  }

  /// (v, a) of every point, scaled by its freedom.
  Phase derivative(const Phase& y, double time_s) const {
    const Parameters& p = parameters_;
    Vectors force(y.v.size());
    for (std::size_t n = 0; n < y.v.size(); ++n) force[n] = -drag_per_s_[n] * y.v[n];
    const model::LinkGraph& links = tissue().links;
    const double rest_scale = rest_scale_at(p, time_s);
    for (std::size_t n = 0; n < links.size(); ++n) {
      if (link_alive()[n] == 0 || links.rest_lengths_mm[n] == 0.0F) continue;
      const auto [i, j] = links.pairs[n];
      const Eigen::Vector3d apart = y.x[j] - y.x[i];
      const double length = apart.norm();
      if (length < 1e-15) continue;  // coincident points: no direction, no force
      const Eigen::Vector3d d = apart / length;
      const double extension = length - rest_scale * static_cast<double>(links.rest_lengths_mm[n]);
      const double k = p.stiffness_per_s2 * mean_factor(material().scales_stiffness, i, j);
      const double c = p.damping_per_s * mean_factor(material().scales_damping, i, j);
      const Eigen::Vector3d pull = d * (k * extension + c * d.dot(y.v[j] - y.v[i]));
      force[i] += pull;
      force[j] -= pull;
    }
    Phase f;
    for (std::size_t n = 0; n < y.v.size(); ++n) {
      f.x.emplace_back(freedom_[n] * y.v[n]);
      f.v.emplace_back(freedom_[n] * (force[n] / mass_[n] + p.gravity_mm_per_s2));
    }
    return f;
  }

  double mean_factor(bool scaled, std::size_t i, std::size_t j) const {
    return (factor(scaled, i) + factor(scaled, j)) / 2.0;
  }

  void free_or_hold() {
    freedom_.assign(y_.x.size(), 1.0);
    for (const auto& [point, selectance] : held_) freedom_[point] = 1.0 - static_cast<double>(selectance);
    is_anchor_.assign(y_.x.size(), false);
    for (const std::uint32_t point : material().anchors) is_anchor_[point] = true;
    still_anchors();
  }

  void still_anchors() {
    for (const std::uint32_t point : material().anchors) {
      freedom_[point] = 0.0;
      y_.v[point].setZero();
    }
  }

  void move_held(double h) {
    for (const auto& [point, selectance] : held_) {
      if (is_anchor_[point]) continue;
      const double alpha = static_cast<double>(selectance);
      y_.x[point] += alpha * h * grab_velocity_;
      y_.v[point] = (1.0 - alpha) * y_.v[point] + alpha * grab_velocity_;
    }
  }

  Parameters parameters_;
  Phase y_;
  std::vector<double> mass_;        ///< one a point, as those below
  std::vector<double> drag_per_s_;  ///< force per velocity
  std::vector<double> freedom_;     ///< 1 - selectance, 0 for an anchor
  std::vector<bool> is_anchor_;
  std::vector<HeldPoint> held_;
  Eigen::Vector3d grab_velocity_ = Eigen::Vector3d::Zero();
  std::optional<ImplicitSpread> implicit_spread_;
  std::optional<Snapshot> snapshot_;
  double time_s_ = 0.0;
};

}  // namespace

std::unique_ptr<Solver> make_reference_solver(std::shared_ptr<const model::Tissue> tissue,
                                              const Parameters& parameters, const Material& material) {
  return std::make_unique<ReferenceSolver>(std::move(tissue), parameters, material);
}

}  // namespace palpate::simulation
