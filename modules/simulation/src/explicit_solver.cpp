#include "explicit_solver.hpp"

#include "device_solver.hpp"
#include "explicit_arrays.hpp"
#include "explicit_links.hpp"
#include "implicit_explicit.hpp"

#include "palpate/compute/kernel_library.hpp"
#include "palpate/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace palpate::simulation {

namespace {

using compute::Buffer;
using compute::Kernel;

constexpr std::size_t health_group = 64;
constexpr std::size_t health_groups = 256;
constexpr std::size_t link_health_group = 16;
// Work-items are heavy where they take many points; small groups spread them evenly.
constexpr std::size_t step_group = 32;

unsigned points_per_item(const compute::Device& device, const OpenclOptions& options) {
  const unsigned wanted = options.points_per_item;
  if (wanted == 0) {
    const unsigned width = device.info().float_vector_width;
    // Sixteen run out of registers: 20 % slower than eight where the width is sixteen.
    return width >= 8 ? 8 : width >= 4 ? 4 : 1;
  }
  return checked_points_per_item(wanted);
}

/// A kernel of explicit.cl and the part of a step that it stands for.
struct Launch {
  Kernel kernel;
  unsigned next;  ///< the first argument after its arrays of states
  double h;       ///< of the step, as the kernel says
  double lead;    ///< of the step; only for `stage`
  double at;      ///< when in the step its forces are: 0 at its begin, 1 at its end
  bool has_lead;
  std::size_t phases;  ///< read and written by it
};

/// One step: launches in order. Where they write beside the state there is a
/// second list, which brings it back in the next step.
struct Scheme {
  std::vector<Launch> launches;
  std::vector<Launch> back;
  bool is_warm = false;  ///< has run
};

class ExplicitSolver final : public DeviceSolver {
 public:
  ExplicitSolver(const compute::Device& device_given, std::shared_ptr<const model::Tissue> tissue_given,
                 const Parameters& parameters, const OpenclOptions& options, const Material& material_given,
                 std::string reason)
      : DeviceSolver(device_given, std::move(tissue_given), parameters, material_given),
        reason_(std::move(reason)),
        library_(device_given),
        a_(device_given, point_count(), points_per_item(device_given, options)),
        snapshot_(device_given, a_.stride * sizeof(Float4)),
        partials_(Buffer::allocate(device_given, health_groups * sizeof(Float4))) {
    a_.scaling_defines = scaling_defines_of(material());
    write_links();
    State rest{0.0, tissue().points.positions_mm, {}};
    rest.velocities_mm_per_s.assign(point_count(), Eigen::Vector3f::Zero());
    write_state(rest);
    rest_ = Buffer::allocate(device(), a_.y.x.bytes());
    rest_.copy_from(a_.y.x, rest_.bytes());
    build();
    write_freedom(std::vector<float>(point_count(), 1.0F));
    start();
    warm_up();
  }

  void set_links_alive(const std::vector<std::uint32_t>& links, bool alive) override {
    Solver::set_links_alive(links, alive);
    if (link_places_.empty()) link_places_ = places_of(tissue().links, a_.stride, a_.links_per_point);
    std::vector<std::uint32_t> chosen = links;
    std::sort(chosen.begin(), chosen.end());
    chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
    if (chosen.empty()) return;
    std::vector<std::uint32_t> places;
    std::vector<float> lengths_mm;
    for (const std::uint32_t link : chosen)
      for (const std::uint32_t place : link_places_[link]) {
        places.push_back(place);
        lengths_mm.push_back(alive ? tissue().links.rest_lengths_mm[link] : 0.0F);
      }
    const Buffer places_there = buffer_of(device(), places);
    const Buffer lengths_there = buffer_of(device(), lengths_mm);
    set_rest_lengths_.set_all(a_.rest_lengths, places_there, lengths_there,
                              static_cast<std::uint32_t>(places.size()));
    set_rest_lengths_.run(places.size());
    device().finish();  // the lists go now
  }

  Health health() override {
    health_.run(health_groups * health_group, health_group);
    Float4 worst{};
    partials_.visit([&](const void* data) {
      const auto* values = static_cast<const float*>(data);
      for (std::size_t n = 0; n < 4 * health_groups; ++n) worst[n % 4] = std::max(worst[n % 4], values[n]);
    });
    return {worst[2] == 0.0F, std::sqrt(worst[0]), std::sqrt(worst[1])};
  }

  LinkHealth link_health() override {
    const Parameters& p = parameters();
    link_health_.set(7, static_cast<float>(p.stiffness_per_s2));
    link_health_.set(8, static_cast<float>(rest_scale_at(p, time_s())));
    link_health_.set(9, float4(p.gravity_mm_per_s2));
    link_health_.set(10, static_cast<float>(p.mass));
    link_health_.run(health_groups * link_health_group, link_health_group);
    LinkHealth sum;
    partials_.visit([&](const void* data) {
      const auto* values = static_cast<const float*>(data);
      for (std::size_t n = 0; n < health_groups; ++n) {
        sum.kinetic += static_cast<double>(values[4 * n]);
        sum.potential += static_cast<double>(values[4 * n + 1]);
        sum.max_strain_rate_per_s = std::max(sum.max_strain_rate_per_s, values[4 * n + 2]);
      }
    });
    return sum;
  }

  const Buffer* positions_buffer() const override { return &a_.y.x; }
  std::string layout() const override { return "explicit"; }
  std::string layout_reason() const override { return reason_; }
  std::size_t bytes() const override {
    std::size_t sum = rest_.bytes() + a_.partners.bytes() + a_.rest_lengths.bytes() + a_.freedom.bytes() +
                      partials_.bytes() + list_bytes();
    for (const auto* phase : {&a_.y, &a_.s2, &a_.s3, &a_.s4, &snapshot_}) sum += phase->bytes();
    if (implicit_) sum += implicit_->bytes();
    return sum;
  }
  std::size_t bytes_per_step() const override {
    if (is_implicit_) return 0;  // it depends on the step
    std::size_t sum = 0;
    for (const auto& launch : scheme_->launches)
      sum +=
          launch.phases * a_.y.bytes() + a_.partners.bytes() + a_.rest_lengths.bytes() + a_.freedom.bytes();
    return sum;
  }

 protected:
  void use(const Parameters& parameters) override {
    if (parameters.integrator == Integrator::implicit_euler) {
      if (!implicit_)
        implicit_ = std::make_unique<ImplicitExplicitStep>(library_, a_, step_defines(),
                                                           implicit_spread(tissue(), material()));
      implicit_->use(parameters);
      is_implicit_ = true;
      return;
    }
    Scheme& scheme = scheme_of(parameters.integrator);
    is_implicit_ = false;
    const double per_mass = 1.0 / parameters.mass;
    stiffness_ = parameters.stiffness_per_s2 * per_mass;
    for (auto* launches : {&scheme.launches, &scheme.back})
      for (auto& launch : *launches) {
        launch.kernel.set(launch.next + 4, static_cast<float>(stiffness_));
        launch.kernel.set(launch.next + 6, static_cast<float>(parameters.damping_per_s * per_mass));
        launch.kernel.set(launch.next + 7, static_cast<float>(parameters.drag_per_s * per_mass));
        launch.kernel.set(launch.next + 8, float4(parameters.gravity_mm_per_s2));
      }
    scheme_ = &scheme;
    explicit_in_use_ = parameters;
    if (scheme.is_warm || point_count() == 0) return;
    // Drivers finish the compiling of a kernel at its first launch; that wait
    // belongs here, not into the next picture. A step of no time changes nothing.
    begin_steps(0.0);
    run_step(0.0, 0.0);
    end_steps();
    device().finish();
    scheme.is_warm = true;
  }

  void write_freedom(const std::vector<float>& freedom) override {
    std::vector<float> whole = freedom;
    whole.resize(a_.stride, 0.0F);  // the points that only fill the last block up stay where they are
    a_.freedom.write(whole.data(), whole.size() * sizeof(float));
  }

  void begin_steps(double step_s) override {
    if (is_implicit_) {
      implicit_->begin_steps(step_s);
      return;
    }
    for (auto* launches : {&scheme_->launches, &scheme_->back})
      for (auto& launch : *launches) {
        launch.kernel.set(launch.next + 5, static_cast<float>(stiffness_));
        launch.kernel.set(launch.next + 9, static_cast<float>(launch.h * step_s));
        if (launch.has_lead) launch.kernel.set(launch.next + 10, static_cast<float>(launch.lead * step_s));
      }
  }

  void run_step(double step_s, double time_s) override {
    if (is_implicit_) {
      implicit_->run_step(step_s, time_s);
      return;
    }
    for (auto& launch : is_beside_ ? scheme_->back : scheme_->launches) {
      if (explicit_in_use_.beat_amplitude != 0.0)
        launch.kernel.set(
            launch.next + 5,
            static_cast<float>(stiffness_ * rest_scale_at(explicit_in_use_, time_s + launch.at * step_s)));
      launch.kernel.run(a_.stride / a_.points_per_item, step_group);
    }
    if (!scheme_->back.empty()) is_beside_ = !is_beside_;
  }

  void end_steps() override {
    if (is_beside_) a_.y.copy_from(a_.s2);
    is_beside_ = false;
  }

  void move_points(const PointList& points, const Float4& velocity_mm_per_s, float h_s) override {
    DevicePhase& now = is_beside_ ? a_.s2 : a_.y;
    grab_.set_all(now.x, now.v, points.places, points.selectances, static_cast<std::uint32_t>(points.count),
                  velocity_mm_per_s, h_s);
    grab_.run(points.count);
  }

  void read_state(State& state) const override {
    state.positions_mm = vectors_of(a_.y.x);
    state.velocities_mm_per_s = vectors_of(a_.y.v);
  }

  void write_state(const State& state) override {
    const auto& factors = material().factors;
    std::vector<Float4> values(a_.stride, Float4{0.0F, 0.0F, 0.0F, 1.0F});
    for (std::size_t n = 0; n < point_count(); ++n) {
      const auto& x = state.positions_mm[n];
      values[n] = {x.x(), x.y(), x.z(), factors.empty() ? 1.0F : factors[n]};
    }
    a_.y.x.write(values.data(), a_.y.x.bytes());
    std::fill(values.begin(), values.end(), Float4{});
    for (std::size_t n = 0; n < point_count(); ++n) {
      const auto& v = state.velocities_mm_per_s[n];
      values[n] = {v.x(), v.y(), v.z(), 0.0F};
    }
    a_.y.v.write(values.data(), a_.y.v.bytes());
  }

  void copy_state_to_snapshot() override { snapshot_.copy_from(a_.y); }
  void copy_snapshot_to_state() override { a_.y.copy_from(snapshot_); }

 private:
  std::vector<Eigen::Vector3f> vectors_of(const Buffer& buffer) const {
    std::vector<Eigen::Vector3f> result(point_count());
    buffer.visit([&](const void* data) {
      const auto* values = static_cast<const float*>(data);
      for (std::size_t n = 0; n < result.size(); ++n)
        result[n] = {values[4 * n], values[4 * n + 1], values[4 * n + 2]};
    });
    return result;
  }

  void write_links() {
    const Columns columns = columns_of(tissue().links, a_.stride);
    a_.links_per_point = columns.links_per_point;
    a_.partners = buffer_of(device(), columns.partners);
    a_.rest_lengths = buffer_of(device(), columns.rest_lengths_mm);
  }

  void build() {
    set_rest_lengths_ = library_.build("explicit.cl", "set_rest_lengths", step_defines());
    grab_ = library_.build("grab.cl", "grab");
    health_ = library_.build("health.cl", "health", {"GROUP_SIZE=" + std::to_string(health_group)});
    health_.set_all(a_.y.x, a_.y.v, rest_, partials_, static_cast<std::uint32_t>(point_count()));
    std::vector<std::string> defines = link_defines();
    defines.push_back("GROUP_SIZE=" + std::to_string(link_health_group));
    link_health_ = library_.build("explicit_health.cl", "link_health", defines);
    link_health_.set_all(a_.y.x, a_.y.v, a_.partners, a_.rest_lengths, a_.freedom, partials_,
                         static_cast<std::uint32_t>(a_.stride));
  }

  std::vector<std::string> link_defines() const {
    std::vector<std::string> defines = a_.scaling_defines;
    defines.push_back("LINKS_PER_POINT=" + std::to_string(a_.links_per_point));
    defines.push_back("COLUMN_BLOCK=" + std::to_string(column_block));
    defines.push_back("POINTS_PER_ITEM=" + std::to_string(a_.points_per_item));
    return defines;
  }

  std::vector<std::string> step_defines() const {
    std::vector<std::string> defines = link_defines();
    defines.emplace_back("-cl-fast-relaxed-math");
    return defines;
  }

  /// The kernel with its arrays of states and those that all kernels take.
  Launch launch(const char* name, const std::vector<DevicePhase*>& phases, double h, double lead, double at) {
    const bool is_stage = std::string(name) == "stage";
    // All but `stage` read the phase that they write; `stage` may find its base in its source.
    const std::size_t moved =
        is_stage ? std::set<DevicePhase*>(phases.begin(), phases.end()).size() : phases.size() + 1;
    Launch result{library_.build("explicit.cl", name, step_defines()), 0, h, lead, at, is_stage, moved};
    for (const DevicePhase* phase : phases) {
      result.kernel.set(result.next++, phase->x);
      result.kernel.set(result.next++, phase->v);
    }
    result.kernel.set(result.next, a_.partners);
    result.kernel.set(result.next + 1, a_.rest_lengths);
    result.kernel.set(result.next + 2, a_.freedom);
    result.kernel.set(result.next + 3, static_cast<std::uint32_t>(a_.stride));
    return result;
  }

  Scheme made(Integrator integrator) {
    DevicePhase* const y = &a_.y;
    DevicePhase* const s2 = &a_.s2;
    DevicePhase* const s3 = &a_.s3;
    DevicePhase* const s4 = &a_.s4;
    Scheme scheme;
    const auto add = [&](std::vector<Launch>& to, auto&&... values) { to.push_back(launch(values...)); };
    using Phases = std::vector<DevicePhase*>;
    switch (integrator) {
      case Integrator::rk4:
        add(scheme.launches, "stage", Phases{y, y, s2}, 0.5, 0.0, 0.0);
        add(scheme.launches, "stage", Phases{s2, y, s3}, 0.5, 0.0, 0.5);
        add(scheme.launches, "stage", Phases{s3, y, s4}, 1.0, 0.0, 0.5);
        add(scheme.launches, "finish", Phases{s4, s3, s2, y}, 1.0 / 6.0, 0.0, 1.0);
        break;
      case Integrator::velocity_verlet:
        add(scheme.launches, "stage", Phases{y, y, s2}, 1.0, 0.5, 0.0);
        add(scheme.launches, "correct", Phases{s2, y}, 0.5, 0.0, 1.0);
        break;
      case Integrator::euler:
      case Integrator::symplectic_euler:
      case Integrator::verlet: {  // the last two step alike: x - x_before is h v
        const double lead = integrator == Integrator::euler ? 0.0 : 1.0;
        add(scheme.launches, "stage", Phases{y, y, s2}, 1.0, lead, 0.0);
        add(scheme.back, "stage", Phases{s2, s2, y}, 1.0, lead, 0.0);
        break;
      }
      default:
        core::throw_usage("The integrator " + to_string(integrator) + " is not in the explicit layout.");
    }
    return scheme;
  }

  /// Made when it is first asked for.
  Scheme& scheme_of(Integrator integrator) {
    const auto found = schemes_.find(integrator);
    return found != schemes_.end() ? found->second
                                   : schemes_.emplace(integrator, made(integrator)).first->second;
  }

  /// What use() does for the steps, for the rest.
  void warm_up() {
    if (point_count() == 0) return;
    grab_.set_all(a_.y.x, a_.y.v, a_.freedom, a_.freedom, std::uint32_t{0}, Float4{}, 0.0F);
    grab_.run(1);
    health();
    link_health();
  }

  std::string reason_;
  compute::KernelLibrary library_;
  // The last launch of a step writes over y, or a copy brings it back there, so
  // that the positions stay in one buffer for whoever draws them.
  ExplicitArrays a_;
  DevicePhase snapshot_;
  Buffer rest_;
  Buffer partials_;
  std::map<Integrator, Scheme> schemes_;
  Scheme* scheme_ = nullptr;
  std::unique_ptr<ImplicitExplicitStep> implicit_;  ///< made when it is first asked for
  bool is_implicit_ = false;
  bool is_beside_ = false;  ///< within a batch: the state is in s2
  double stiffness_ = 0.0;  ///< k/m
  Parameters explicit_in_use_;
  Kernel set_rest_lengths_;
  Kernel grab_;
  Kernel health_;
  Kernel link_health_;
  std::vector<std::array<std::uint32_t, 2>> link_places_;  ///< made at the first cut
};

}  // namespace

ExplicitArrays::ExplicitArrays(const compute::Device& device, std::size_t points, std::size_t points_an_item)
    : point_count(points),
      points_per_item(points_an_item),
      stride((points + column_block - 1) / column_block * column_block),
      y(device, stride * sizeof(Float4)),
      s2(device, stride * sizeof(Float4)),
      s3(device, stride * sizeof(Float4)),
      s4(device, stride * sizeof(Float4)),
      freedom(Buffer::allocate(device, stride * sizeof(float))) {}

std::unique_ptr<Solver> make_explicit_solver(const compute::Device& device,
                                             std::shared_ptr<const model::Tissue> tissue,
                                             const Parameters& parameters, const OpenclOptions& options,
                                             const Material& material, const std::string& reason) {
  return std::make_unique<ExplicitSolver>(device, std::move(tissue), parameters, options, material, reason);
}

}  // namespace palpate::simulation
