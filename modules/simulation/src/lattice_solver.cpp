#include "lattice_solver.hpp"

#include "changed_part.hpp"
#include "device_solver.hpp"
#include "implicit_lattice.hpp"
#include "lattice_arguments.hpp"
#include "lattice_health.hpp"
#include "lattice_layout.hpp"
#include "lattice_march.hpp"
#include "lattice_passes.hpp"
#include "lattice_threads.hpp"

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

// The four states of a slab fit the second-level caches of two cores; a launch
// costs as much as some hundred lanes.
constexpr std::size_t lanes_in_slab = 24576;

unsigned lanes_for(const compute::Device& device, const OpenclOptions& options) {
  const unsigned wanted = options.points_per_item;
  if (wanted == 0) {
    const unsigned width = device.info().float_vector_width;
    return width >= 16 ? 16 : width >= 8 ? 8 : width >= 4 ? 4 : 1;
  }
  return checked_points_per_item(wanted);
}

/// A pass over the lattice: one launch a slab.
struct Stage {
  Kernel kernel;
  double h;   ///< of the step
  double at;  ///< when in the step its forces are
};

/// One step; where it writes beside the state, `back` is the next.
struct Scheme {
  std::vector<Stage> stages;
  std::vector<Stage> back;
};

class LatticeSolver final : public DeviceSolver {
 public:
  LatticeSolver(const compute::Device& device_given, std::shared_ptr<const model::Tissue> tissue_given,
                const Parameters& parameters, const OpenclOptions& options, const Material& material_given,
                std::string reason)
      : DeviceSolver(device_given, std::move(tissue_given), parameters, material_given),
        reason_(std::move(reason)),
        library_(device_given),
        layout_(build_lattice(tissue(), lanes_for(device_given, options))) {
    if (device_given.info().type == compute::DeviceType::cpu && !options.launches_every_stage)
      march_ = std::make_unique<LatticeMarch>(device_given, layout_);
    allocate();
    State rest{0.0, tissue().points.positions_mm, {}};
    rest.velocities_mm_per_s.assign(point_count(), Eigen::Vector3f::Zero());
    build();
    write_state(rest);
    start();
    warm_up();
  }

  Health health() override { return health_->of(state_buffer(), rest_positions_); }

  LinkHealth link_health() override {
    const Parameters& p = parameters();
    return health_->of_links(
        state_buffer(), {freedom_, factors_ ? factors_ : freedom_, rest_, rows_, overflow_begins_, overflow_},
        p, rest_scale_at(p, time_s()), from_lps(p.gravity_mm_per_s2));
  }

  void set_links_alive(const std::vector<std::uint32_t>& links, bool alive) override {
    Solver::set_links_alive(links, alive);
    Changed stencil;
    Changed outside;
    for (const std::uint32_t link : links) {
      const auto& [a, b] = tissue().links.pairs[link];
      const float length_mm = alive ? tissue().links.rest_lengths_mm[link] : 0.0F;
      const LatticePlace place = layout_.place_of(layout_.lane_of_point[a], layout_.lane_of_point[b]);
      if (place.in_stencil) {
        layout_.rest[place.rest] = layout_.stored_length(length_mm);
        stencil.add(place.rest);
      } else {
        for (const std::size_t entry : place.overflow) {
          layout_.overflow[entry].rest_length_mm = length_mm;
          outside.add(entry);
        }
      }
    }
    stencil.write(layout_.rest, rest_);
    outside.write(layout_.overflow, overflow_);
  }

  const Buffer* positions_buffer() const override { return &published_; }
  std::string layout() const override { return "lattice"; }
  std::string layout_reason() const override { return reason_; }
  std::size_t bytes() const override {
    std::size_t sum = list_bytes();
    for (const Buffer* buffer : {&y_, &s2_, &s3_, &s4_, &snapshot_, &rest_positions_, &waiting_, &rest_,
                                 &rows_, &origins_, &entries_, &chunks_, &overflow_begins_, &overflow_,
                                 &freedom_, &factors_, &lane_of_point_, &published_})
      sum += buffer->bytes();
    sum += health_->bytes();
    if (implicit_) sum += implicit_->bytes();
    if (march_) sum += march_->bytes();
    return sum;
  }

  std::size_t bytes_per_step() const override {
    std::size_t sum = 0;  // none of implicit Euler, whose passes depend on the step
    for (const Pass& pass : passes_of(parameters_in_use_.integrator)) {
      const std::size_t states = (pass.base == pass.source ? 2 : 3) + (pass.mode == Mode::finish_rk4 ? 2 : 0);
      // Forces wait in three of the six vectors of a state, written and read.
      sum += states * y_.bytes() + y_.bytes() + rest_.bytes() + rows_.bytes() +
             layout_.segments * sizeof(std::uint64_t);
      if (!is_all_free()) sum += freedom_.bytes();
      if (factors_) sum += factors_.bytes();
    }
    return sum;
  }

 protected:
  void use(const Parameters& parameters) override {
    is_undamped_ = parameters.damping_per_s == 0.0;
    Scheme* const next = marches(parameters) ? nullptr : &scheme_of(parameters);
    if (next == nullptr) use_march(parameters);
    if (is_beside_) y_.copy_from(s2_, s2_.bytes());
    is_beside_ = false;
    scheme_ = next;
    parameters_in_use_ = parameters;
    if (scheme_ != nullptr)
      use_in(*scheme_, parameters);
    else if (freedom_)
      march_->set_freedom(freedom_, is_all_free());
    if (freedom_) warm_up_steps();
  }

  void write_freedom(const std::vector<float>& freedom) override {
    all_free_ = std::all_of(freedom.begin(), freedom.end(), [](float f) { return f == 1.0F; });
    std::vector<float> lanes((layout_.segments + 2) * layout_.lanes, 0.0F);
    for (std::size_t point = 0; point < freedom.size(); ++point)
      lanes[layout_.lane_of_point[point]] = freedom[point];
    freedom_ = buffer_of(device(), lanes);
    for_stages([&](Stage& stage) {
      stage.kernel.set(freedom_argument, freedom_);
      stage.kernel.set(all_free_argument, is_all_free() ? 1U : 0U);
    });
    if (march_) march_->set_freedom(freedom_, is_all_free());
  }

  void begin_steps(double step_s) override {
    if (scheme_ == nullptr) return;
    if (parameters_in_use_.integrator == Integrator::implicit_euler) {
      implicit_->begin_steps(parameters_in_use_, float4(from_lps(parameters_in_use_.gravity_mm_per_s2)),
                             step_s, kernels_of(*scheme_), y_, freedom_, s4_, {&s2_, &s3_});
      if (march_) march_implicitly(step_s);
      return;
    }
    for (auto* list : {&scheme_->stages, &scheme_->back})
      for (Stage& stage : *list) stage.kernel.set(h_argument, static_cast<float>(stage.h * step_s));
  }

  void run_steps(int count, double step_s, double time_s) override {
    if (scheme_ != nullptr) {
      DeviceSolver::run_steps(count, step_s, time_s);
      return;
    }
    const int at_once = march_->most_steps();
    for (int done = 0; done < count; done += at_once) {
      const int now = std::min(count - done, at_once);
      is_beside_ = march_->run(now, step_s, time_s + done * step_s, is_beside_);
    }
  }

  void run_step(double step_s, double time_s) override {
    if (parameters_in_use_.integrator == Integrator::implicit_euler) {
      implicit_->run_step(
          step_s, time_s, kernels_of(*scheme_), schedule_.slabs.size(),
          [this](ImplicitLatticeStep::Pass pass, std::size_t slab) { launch(scheme_->stages[pass], slab); },
          iterate_);
      return;
    }
    auto& stages = is_beside_ ? scheme_->back : scheme_->stages;
    if (parameters_in_use_.beat_amplitude != 0.0)
      for (Stage& stage : stages)
        set_beat(stage, rest_scale_at(parameters_in_use_, time_s + stage.at * step_s));
    staggered(stages.size(), schedule_.slabs.size(),
              [&](std::size_t n, std::size_t slab) { launch(stages[n], slab); });
    if (!scheme_->back.empty()) is_beside_ = !is_beside_;
  }

  void end_steps() override { publish(); }

  void move_points(const PointList& points, const Float4& velocity_mm_per_s, float h_s) override {
    const Eigen::Vector3d velocity = from_lps(Eigen::Vector3d(static_cast<double>(velocity_mm_per_s[0]),
                                                              static_cast<double>(velocity_mm_per_s[1]),
                                                              static_cast<double>(velocity_mm_per_s[2])));
    grab_.set_all(state_buffer(), points.places, points.selectances, static_cast<std::uint32_t>(points.count),
                  float4(velocity), h_s);
    grab_.run(points.count);
  }
  std::uint32_t place_of(std::uint32_t point) const override { return layout_.lane_of_point[point]; }

  void read_state(State& state) const override {
    state.positions_mm.resize(point_count());
    published_.visit([&](const void* data) {
      const auto* values = static_cast<const float*>(data);
      for (std::size_t n = 0; n < point_count(); ++n)
        state.positions_mm[n] = {values[4 * n], values[4 * n + 1], values[4 * n + 2]};
    });
    state.velocities_mm_per_s.resize(point_count());
    state_buffer().visit([&](const void* data) {
      const auto* values = static_cast<const float*>(data);
      for (std::size_t n = 0; n < point_count(); ++n) {
        const std::size_t at = component(layout_.lane_of_point[n], 3);
        const Eigen::Vector3f velocity(values[at], values[at + layout_.lanes],
                                       values[at + 2 * layout_.lanes]);
        state.velocities_mm_per_s[n] = (layout_.to_lps * velocity.cast<double>()).cast<float>();
      }
    });
  }

  void write_state(const State& state) override {
    std::vector<float> lanes((layout_.segments + 2) * 6 * layout_.lanes, 0.0F);
    in_parallel(point_count(), 65536, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin; n < end; ++n) {
        const std::uint32_t lane = layout_.lane_of_point[n];
        const Eigen::Vector3d place = from_lps(state.positions_mm[n].cast<double>() - layout_.site_mm(lane));
        const Eigen::Vector3d velocity = from_lps(state.velocities_mm_per_s[n].cast<double>());
        for (Eigen::Index axis = 0; axis < 3; ++axis) {
          lanes[component(lane, static_cast<std::size_t>(axis))] = static_cast<float>(place[axis]);
          lanes[component(lane, static_cast<std::size_t>(axis) + 3)] = static_cast<float>(velocity[axis]);
        }
      }
    });
    state_buffer().write(lanes.data(), lanes.size() * sizeof(float));
    if (!rest_positions_) {
      std::vector<float> rest((layout_.segments + 2) * 3 * layout_.lanes);
      const std::size_t part = 3 * std::size_t{layout_.lanes};
      for (std::size_t segment = 0; segment < layout_.segments + 2; ++segment)
        std::copy_n(lanes.begin() + static_cast<std::ptrdiff_t>(2 * part * segment), part,
                    rest.begin() + static_cast<std::ptrdiff_t>(part * segment));
      rest_positions_ = buffer_of(device(), rest);
    }
    publish();
  }

  void copy_state_to_snapshot() override {
    if (!snapshot_) snapshot_ = Buffer::allocate(device(), state_buffer().bytes());
    snapshot_.copy_from(state_buffer(), snapshot_.bytes());
  }
  void copy_snapshot_to_state() override {
    state_buffer().copy_from(snapshot_, snapshot_.bytes());
    publish();
  }

 private:
  std::size_t state_bytes() const { return (layout_.segments + 2) * 6 * layout_.lanes * sizeof(float); }
  std::size_t component(std::uint32_t lane, std::size_t n) const {
    return (std::size_t{lane / layout_.lanes} * 6 + n) * layout_.lanes + lane % layout_.lanes;
  }
  Eigen::Vector3d from_lps(const Eigen::Vector3d& v) const { return layout_.to_lps.transpose() * v; }
  Buffer& state_buffer() { return is_beside_ ? s2_ : y_; }
  const Buffer& state_buffer() const { return is_beside_ ? s2_ : y_; }

  Buffer zeros(std::size_t bytes) const {
    Buffer buffer = Buffer::allocate(device(), bytes);
    buffer.fill_zero();
    return buffer;
  }

  void allocate() {
    y_ = zeros(state_bytes());
    const std::size_t segments = layout_.segments + 2 + LatticeMarch::trash_segments(device());
    waiting_ = zeros(segments * 3 * layout_.lanes * sizeof(float));
    rest_ = buffer_of(device(), layout_.rest);
    rows_ = buffer_of(device(), layout_.rows);
    std::vector<Float4> origins;
    for (std::uint32_t segment = 0; segment < layout_.segments + 2; ++segment)
      origins.push_back(float4(layout_.site_mm(segment * layout_.lanes)));
    origins_ = buffer_of(device(), origins);
    overflow_begins_ = buffer_of(device(), layout_.overflow_begins);
    overflow_ = buffer_of(device(), layout_.overflow);
    lane_of_point_ = buffer_of(device(), layout_.lane_of_point);
    published_ = Buffer::allocate(device(), std::max<std::size_t>(1, point_count()) * sizeof(Float4));
    Eigen::Vector3d weight_of_sites = Eigen::Vector3d::Zero();  // mm, by mass factor
    std::vector<float> factors;
    if (material().is_scaled()) factors.assign((layout_.segments + 2) * layout_.lanes, 1.0F);
    for (std::size_t point = 0; point < point_count(); ++point) {
      const std::uint32_t lane = layout_.lane_of_point[point];
      if (!factors.empty()) factors[lane] = material().factors[point];
      const bool is_scaled = material().is_scaled() && material().scales_mass;
      weight_of_sites +=
          (is_scaled ? static_cast<double>(material().factors[point]) : 1.0) * layout_.site_mm(lane);
    }
    if (!factors.empty()) factors_ = buffer_of(device(), factors);
    std::vector<std::string> health_defines = scaling_defines_of(material());
    health_defines.push_back("LANES=" + std::to_string(layout_.lanes));
    health_defines.push_back(slots_define());
    health_ = std::make_unique<LatticeHealth>(library_, layout_, health_defines, weight_of_sites);
  }

  void build() {
    const std::vector<std::string> defines{"LANES=" + std::to_string(layout_.lanes)};
    publish_ = library_.build("lattice_points.cl", "publish", defines);
    grab_ = library_.build("lattice_points.cl", "grab", defines);
    publish_.set(1, lane_of_point_);
    publish_.set(2, origins_);
    publish_.set(3, published_);
    publish_.set(4, static_cast<std::uint32_t>(point_count()));
    publish_.set(5, float4(layout_.to_lps * layout_.steps_mm[0]));
    for (unsigned axis = 0; axis < 3; ++axis)
      publish_.set(6 + axis, float4(layout_.to_lps.col(static_cast<Eigen::Index>(axis))));
  }

  void publish() {
    publish_.set(0, state_buffer());
    publish_.run(point_count(), 256);
  }

  std::string slots_define() const { return "SLOTS=" + std::to_string(layout_.slots.used) + "u"; }

  std::vector<std::string> defines(const std::string& define = {}) const {
    std::vector<std::string> defines = scaling_defines_of(material());
    if (!define.empty()) defines.push_back(define);
    defines.push_back("LANES=" + std::to_string(layout_.lanes));
    defines.push_back(slots_define());
    defines.emplace_back("-cl-fast-relaxed-math");
    if (is_undamped_ && define.empty()) defines.emplace_back("UNDAMPED");
    if (layout_.is_sheared) defines.emplace_back("SHEARED");
    return defines;
  }

  const Buffer& state_named(Stored name) const {
    return name == Stored::y ? y_ : name == Stored::s2 ? s2_ : name == Stored::s3 ? s3_ : s4_;
  }

  /// define: of an implicit pass, which reads no velocities.
  Stage stage_of(const Pass& pass, const std::string& define = {}) {
    need_schedule();
    Stage stage{library_.build("lattice.cl", "sweep", defines(define)), pass.h, pass.at};
    Kernel& kernel = stage.kernel;
    const Buffer& base = state_named(pass.base);
    const bool ends_rk4 = pass.mode == Mode::finish_rk4;
    kernel.set_all(state_named(pass.source), base, ends_rk4 ? s2_ : base, ends_rk4 ? s3_ : base,
                   state_named(pass.target), waiting_, rest_, rows_, entries_, chunks_, overflow_begins_,
                   overflow_, freedom_ ? freedom_ : origins_, factors_ ? factors_ : origins_);
    kernel.set(first_trash_argument, static_cast<std::uint32_t>(layout_.segments + 2));
    kernel.set(all_free_argument, is_all_free() ? 1U : 0U);
    kernel.set(mode_argument, static_cast<std::uint32_t>(pass.mode));
    for (unsigned axis = 0; axis < 3; ++axis)
      kernel.set(step_x_argument + axis, float4(layout_.steps_mm[axis]));
    return stage;
  }

  /// Of the launches that take a stage each.
  void need_schedule() {
    if (entries_) return;
    schedule_ =
        schedule_of(layout_, lanes_in_slab / layout_.lanes, std::max(1U, device().info().compute_units));
    entries_ = buffer_of(device(), schedule_.entries);
    chunks_ = buffer_of(device(), schedule_.chunks);
  }

  bool marches(const Parameters& p) const {
    return march_ != nullptr && p.integrator != Integrator::implicit_euler;
  }

  LatticeMarch::Arrays march_arrays() const {
    LatticeMarch::Arrays arrays;
    arrays.states = {&y_, s2_ ? &s2_ : nullptr, s3_ ? &s3_ : nullptr, s4_ ? &s4_ : nullptr};
    arrays.waiting = &waiting_;
    arrays.rest = &rest_;
    arrays.rows = &rows_;
    arrays.overflow_begins = &overflow_begins_;
    arrays.overflow = &overflow_;
    arrays.factors = factors_ ? &factors_ : &origins_;
    return arrays;
  }

  /// For the iterations of implicit steps, whose loads are s4 and whose corrections s2 and s3.
  void march_implicitly(double step_s) {
    LatticeMarch::Arrays arrays = march_arrays();
    arrays.second = &s4_;
    arrays.third = &implicit_->largest();
    const Parameters& p = parameters_in_use_;
    march_->use(
        library_, defines(ImplicitLatticeStep::define_of(ImplicitLatticeStep::Pass::iterate)), arrays,
        {step_s * step_s * p.stiffness_per_s2, step_s * p.damping_per_s, step_s * p.drag_per_s, p.mass});
    march_->set_freedom(freedom_, is_all_free());
    iterate_ = [this, step_s](const auto& iterations, double rest_scale) {
      iterate(iterations, step_s, rest_scale);
    };
  }

  void iterate(const std::vector<std::array<float, 4>>& iterations, double step_s, double rest_scale) {
    const auto [times, plus] = layout_.scaled_rest(rest_scale);
    std::vector<LatticeMarch::NumberedPass> table;
    for (std::size_t n = 0; n < iterations.size(); ++n) {
      const bool goes = n % 2 == 0;
      table.push_back({{Mode::from_source, 1.0, 1.0, goes ? Stored::s2 : Stored::s3, Stored::y,
                        goes ? Stored::s3 : Stored::s2},
                       static_cast<float>(step_s),
                       times,
                       plus,
                       static_cast<float>(rest_scale),
                       iterations[n]});
    }
    march_->run(table, table.size());
  }

  void use_march(const Parameters& p) {
    if (!march_->is_in_place(p.integrator)) need_states(p.integrator);
    LatticeMarch::Arrays arrays = march_arrays();
    arrays.second = s2_ ? &s2_ : nullptr;
    arrays.third = s3_ ? &s3_ : nullptr;
    march_->use(library_, defines(), arrays, p, from_lps(p.gravity_mm_per_s2));
  }

  void need_states(Integrator integrator) {
    need(s2_);
    if (integrator == Integrator::rk4 || integrator == Integrator::implicit_euler) {
      need(s3_);
      need(s4_);
    }
  }

  void need(Buffer& buffer) const {
    if (!buffer) buffer = zeros(state_bytes());
  }

  Scheme make_scheme(Integrator integrator) {
    Scheme scheme;
    need_states(integrator);
    for (const Pass& pass : passes_of(integrator)) scheme.stages.push_back(stage_of(pass));
    if (ends_beside(integrator))
      for (const Pass& pass : back(passes_of(integrator))) scheme.back.push_back(stage_of(pass));
    if (integrator == Integrator::implicit_euler) add_implicit_passes(scheme);
    return scheme;
  }

  void add_implicit_passes(Scheme& scheme) {
    if (!implicit_)
      implicit_ = std::make_unique<ImplicitLatticeStep>(
          library_,
          ImplicitLatticeStep::Lattice{layout_.lanes, layout_.segments + 2,
                                       static_cast<double>(layout_.rest_quantum_mm),
                                       static_cast<double>(layout_.rest_offset_mm)},
          ImplicitLatticeStep::Arguments{h_argument, stiffness_argument, rest_scale_argument,
                                         rest_offset_argument, damping_argument, length_scale_argument,
                                         drag_argument, gravity_argument},
          implicit_spread(tissue(), material()));
    using ImplicitPass = ImplicitLatticeStep::Pass;
    for (std::size_t n = 0; n < ImplicitLatticeStep::pass_count; ++n) {
      const auto pass = static_cast<ImplicitPass>(n);
      const bool iterates = pass == ImplicitPass::iterate || pass == ImplicitPass::iterate_back;
      const Stored source = pass == ImplicitPass::iterate        ? Stored::s2
                            : pass == ImplicitPass::iterate_back ? Stored::s3
                                                                 : Stored::y;
      const Stored target = pass == ImplicitPass::iterate ? Stored::s3 : Stored::s2;
      Stage stage = stage_of({Mode::from_source, 1.0, 1.0, source, Stored::y, target},
                             ImplicitLatticeStep::define_of(pass));
      stage.kernel.set(second_argument, s4_);
      stage.kernel.set(third_argument, iterates ? implicit_->largest() : s3_);
      scheme.stages.push_back(std::move(stage));
    }
  }

  static ImplicitLatticeStep::Kernels kernels_of(Scheme& scheme) {
    ImplicitLatticeStep::Kernels kernels;
    for (Stage& stage : scheme.stages) kernels.push_back(&stage.kernel);
    return kernels;
  }

  Scheme& scheme_of(const Parameters& p) {
    const bool undamped = p.damping_per_s == 0.0;
    const auto key = std::pair(p.integrator, undamped);
    auto found = schemes_.find(key);
    if (found == schemes_.end()) {
      found = schemes_.emplace(key, make_scheme(p.integrator)).first;
    }
    return found->second;
  }

  template <typename Use>
  void for_stages(const Use& use) {
    for (auto& [unused, scheme] : schemes_)
      for (auto* list : {&scheme.stages, &scheme.back})
        for (Stage& stage : *list) use(stage);
  }

  /// Drivers finish the compiling of a kernel at its first launch; that wait
  /// belongs before the first step, not into the next picture. A step of no
  /// time changes nothing.
  void warm_up_steps() {
    const auto kind = std::pair(parameters_in_use_.integrator, is_undamped_);
    if (point_count() == 0 || !warm_.insert(kind).second) return;
    begin_steps(0.0);
    run_steps(ends_beside(parameters_in_use_.integrator) ? 2 : 1, 0.0, 0.0);
    end_steps();
    device().finish();
  }
  /// What use() does for the steps, for the rest.
  void warm_up() {
    warm_up_steps();
    if (point_count() == 0) return;
    health();
    link_health();
  }

  /// Nothing is held and there is no gravity.
  bool is_all_free() const { return all_free_ && parameters_in_use_.gravity_mm_per_s2.isZero(0.0); }

  void use_in(Scheme& scheme, const Parameters& p) {
    for (auto* list : {&scheme.stages, &scheme.back})
      for (Stage& stage : *list) {
        Kernel& kernel = stage.kernel;
        kernel.set(stiffness_argument, static_cast<float>(p.stiffness_per_s2));
        kernel.set(damping_argument, static_cast<float>(p.damping_per_s / 4.0));
        kernel.set(drag_argument, static_cast<float>(p.drag_per_s));
        kernel.set(gravity_argument, float4(from_lps(p.gravity_mm_per_s2)));
        kernel.set(over_mass_argument, static_cast<float>(1.0 / p.mass));
        kernel.set(all_free_argument, is_all_free() ? 1U : 0U);
        set_beat(stage, 1.0);
      }
  }

  void set_beat(Stage& stage, double scale) const {
    const auto [times, plus] = layout_.scaled_rest(0.5 * scale * parameters_in_use_.stiffness_per_s2);
    stage.kernel.set(rest_scale_argument, times);
    stage.kernel.set(rest_offset_argument, plus);
    stage.kernel.set(length_scale_argument, static_cast<float>(scale));
  }

  void launch(Stage& stage, std::size_t slab) {
    const auto& [first, count] = schedule_.slabs[slab];
    stage.kernel.set(first_chunk_argument, first);
    stage.kernel.set(chunk_count_argument, count);
    stage.kernel.run(count + 1, 1);  // one that does nothing: see the kernel
  }

  std::string reason_;
  compute::KernelLibrary library_;
  LatticeLayout layout_;
  LatticeSchedule schedule_;  ///< with entries_ and chunks_, where stages are launched one by one
  std::unique_ptr<LatticeMarch> march_;
  Buffer y_, s2_, s3_, s4_, snapshot_;
  Buffer rest_positions_;
  Buffer waiting_;
  Buffer rest_;
  Buffer rows_;
  Buffer origins_;
  Buffer entries_;
  Buffer chunks_;
  Buffer overflow_begins_;
  Buffer overflow_;
  Buffer freedom_;
  Buffer factors_;
  Buffer lane_of_point_;
  Buffer published_;
  Kernel publish_;
  Kernel grab_;
  std::unique_ptr<LatticeHealth> health_;
  std::map<std::pair<Integrator, bool>, Scheme> schemes_;  ///< with or without damping
  Scheme* scheme_ = nullptr;
  std::set<std::pair<Integrator, bool>> warm_;
  std::unique_ptr<ImplicitLatticeStep> implicit_;  ///< made when it is first asked for
  ImplicitLatticeStep::Iterate iterate_;           ///< where the march takes its iterations
  bool is_undamped_ = false;
  Parameters parameters_in_use_;
  bool is_beside_ = false;
  bool all_free_ = true;
};

}  // namespace

std::unique_ptr<Solver> make_lattice_solver(const compute::Device& device,
                                            std::shared_ptr<const model::Tissue> tissue,
                                            const Parameters& parameters, const OpenclOptions& options,
                                            const Material& material, const std::string& reason) {
  return std::make_unique<LatticeSolver>(device, std::move(tissue), parameters, options, material, reason);
}

}  // namespace palpate::simulation
