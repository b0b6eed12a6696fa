// The model once more, in double precision and as plainly as the thesis says
// it: what the OpenCL kernels are measured against. No code is shared with them.
#include "held.hpp"

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
                  const Material& material)
      : Solver(std::move(tissue_given), material), parameters_(parameters) {
    check(parameters);
    if (parameters.integrator != Integrator::rk4)
      core::throw_usage("The integrator " + to_string(parameters.integrator) + " is not in this version.");
    for (const auto& position : tissue().points.positions_mm) y_.x.push_back(position.cast<double>());
    y_.v.assign(y_.x.size(), Eigen::Vector3d::Zero());
    selectance_.assign(y_.x.size(), 0.0);
  }

  void step(int count, double step_s) override {
    for (int n = 0; n < count; ++n) {
      const Phase k1 = derivative(y_);
      const Phase k2 = derivative(plus(y_, step_s / 2, k1));
      const Phase k3 = derivative(plus(y_, step_s / 2, k2));
      const Phase k4 = derivative(plus(y_, step_s, k3));
      y_ = plus(plus(plus(plus(y_, step_s / 6, k1), step_s / 3, k2), step_s / 3, k3), step_s / 6, k4);
      if (!grab_velocity_.isZero(0.0)) move_held(step_s);
      time_s_ += step_s;
    }
  }

  void hold(const std::vector<HeldPoint>& held) override {
    held_ = checked(held, y_.x.size());
    selectance_.assign(y_.x.size(), 0.0);
    for (const auto& [point, selectance] : held_) {
      selectance_[point] = static_cast<double>(selectance);
      y_.v[point] *= 1.0 - selectance_[point];
    }
  }

  void set_grab_velocity(const Eigen::Vector3d& mm_per_s) override {
    const bool comes_to_rest = mm_per_s.isZero(0.0) && !grab_velocity_.isZero(0.0);
    grab_velocity_ = mm_per_s;
    if (comes_to_rest) move_held(0.0);
  }

  void set_parameters(const Parameters& parameters) override {
    check(parameters);
    if (parameters.integrator != Integrator::rk4)
      core::throw_usage("The integrator " + to_string(parameters.integrator) + " is not in this version.");
    parameters_ = parameters;
  }
  const Parameters& parameters() const override { return parameters_; }

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
    time_s_ = state.time_s;
  }

  void save_snapshot() override { snapshot_ = Snapshot{y_, time_s_}; }
  void restore_snapshot() override {
    if (!snapshot_) throw core::Error(core::ErrorKind::internal, "no-snapshot", "No snapshot was saved.");
    y_ = snapshot_->y;
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

 private:
  struct Snapshot {
    Phase y;
    double time_s;
  };

  Phase derivative(const Phase& y) const {
    Phase f;
    f.x = y.v;
    f.v.resize(y.v.size());
    for (std::size_t n = 0; n < y.v.size(); ++n)
      f.v[n] = parameters_.gravity_mm_per_s2 - parameters_.drag_per_s * y.v[n];
    const model::LinkGraph& links = tissue().links;
    for (std::size_t n = 0; n < links.size(); ++n) {
      const auto [i, j] = links.pairs[n];
      const Eigen::Vector3d apart = y.x[j] - y.x[i];
      const double length = apart.norm();
      if (length < 1e-15) continue;  // coincident points: no direction, no force
      const Eigen::Vector3d d = apart / length;
      const double extension = length - static_cast<double>(links.rest_lengths_mm[n]);
      const Eigen::Vector3d force =
          d * (parameters_.stiffness_per_s2 * extension + parameters_.damping_per_s * d.dot(y.v[j] - y.v[i]));
      f.v[i] += force;
      f.v[j] -= force;
    }
    for (const auto& [point, unused] : held_) {
      const double freedom = 1.0 - selectance_[point];
      f.x[point] *= freedom;
      f.v[point] *= freedom;
    }
    return f;
  }

  void move_held(double h) {
    for (const auto& [point, unused] : held_) {
      const double alpha = selectance_[point];
      y_.x[point] += alpha * h * grab_velocity_;
      y_.v[point] = (1.0 - alpha) * y_.v[point] + alpha * grab_velocity_;
    }
  }

  Parameters parameters_;
  Phase y_;
  std::vector<double> selectance_;
  std::vector<HeldPoint> held_;
  Eigen::Vector3d grab_velocity_ = Eigen::Vector3d::Zero();
  std::optional<Snapshot> snapshot_;
  double time_s_ = 0.0;
};

}  // namespace

std::unique_ptr<Solver> make_reference_solver(std::shared_ptr<const model::Tissue> tissue,
                                              const Parameters& parameters, const Material& material) {
  return std::make_unique<ReferenceSolver>(std::move(tissue), parameters, material);
}

}  // namespace palpate::simulation
