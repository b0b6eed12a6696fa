#include "palpate/imaging/speckle.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace palpate::imaging {
namespace {

/// Sums for a mean and a variance, about a value near the mean.
class Moments {
 public:
  explicit Moments(double about = 0.0) : about_(about) {}
  void add(double value) {
    ++count_;
    sum_ += value - about_;
    squares_ += (value - about_) * (value - about_);
  }
  double count() const { return count_; }
  double mean() const { return count_ > 0.0 ? about_ + sum_ / count_ : 0.0; }
  double variance() const {
    return count_ > 1.0 ? std::max(0.0, (squares_ - sum_ * sum_ / count_) / (count_ - 1.0)) : 0.0;
  }

 private:
  double about_, count_ = 0.0, sum_ = 0.0, squares_ = 0.0;
};

/// The threshold of 256 that separates two classes best (Otsu 1979).
double otsu(const core::Volume& volume, const core::Progress& progress) {
  constexpr int bins = 256;
  const double low = volume.range().min;
  const double width = (static_cast<double>(volume.range().max) - low) / bins;
  if (!(width > 0.0)) return low;
  std::array<double, bins> counts{};
  const auto slice = volume.size() / static_cast<std::size_t>(volume.dims()[2]);
  for (std::size_t n = 0; n < volume.size(); ++n) {
    if (n % slice == 0)
      progress.report(static_cast<double>(n) / static_cast<double>(volume.size()), "Speckle");
    ++counts[static_cast<std::size_t>(
        std::clamp(static_cast<int>((volume.data()[n] - low) / width), 0, bins - 1))];
  }
  double total = 0.0;
  for (int bin = 0; bin < bins; ++bin) total += bin * counts[static_cast<std::size_t>(bin)];
  const auto all = static_cast<double>(volume.size());
  double below = 0.0;
  double sum_below = 0.0;
  double best = -1.0;
  int best_bin = 0;
  for (int bin = 0; bin + 1 < bins; ++bin) {
    below += counts[static_cast<std::size_t>(bin)];
    sum_below += bin * counts[static_cast<std::size_t>(bin)];
    if (below <= 0.0 || below >= all) continue;
    const double between = sum_below / below - (total - sum_below) / (all - below);
    const double score = below * (all - below) * between * between;
    if (score > best) {
      best = score;
      best_bin = bin;
    }
  }
  return low + (best_bin + 1) * width;
}

using Place = std::array<int, 3>;

Place block_size(const Place& dims) {
  const auto axes = std::count_if(dims.begin(), dims.end(), [](int count) { return count > 1; });
  const int side = axes == 3 ? 8 : axes == 2 ? 16 : 64;
  Place size{};
  for (std::size_t axis = 0; axis < 3; ++axis) size[axis] = std::min(dims[axis], side);
  return size;
}

/// Calls visit(value, place in the block) for each voxel of a block.
template <typename Visit>
void visit_block(const core::Volume& volume, const Place& first, const Place& size, Visit visit) {
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j) {
      const float* const row = volume.data() + volume.geometry().index(first[0], first[1] + j, first[2] + k);
      for (int i = 0; i < size[0]; ++i) visit(static_cast<double>(row[i]), Place{i, j, k});
    }
}

struct Block {
  Place first;
  double unevenness;
  double clipped;  ///< share at the scan's smallest or largest value
};

/// How much of the variance lies between the means of the halves, quarters or eighths.
double unevenness(const core::Volume& volume, const Place& first, const Place& size, double about) {
  Moments whole(about);
  std::array<Moments, 8> parts;
  parts.fill(Moments(about));
  visit_block(volume, first, size, [&](double value, const Place& at) {
    std::size_t part = 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (2 * at[axis] >= size[axis] && size[axis] > 1) part |= std::size_t{1} << axis;
    whole.add(value);
    parts[part].add(value);
  });
  if (!(whole.variance() > 0.0)) return -1.0;  // nothing to measure
  Moments means(whole.mean());
  for (const Moments& part : parts)
    if (part.count() > 0.0) means.add(part.mean());
  return means.variance() / whole.variance();
}

struct Choice {
  Place size{};
  double threshold = 0.0;
  double zero = 0.0;  ///< brightness counts from here
  int tissue_blocks = 0;
  std::vector<Block> blocks;
};

std::vector<Block> tissue_blocks(const core::Volume& volume, const Choice& choice,
                                 const core::Progress& progress) {
  std::vector<Block> found;
  const auto& dims = volume.dims();
  const double least = choice.zero + 0.5 * (choice.threshold - choice.zero);
  for (int k = 0; k + choice.size[2] <= dims[2]; k += choice.size[2]) {
    progress.report(static_cast<double>(k) / dims[2], "Speckle");
    for (int j = 0; j + choice.size[1] <= dims[1]; j += choice.size[1])
      for (int i = 0; i + choice.size[0] <= dims[0]; i += choice.size[0]) {
        const Place first{i, j, k};
        Moments moments;
        double clipped = 0.0;
        visit_block(volume, first, choice.size, [&](double value, const Place&) {
          moments.add(value);
          if (value <= volume.range().min || value >= volume.range().max) ++clipped;
        });
        if (moments.mean() < least) continue;
        const double uneven = unevenness(volume, first, choice.size, moments.mean());
        if (uneven >= 0.0) found.push_back({first, uneven, clipped / moments.count()});
      }
  }
  return found;
}

Choice choose(const core::Volume& volume, const core::Progress& progress) {
  Choice choice;
  choice.size = block_size(volume.dims());
  choice.threshold = otsu(volume, progress.part(0.0, 0.4));
  choice.zero = std::min(0.0, static_cast<double>(volume.range().min));
  auto blocks = tissue_blocks(volume, choice, progress.part(0.4, 1.0));
  constexpr double most_clipped = 0.02;
  const auto whole = std::stable_partition(blocks.begin(), blocks.end(),
                                           [](const Block& block) { return block.clipped <= most_clipped; });
  if (whole != blocks.begin()) blocks.erase(whole, blocks.end());
  choice.tissue_blocks = static_cast<int>(blocks.size());
  std::stable_sort(blocks.begin(), blocks.end(),
                   [](const Block& a, const Block& b) { return a.unevenness < b.unevenness; });
  blocks.resize((blocks.size() + 3) / 4);
  choice.blocks = std::move(blocks);
  return choice;
}

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

void measure_blocks(const core::Volume& volume, const Choice& choice, SpeckleStatistics& found) {
  std::vector<double> means;
  std::vector<double> deviations;
  for (const Block& block : choice.blocks) {
    Moments rough;
    visit_block(volume, block.first, choice.size, [&](double value, const Place&) { rough.add(value); });
    Moments moments(rough.mean());
    visit_block(volume, block.first, choice.size, [&](double value, const Place&) { moments.add(value); });
    means.push_back(moments.mean() - choice.zero);
    deviations.push_back(std::sqrt(moments.variance()));
  }
  found.mean = median_of(std::move(means));
  found.deviation = median_of(std::move(deviations));
  if (found.deviation > 0.0) found.snr = found.mean / found.deviation;
  found.looks = found.snr * found.snr;
}

void measure_classes(const core::Volume& volume, const core::Volume& original, const Choice& choice,
                     SpeckleStatistics& found, const core::Progress& progress) {
  Moments bright(choice.threshold);
  Moments dark(choice.threshold);
  const auto slice = volume.size() / static_cast<std::size_t>(volume.dims()[2]);
  for (std::size_t n = 0; n < volume.size(); ++n) {
    if (n % slice == 0)
      progress.report(static_cast<double>(n) / static_cast<double>(volume.size()), "Speckle");
    const bool is_bright = static_cast<double>(original.data()[n]) >= choice.threshold;
    (is_bright ? bright : dark).add(volume.data()[n]);
  }
  if (bright.count() == 0.0 || dark.count() == 0.0) return;
  found.bright = bright.mean() - choice.zero;
  found.dark = dark.mean() - choice.zero;
  const double between = found.bright - found.dark;
  if (found.bright + found.dark > 0.0) found.contrast = between / (found.bright + found.dark);
  const double within = std::sqrt(bright.variance() + dark.variance());
  if (within > 0.0) found.cnr = between / within;
}

}  // namespace

SpeckleStatistics measure_speckle(const core::Volume& filtered, const core::Volume& original,
                                  const core::Progress& progress) {
  if (filtered.empty() || filtered.dims() != original.dims())
    throw core::Error(core::ErrorKind::internal, "sizes-differ",
                      "Speckle was to be compared in two volumes of different size.");
  const Choice choice = choose(original, progress.part(0.0, 0.7));
  SpeckleStatistics found;
  found.block_voxels = choice.size;
  found.tissue_blocks = choice.tissue_blocks;
  found.blocks = static_cast<int>(choice.blocks.size());
  found.threshold = choice.threshold;
  measure_blocks(filtered, choice, found);
  measure_classes(filtered, original, choice, found, progress.part(0.7, 1.0));
  progress.report(1.0, "Speckle");
  return found;
}

SpeckleStatistics measure_speckle(const core::Volume& volume, const core::Progress& progress) {
  return measure_speckle(volume, volume, progress);
}

}  // namespace palpate::imaging
