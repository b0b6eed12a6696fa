#include "filter_steps.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <fstream>
#include <limits>
#include <new>
#include <sstream>
#include <string>
#include <utility>

namespace palpate::imaging {
namespace {

std::vector<PreparedStep> prepare_all(const core::Volume& volume, const std::vector<FilterStep>& chain) {
  std::vector<PreparedStep> steps;
  steps.reserve(chain.size());
  for (const FilterStep& step : chain) steps.push_back(prepare(step));
  if (volume.empty())
    throw core::Error(core::ErrorKind::internal, "no-volume",
                      "A filter was asked for before a volume was read.");
  // A width that this scan cannot take is refused before the first step runs.
  for (const PreparedStep& step : steps) step.entry->reach(volume.geometry(), step.parameters);
  return steps;
}

/// What may still be taken without driving the machine into its swap; the
/// kernel promises more than there is and ends the program when it is used.
double available_bytes() {
  std::ifstream file("/proc/meminfo");
  std::string key;
  double kilobytes = 0.0;
  std::string rest;
  while (file >> key >> kilobytes) {
    if (key == "MemAvailable:") return kilobytes * 1024.0;
    std::getline(file, rest);
  }
  return std::numeric_limits<double>::infinity();
}

[[noreturn]] void throw_memory(const FilterDescription& filter, double needed_bytes) {
  std::ostringstream text;
  text.precision(3);
  text << "The filter " << filter.name << " needs " << needed_bytes / 1e9
       << " GB of memory for this scan, more than is free. Crop the scan or close other programs.";
  throw core::Error(core::ErrorKind::internal, "out-of-memory", text.str());
}

core::Volume run_step(const PreparedStep& step, const core::Volume& volume,
                      const std::vector<double>& measured, const FilterOptions& options,
                      std::vector<core::Warning>& warnings, const core::Progress& progress) {
  const double needed = step.entry->bytes_per_voxel * static_cast<double>(volume.size());
  if (needed > available_bytes()) throw_memory(step.entry->description, needed);
  std::vector<core::Warning> found;
  core::Volume result;
  try {
    result = step.entry->apply({volume, step.parameters, options, measured, found, progress});
  } catch (const std::bad_alloc&) {
    throw_memory(step.entry->description, needed);
  }
  for (core::Warning& warning : found) {
    const bool known = std::any_of(warnings.begin(), warnings.end(), [&](const auto& other) {
      return other.code == warning.code && other.text == warning.text;
    });
    if (!known) warnings.push_back(std::move(warning));
  }
  return result;
}

std::vector<double> measure(const PreparedStep& step, const core::Volume& volume,
                            const core::Progress& progress) {
  if (!step.entry->measure) return {};
  try {
    return step.entry->measure(volume, step.parameters, progress);
  } catch (const std::bad_alloc&) {
    throw_memory(step.entry->description, step.entry->bytes_per_voxel * static_cast<double>(volume.size()));
  }
}

/// Slices [begin, end) across `axis`, in a volume of their own at the same place.
core::Volume cut(const core::Volume& volume, std::size_t axis, int begin, int end) {
  const auto& whole = volume.geometry();
  if (begin == 0 && end == whole.dims()[axis]) return volume;
  std::array<int, 3> first{0, 0, 0};
  std::array<int, 3> dims = whole.dims();
  first[axis] = begin;
  dims[axis] = end - begin;
  const core::ImageGeometry geometry(
      dims, whole.spacing_mm(), whole.to_lps_mm(Eigen::Vector3i(first[0], first[1], first[2]).cast<double>()),
      whole.direction());
  std::vector<float> voxels;
  voxels.reserve(geometry.voxel_count());
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j) {
      const float* const row = volume.data() + whole.index(first[0], first[1] + j, first[2] + k);
      voxels.insert(voxels.end(), row, row + dims[0]);
    }
  return {geometry, std::move(voxels)};
}

core::Progress part_of(const core::Progress& progress, std::size_t n, std::size_t count) {
  const auto total = static_cast<double>(count);
  return progress.part(static_cast<double>(n) / total, static_cast<double>(n + 1) / total);
}

}  // namespace

FilteredVolume apply_filters(const core::Volume& volume, const std::vector<FilterStep>& chain,
                             const FilterOptions& options, const core::Progress& progress) {
  const auto steps = prepare_all(volume, chain);
  FilteredVolume result{volume, {}};
  for (std::size_t n = 0; n < steps.size(); ++n) {
    const auto part = part_of(progress, n, steps.size());
    const auto measured = measure(steps[n], result.volume, part.part(0.0, 0.02));
    result.volume = run_step(steps[n], result.volume, measured, options, result.warnings,
                             part.part(steps[n].entry->measure ? 0.02 : 0.0, 1.0));
  }
  return result;
}

core::Volume filter_slice(const core::Volume& volume, const std::vector<FilterStep>& chain, int axis,
                          int index, const FilterOptions& options, const core::Progress& progress) {
  const auto steps = prepare_all(volume, chain);
  if (axis < 0 || axis > 2 || index < 0 || index >= volume.dims()[static_cast<std::size_t>(axis)])
    throw core::Error(core::ErrorKind::internal, "no-slice",
                      "There is no slice " + std::to_string(index) + " across axis " + std::to_string(axis) +
                          " in this scan.");
  const auto across = static_cast<std::size_t>(axis);
  const int count = volume.dims()[across];
  // How far each step's input must reach so that the steps after it are right.
  std::vector<int> halo(steps.size() + 1, 0);
  for (std::size_t n = steps.size(); n > 0; --n)
    halo[n - 1] = std::min(
        count, halo[n] + steps[n - 1].entry->reach(volume.geometry(), steps[n - 1].parameters)[across]);

  int begin = std::max(0, index - halo.front());
  core::Volume slab = cut(volume, across, begin, std::min(count, index + halo.front() + 1));
  std::vector<core::Warning> warnings;
  for (std::size_t n = 0; n < steps.size(); ++n) {
    const auto part = part_of(progress, n, steps.size());
    const auto measured = measure(steps[n], n == 0 ? volume : slab, part.part(0.0, 0.1));
    slab = run_step(steps[n], slab, measured, options, warnings, part.part(0.1, 1.0));
    const int next = std::max(0, index - halo[n + 1]);
    const int end = std::min(count, index + halo[n + 1] + 1);
    slab = cut(slab, across, next - begin, end - begin);
    begin = next;
  }
  return slab;
}

}  // namespace palpate::imaging
