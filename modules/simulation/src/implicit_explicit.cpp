#include "implicit_explicit.hpp"

#include "device_solver.hpp"

#include <cstdint>

namespace palpate::simulation {

namespace {

constexpr std::size_t group = 32;  // as the layout's own kernels
// Where the arguments that the kernels share begin.
constexpr unsigned load_common = 5;
constexpr unsigned iterate_common = 5;
constexpr unsigned rest_scale_place = 4;
constexpr unsigned common_count = 8;
constexpr std::uint32_t parts = 256;  // of the search for the largest bound

}  // namespace

ImplicitExplicitStep::ImplicitExplicitStep(compute::KernelLibrary& library, ExplicitArrays& arrays,
                                           const std::vector<std::string>& defines,
                                           const ImplicitSpread& spread)
    : arrays_(arrays),
      spread_(spread),
      partial_(compute::Buffer::allocate(library.device(), parts * sizeof(float))),
      largest_(compute::Buffer::allocate(library.device(), sizeof(float))) {
  const auto share = [&](compute::Kernel& kernel, unsigned first) {
    kernel.set(first, arrays.partners);
    kernel.set(first + 1, arrays.rest_lengths);
    kernel.set(first + 2, arrays.freedom);
    kernel.set(first + 3, static_cast<std::uint32_t>(arrays.stride));
  };
  const compute::Buffer& load = arrays.s3.x;
  const compute::Buffer* const corrections[2] = {&arrays.s2.x, &arrays.s2.v};
  load_ = library.build("implicit_explicit.cl", "implicit_load", defines);
  load_.set_all(arrays.y.x, arrays.y.v, load, *corrections[0], *corrections[1]);
  share(load_, load_common);
  for (int n = 0; n < 2; ++n) {
    iterate_[n] = library.build("implicit_explicit.cl", "implicit_iterate", defines);
    iterate_[n].set_all(arrays.y.x, load, largest_, *corrections[n], *corrections[1 - n]);
    share(iterate_[n], iterate_common);
  }
  const auto count = static_cast<std::uint32_t>(arrays.stride);
  largest_of_parts_ = library.build("implicit_explicit.cl", "implicit_largest", defines);
  largest_of_parts_.set_all(load, partial_, count, std::uint32_t{4}, std::uint32_t{3}, parts);
  largest_of_all_ = library.build("implicit_explicit.cl", "implicit_largest", defines);
  largest_of_all_.set_all(partial_, largest_, parts, std::uint32_t{1}, std::uint32_t{0}, std::uint32_t{1});
  advance_ = library.build("implicit_explicit.cl", "implicit_advance", defines);
  advance_.set_all(arrays.y.x, arrays.y.v, *corrections[0], arrays.freedom, count);
}

void ImplicitExplicitStep::begin_steps(double step_s) {
  plan_ = implicit_plan(spread_, parameters_, step_s);
  const double per_mass = 1.0 / parameters_.mass;
  const auto share = [&](compute::Kernel& kernel, unsigned first) {
    kernel.set(first + rest_scale_place, 1.0F);
    kernel.set(first + 5, static_cast<float>(step_s * step_s * parameters_.stiffness_per_s2 * per_mass));
    kernel.set(first + 6, static_cast<float>(step_s * parameters_.damping_per_s * per_mass));
    kernel.set(first + 7, static_cast<float>(step_s * parameters_.drag_per_s * per_mass));
  };
  share(load_, load_common);
  load_.set(load_common + common_count, float4(parameters_.gravity_mm_per_s2));
  load_.set(load_common + common_count + 1, static_cast<float>(step_s));
  for (auto& iterate : iterate_) share(iterate, iterate_common);
  advance_.set(2, plan_.iterations.size() % 2 == 1 ? arrays_.s2.x : arrays_.s2.v);
  advance_.set(5, static_cast<float>(step_s));
}

void ImplicitExplicitStep::run_step(double step_s, double time_s) {
  if (parameters_.beat_amplitude != 0.0) {
    const auto rest_scale = static_cast<float>(rest_scale_at(parameters_, time_s + step_s));
    load_.set(load_common + rest_scale_place, rest_scale);
    for (auto& iterate : iterate_) iterate.set(iterate_common + rest_scale_place, rest_scale);
  }
  const std::size_t items = arrays_.stride / arrays_.points_per_item;
  load_.run(items, group);
  largest_of_parts_.run(parts, 1);
  largest_of_all_.run(1, 1);
  for (std::size_t n = 1; n < plan_.iterations.size(); ++n) {
    compute::Kernel& iterate = iterate_[(n + 1) % 2];
    iterate.set(iterate_common + common_count, static_cast<float>(plan_.iterations[n].momentum));
    iterate.set(iterate_common + common_count + 1, static_cast<float>(plan_.iterations[n].rate));
    const auto first_rate = static_cast<float>(plan_.iterations[0].rate);
    iterate.set(iterate_common + common_count + 2, n == 1 ? first_rate : 0.0F);
    iterate.set(iterate_common + common_count + 3, n == 2 ? first_rate : 0.0F);
    iterate.run(items, group);
  }
  advance_.run(arrays_.stride);
}

}  // namespace palpate::simulation
