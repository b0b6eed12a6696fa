#include "tuning.hpp"

#include "explicit_solver.hpp"
#include "lattice_solver.hpp"

#include "palpate/compute/kernel_library.hpp"
#include "palpate/compute/tuning_store.hpp"
#include "palpate/core/checksum.hpp"
#include "palpate/core/error.hpp"
#include "palpate/model/generate.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <utility>
#include <vector>

namespace palpate::simulation {

namespace {

constexpr std::array<unsigned, 4> all_widths{1, 4, 8, 16};
// A multiple of every width, so that no width is blamed for rows that end inside a segment.
constexpr int side = 32;
constexpr double step_s = 0.001;
constexpr int rounds = 7;
constexpr double batch_s = 0.01;

/// Those next to the device's vectors: others have never won, and building a
/// trial takes far longer than running it.
std::vector<unsigned> candidates(const compute::DeviceInfo& device) {
  if (device.type == compute::DeviceType::gpu) return {1, 4};
  const unsigned width = std::clamp(device.float_vector_width, 1U, 16U);
  std::vector<unsigned> chosen;
  for (const unsigned candidate : all_widths)
    if (candidate == width || 2 * candidate == width) chosen.push_back(candidate);
  return chosen;
}

std::shared_ptr<const model::Tissue> small_model() {
  const core::ImageGeometry geometry({side, side, side}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  const core::Volume volume(geometry, std::vector<float>(geometry.voxel_count(), 1.0F));
  model::TissueParameters parameters;
  parameters.threshold_low = 0.5;
  return std::make_shared<const model::Tissue>(model::generate(volume, parameters));
}

struct Trial {
  unsigned points_per_item = 0;
  std::unique_ptr<Solver> solver;
  double best_s = std::numeric_limits<double>::infinity();  ///< a step
};

double timed_s(Solver& solver, int count) {
  const auto start = std::chrono::steady_clock::now();
  solver.step(count, step_s);
  solver.health();  // waits
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// 0 where no trial runs.
unsigned measured(const compute::DeviceInfo& device, const MakeTrial& make) {
  const auto tissue = small_model();
  std::vector<Trial> trials;
  for (const unsigned candidate : candidates(device)) {
    try {
      Trial trial{candidate, make(tissue, candidate)};
      timed_s(*trial.solver, 1);
      trials.push_back(std::move(trial));
    } catch (const core::Error& error) {
      if (error.code() != "kernel-build") throw;
      continue;  // a width that this driver cannot build is none to choose
    }
  }
  if (trials.empty()) return 0;
  // In turns, so that what else the machine does meets all alike.
  const int count =
      std::clamp(static_cast<int>(batch_s / std::max(timed_s(*trials.front().solver, 1), 1e-6)), 1, 200);
  for (int round = 0; round < rounds; ++round)
    for (auto& trial : trials) trial.best_s = std::min(trial.best_s, timed_s(*trial.solver, count) / count);
  return std::min_element(trials.begin(), trials.end(),
                          [](const Trial& a, const Trial& b) { return a.best_s < b.best_s; })
      ->points_per_item;
}

unsigned number_of(const std::string& text) {
  for (const unsigned width : all_widths)
    if (text == std::to_string(width)) return width;
  return 0;
}

}  // namespace

unsigned tuned_points_per_item(const compute::Device& device, const std::string& key, const MakeTrial& make) {
  const auto store = compute::TuningStore::of_environment();
  if (!store) return 0;
  if (const auto known = store->find(device.info(), key)) return number_of(*known);
  // Nothing is chosen by the clock that the next run might choose otherwise.
  if (!store->settle(device.info(), "can be written", "yes")) return 0;
  const unsigned best = measured(device.info(), make);
  const auto settled = store->settle(device.info(), key, std::to_string(best));
  return settled ? number_of(*settled) : 0;
}

OpenclOptions tuned(const compute::Device& device, const OpenclOptions& options, LayoutChoice layout) {
  if (options.points_per_item != 0) return options;
  const bool lattice = layout == LayoutChoice::lattice;
  const bool marches = device.info().type == compute::DeviceType::cpu && !options.launches_every_stage;
  const std::string file = !lattice ? "explicit.cl" : marches ? "lattice_march.cl" : "lattice.cl";
  // Other kernels may have another best width.
  const std::string key = "points per work-item of " + file + " " +
                          core::sha256_of(compute::KernelLibrary::source(file)).substr(0, 16);
  OpenclOptions chosen = options;
  chosen.points_per_item =
      tuned_points_per_item(device, key, [&](std::shared_ptr<const model::Tissue> tissue, unsigned width) {
        OpenclOptions trial;
        trial.points_per_item = width;
        trial.launches_every_stage = options.launches_every_stage;
        return lattice ? make_lattice_solver(device, std::move(tissue), Parameters{}, trial, Material{})
                       : make_explicit_solver(device, std::move(tissue), Parameters{}, trial, Material{});
      });
  return chosen;
}

}  // namespace palpate::simulation
