#include "lattice_march.hpp"

#include <algorithm>
#include <cstring>

namespace palpate::simulation {

namespace {

// Numbers of kernels/lattice_march.cl.
constexpr std::size_t counters_apart = 16;

// A chunk is worth taking from some microseconds on.
constexpr std::size_t lanes_in_slab = 800;

enum Argument : unsigned {
  states_argument,
  second_argument = 4,
  third_argument,
  waiting_argument,
  rest_argument,
  rows_argument,
  entries_argument,
  chunks_argument,
  overflow_begins_argument,
  overflow_argument,
  freedom_argument,
  factors_argument,
  progress_argument,
  passes_argument,
  slab_count_argument,
  band_count_argument,
  queues_argument,
  pass_count_argument,
  first_pass_argument,
  period_argument,
  first_trash_argument,
  all_free_argument,
  stiffness_argument,
  damping_argument,
  drag_argument,
  over_mass_argument,
  step_x_argument
};

std::size_t units_of(const compute::Device& device) { return std::max(1U, device.info().compute_units); }

float as_float(std::uint32_t bits) {
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

}  // namespace

LatticeMarch::LatticeMarch(const compute::Device& device, const LatticeLayout& layout)
    : layout_(layout),
      device_(device),
      schedule_(march_schedule_of(layout, std::max<std::size_t>(1, lanes_in_slab / layout.lanes),
                                  units_of(device))),
      queues_(static_cast<std::uint32_t>(schedule_.turns_at_once)) {
  entries_ = buffer_of(device, schedule_.entries);
  chunks_ = buffer_of(device, schedule_.chunks);
  schedule_.entries = {};
  schedule_.chunks = {};
  progress_ = compute::Buffer::allocate(
      device, (1 + queues_ + schedule_.bands * schedule_.slabs) * counters_apart * sizeof(std::uint32_t));
  progress_.fill_zero();
}

// More groups than cores: PoCL gives a core more than one of them at a time.
std::uint32_t LatticeMarch::trash_segments(const compute::Device& device) {
  return static_cast<std::uint32_t>(2 * units_of(device));
}

std::size_t LatticeMarch::bytes() const noexcept {
  return entries_.bytes() + chunks_.bytes() + progress_.bytes() + passes_.bytes();
}

void LatticeMarch::use(compute::KernelLibrary& library, const std::vector<std::string>& defines,
                       const Arrays& arrays, const Numbers& numbers) {
  auto found = kernels_.find(defines);
  if (found == kernels_.end())
    found = kernels_.emplace(defines, library.build("lattice_march.cl", "march", defines)).first;
  compute::Kernel& kernel = found->second;
  for (unsigned n = 0; n < arrays.states.size(); ++n)
    kernel.set(states_argument + n, arrays.states[n] != nullptr ? *arrays.states[n] : *arrays.states[0]);
  kernel.set(second_argument, arrays.second != nullptr ? *arrays.second : *arrays.states[0]);
  kernel.set(third_argument, arrays.third != nullptr ? *arrays.third : *arrays.states[0]);
  kernel.set(waiting_argument, *arrays.waiting);
  kernel.set(rest_argument, *arrays.rest);
  kernel.set(rows_argument, *arrays.rows);
  kernel.set(entries_argument, entries_);
  kernel.set(chunks_argument, chunks_);
  kernel.set(overflow_begins_argument, *arrays.overflow_begins);
  kernel.set(overflow_argument, *arrays.overflow);
  kernel.set(factors_argument, *arrays.factors);
  kernel.set(progress_argument, progress_);
  kernel.set(slab_count_argument, static_cast<std::uint32_t>(schedule_.slabs));
  kernel.set(band_count_argument, static_cast<std::uint32_t>(schedule_.bands));
  kernel.set(queues_argument, queues_);
  kernel.set(first_trash_argument, static_cast<std::uint32_t>(layout_.segments + 2));
  kernel.set(stiffness_argument, static_cast<float>(numbers.stiffness));
  kernel.set(damping_argument, static_cast<float>(numbers.damping));
  kernel.set(drag_argument, static_cast<float>(numbers.drag));
  kernel.set(over_mass_argument, static_cast<float>(1.0 / numbers.mass));
  for (unsigned axis = 0; axis < 3; ++axis)
    kernel.set(step_x_argument + axis, float4(layout_.steps_mm[axis]));
  kernel_ = &kernel;
}

void LatticeMarch::use(compute::KernelLibrary& library, const std::vector<std::string>& defines,
                       const Arrays& arrays, const Parameters& p, const Eigen::Vector3d& gravity_mm_per_s2) {
  use(library, defines, arrays, Numbers{p.stiffness_per_s2, p.damping_per_s / 4.0, p.drag_per_s, p.mass});
  parameters_ = p;
  gravity_ = float4(gravity_mm_per_s2);
}

void LatticeMarch::set_freedom(const compute::Buffer& freedom, bool all_free) {
  if (kernel_ == nullptr) return;
  kernel_->set(freedom_argument, freedom);
  kernel_->set(all_free_argument, all_free ? 1U : 0U);
}

bool LatticeMarch::is_in_place(Integrator integrator) const noexcept {
  // A band beside looks at places once more, and links of the overflow do so from both ends.
  return ends_beside(integrator) && schedule_.bands <= 1 && layout_.overflow.empty();
}

int LatticeMarch::most_steps() const {
  return most_passes / static_cast<int>(passes_of(parameters_.integrator).size());
}

bool LatticeMarch::run(int count, double step_s, double time_s, bool is_beside) {
  const Parameters& p = parameters_;
  std::vector<Pass> forward = passes_of(p.integrator);
  const bool alternates = ends_beside(p.integrator) && !is_in_place(p.integrator);
  if (is_in_place(p.integrator)) forward.front().target = forward.front().source;
  const bool beats = p.beat_amplitude != 0.0;
  const int steps = beats ? count : alternates ? 2 : 1;
  // Without a beat the table is the same for every launch, and need not be written.
  const auto turns = [&](int step) { return alternates && (beats && is_beside) != (step % 2 == 1); };
  std::vector<NumberedPass> table;
  for (int step = 0; step < steps; ++step)
    for (const Pass& pass : turns(step) ? back(forward) : forward) {
      const double scale = rest_scale_at(p, beats ? time_s + (step + pass.at) * step_s : 0.0);
      const auto [times, plus] = layout_.scaled_rest(0.5 * scale * p.stiffness_per_s2);
      table.push_back(
          {pass, static_cast<float>(pass.h * step_s), times, plus, static_cast<float>(scale), gravity_});
    }
  run(table, static_cast<std::size_t>(count) * forward.size(), !beats && is_beside ? forward.size() : 0);
  return is_beside != (alternates && count % 2 == 1);
}

void LatticeMarch::run(const std::vector<NumberedPass>& table, std::size_t count, std::size_t first) {
  if (count == 0) return;
  write(table);
  kernel_->set(passes_argument, passes_);
  kernel_->set(pass_count_argument, static_cast<std::uint32_t>(count));
  kernel_->set(first_pass_argument, static_cast<std::uint32_t>(first));
  kernel_->set(period_argument, static_cast<std::uint32_t>(table.size()));
  kernel_->run(trash_segments(device_), 1);
}

void LatticeMarch::write(const std::vector<NumberedPass>& table) {
  std::vector<Float4> numbers;
  for (const NumberedPass& each : table) {
    const auto& [mode, h, at, source, base, target] = each.pass;
    numbers.push_back(
        {as_float(static_cast<std::uint32_t>(source)), as_float(static_cast<std::uint32_t>(base)),
         as_float(static_cast<std::uint32_t>(target)), as_float(static_cast<std::uint32_t>(mode))});
    numbers.push_back({each.h, each.rest_scale, each.rest_offset, each.length_scale});
    numbers.push_back(each.gravity);
  }
  const std::size_t bytes = numbers.size() * sizeof(Float4);
  if (numbers.size() == passes_written_.size() &&
      std::memcmp(numbers.data(), passes_written_.data(), bytes) == 0)
    return;
  if (passes_.bytes() < bytes) {
    device_.finish();  // what is queued still reads the old one
    passes_ = buffer_of(device_, numbers);
  } else {
    passes_.write(numbers.data(), bytes);  // in its turn
  }
  passes_written_ = std::move(numbers);
}

}  // namespace palpate::simulation
