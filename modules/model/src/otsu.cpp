#include "lattice.hpp"
#include "parallel.hpp"

#include <cmath>
#include <limits>
#include <mutex>

namespace palpate::model {
namespace {

constexpr std::size_t bin_count = 256;

/// f(first value, count) for the rows of a box, from several threads.
template <typename F>
void for_rows(const core::Volume& volume, const CropBox& box, unsigned threads,
              const core::Progress& progress, const F& chunk_of_rows) {
  const auto rows = static_cast<std::size_t>(box.end[1] - box.begin[1]);
  const auto slices = static_cast<std::size_t>(box.end[2] - box.begin[2]);
  parallel_for(rows * slices, 1024, threads, progress, "Finding the threshold",
               [&](std::size_t begin, std::size_t end) {
                 chunk_of_rows([&](const auto& use) {
                   for (std::size_t row = begin; row < end; ++row) {
                     const int j = box.begin[1] + static_cast<int>(row % rows);
                     const int k = box.begin[2] + static_cast<int>(row / rows);
                     const float* value = volume.data() + volume.geometry().index(box.begin[0], j, k);
                     for (int i = box.begin[0]; i < box.end[0]; ++i, ++value)
                       if (std::isfinite(*value)) use(static_cast<double>(*value));
                   }
                 });
               });
}

/// The number of bins in the lower class where the between-class variance is
/// largest; the middle where it is so over a gap without voxels.
double best_split(const std::array<std::size_t, bin_count>& histogram) {
  double total = 0.0;
  double total_moment = 0.0;
  for (std::size_t bin = 0; bin < bin_count; ++bin) {
    total += static_cast<double>(histogram[bin]);
    total_moment += static_cast<double>(histogram[bin]) * static_cast<double>(bin);
  }
  double below = 0.0;
  double below_moment = 0.0;
  double best = -1.0;
  std::size_t first = 1;
  std::size_t last = 1;
  for (std::size_t bin = 0; bin + 1 < bin_count; ++bin) {
    below += static_cast<double>(histogram[bin]);
    below_moment += static_cast<double>(histogram[bin]) * static_cast<double>(bin);
    const double above = total - below;
    if (below == 0.0 || above == 0.0) continue;
    const double apart = below_moment / below - (total_moment - below_moment) / above;
    const double variance = below * above * apart * apart;
    if (variance > best) {
      best = variance;
      first = last = bin + 1;
    } else if (variance == best && histogram[bin] == 0) {
      last = bin + 1;
    }
  }
  return 0.5 * static_cast<double>(first + last);
}

}  // namespace

double otsu(const core::Volume& volume, const CropBox& box, unsigned threads,
            const core::Progress& progress) {
  std::mutex mutex;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for_rows(volume, box, threads, progress.part(0.0, 0.5), [&](const auto& visit) {
    double chunk_low = std::numeric_limits<double>::infinity();
    double chunk_high = -chunk_low;
    visit([&](double value) {
      chunk_low = std::min(chunk_low, value);
      chunk_high = std::max(chunk_high, value);
    });
    const std::lock_guard<std::mutex> lock(mutex);
    low = std::min(low, chunk_low);
    high = std::max(high, chunk_high);
  });
  if (!(low <= high)) return 0.0;  // no finite voxel: generate() then finds no tissue
  if (low == high) return low;

  std::array<std::size_t, bin_count> histogram{};
  const double bins_per_unit = static_cast<double>(bin_count) / (high - low);
  for_rows(volume, box, threads, progress.part(0.5, 1.0), [&](const auto& visit) {
    std::array<std::size_t, bin_count> part{};
    visit([&](double value) {
      ++part[std::min(bin_count - 1, static_cast<std::size_t>((value - low) * bins_per_unit))];
    });
    const std::lock_guard<std::mutex> lock(mutex);
    for (std::size_t bin = 0; bin < bin_count; ++bin) histogram[bin] += part[bin];
  });
  return low + best_split(histogram) * (high - low) / static_cast<double>(bin_count);
}

double otsu_threshold(const core::Volume& volume, const std::optional<CropBox>& crop) {
  if (volume.empty()) core::throw_usage("There is no volume to take a threshold of; open a scan first.");
  return otsu(volume, clip(crop, volume.dims()), core_count(), core::Progress());
}

}  // namespace palpate::model
