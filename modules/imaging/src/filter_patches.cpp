#include "filter_registry.hpp"
#include "parallel_parts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

// Patch-based denoising by non-local means (Buades, Coll, Morel, CVPR 2005):
// a voxel becomes the average of those around it whose surroundings look alike.
// Not ITK's PatchBasedDenoisingImageFilter: it draws its patches at random, so
// no slice of it can be had alone, takes minutes for a small scan, and cannot
// be stopped within a step.

namespace palpate::imaging {
namespace {

using Reach = std::array<int, 3>;

Reach flat_aware(const core::ImageGeometry& geometry, double radius) {
  Reach reach{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    reach[axis] = geometry.dims()[axis] == 1 ? 0 : static_cast<int>(radius);
  return reach;
}

/// What is not explained by the mean of the six neighbours, scaled so that
/// white noise keeps its standard deviation (pseudo-residuals, Gasser 1986).
double residual(const core::Volume& volume, int i, int j, int k, bool& counts) {
  const auto& dims = volume.dims();
  const float centre = volume.at(i, j, k);
  double sum = 0.0;
  int count = 0;
  bool flat = true;
  const std::array<int, 3> place{i, j, k};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (dims[axis] == 1) continue;
    for (const int step : {-1, 1}) {
      auto next = place;
      next[axis] += step;
      if (next[axis] < 0 || next[axis] >= dims[axis]) next[axis] -= 2 * step;
      const float value = volume.at(next[0], next[1], next[2]);
      flat = flat && value == centre;
      sum += value;
      ++count;
    }
  }
  counts = count > 0 && !flat && sum / count >= volume.range().mean;
  if (!counts) return 0.0;
  return (centre - sum / count) / std::sqrt(1.0 + 1.0 / count);
}

/// Standard deviation of the noise where the scan is brighter than on average,
/// from the middle of all residuals, so that edges count little. Shadows and the
/// black around a scan vary less than tissue does, and would outnumber it.
std::vector<double> measure_noise(const core::Volume& volume, const FilterParameters&,
                                  const core::Progress& progress) {
  constexpr std::size_t enough_voxels = std::size_t{1} << 20;
  const auto& dims = volume.dims();
  const int rows = dims[1] * dims[2];
  const int stride = static_cast<int>(volume.size() / enough_voxels) + 1;
  std::vector<double> found;
  for (int row = 0; row < rows; row += stride) {
    if (row % 1024 < stride) progress.report(static_cast<double>(row) / rows, "Measuring noise");
    for (int i = 0; i < dims[0]; ++i) {
      bool counts = false;
      const double value = residual(volume, i, row % dims[1], row / dims[1], counts);
      if (counts) found.push_back(std::abs(value));
    }
  }
  if (found.empty()) return {0.0};
  const auto middle = found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2);
  std::nth_element(found.begin(), middle, found.end());
  constexpr double median_of_normal = 0.6745;
  return {*middle / median_of_normal};
}

struct Plan {
  Reach search;
  Reach patch;
  float noise;   ///< expected squared difference of two patches that show the same
  float widest;  ///< what may come on top of it before a patch counts nothing
};

/// A block of rows of the volume: (j, k) from `first`, `rows` of each, all along i.
struct Tile {
  std::array<int, 2> first, rows;
};

/// Works through one tile, with the places that it looks at copied together.
class TileDenoiser {
 public:
  TileDenoiser(const core::Volume& volume, const Plan& plan, const Tile& tile)
      : volume_(volume), plan_(plan), tile_(tile), size_{volume.dims()[0], tile.rows[0], tile.rows[1]} {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      margin_[axis] = plan.search[axis] + plan.patch[axis];
      padded_[axis] = size_[axis] + 2 * margin_[axis];
      wide_[axis] = size_[axis] + 2 * plan.patch[axis];
    }
    copy();
  }

  void run(float* voxels, const core::CancelToken& cancel) {
    const std::size_t count = product(size_);
    sum_.assign(count, 0.0);
    weights_.assign(count, 1.0);
    for (int k = 0; k < size_[2]; ++k)
      for (int j = 0; j < size_[1]; ++j) {
        const float* const centre = place(margin_[0], margin_[1] + j, margin_[2] + k);
        std::copy_n(centre, size_[0], sum_.data() + index(size_, 0, j, k));
      }
    for (int dk = -plan_.search[2]; dk <= plan_.search[2]; ++dk)
      for (int dj = -plan_.search[1]; dj <= plan_.search[1]; ++dj) {
        if (cancel.cancelled()) return;
        for (int di = -plan_.search[0]; di <= plan_.search[0]; ++di)
          if (di != 0 || dj != 0 || dk != 0) add({di, dj, dk});
      }
    for (int k = 0; k < size_[2]; ++k)
      for (int j = 0; j < size_[1]; ++j) {
        float* const out = voxels + volume_.geometry().index(0, tile_.first[0] + j, tile_.first[1] + k);
        const std::size_t row = index(size_, 0, j, k);
        for (std::size_t i = 0; i < static_cast<std::size_t>(size_[0]); ++i)
          out[i] = static_cast<float>(sum_[row + i] / weights_[row + i]);
      }
  }

 private:
  static std::size_t product(const Reach& size) {
    return static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
           static_cast<std::size_t>(size[2]);
  }
  static std::size_t index(const Reach& size, int i, int j, int k) {
    return static_cast<std::size_t>(i) +
           static_cast<std::size_t>(size[0]) *
               (static_cast<std::size_t>(j) +
                static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(k));
  }
  const float* place(int i, int j, int k) const { return copied_.data() + index(padded_, i, j, k); }

  void copy() {
    const auto& dims = volume_.dims();
    copied_.resize(product(padded_));
    for (int k = 0; k < padded_[2]; ++k)
      for (int j = 0; j < padded_[1]; ++j) {
        const float* const row =
            volume_.data() +
            volume_.geometry().index(0, std::clamp(tile_.first[0] + j - margin_[1], 0, dims[1] - 1),
                                     std::clamp(tile_.first[1] + k - margin_[2], 0, dims[2] - 1));
        float* const out = copied_.data() + index(padded_, 0, j, k);
        for (int i = 0; i < padded_[0]; ++i) out[i] = row[std::clamp(i - margin_[0], 0, dims[0] - 1)];
      }
  }

  /// Sums `from` over 2r+1 places along `axis`; what comes out is 2r shorter there.
  static void sum_along(std::size_t axis, int radius, const std::vector<float>& from, const Reach& size,
                        std::vector<float>& to, Reach& shorter) {
    shorter = size;
    shorter[axis] -= 2 * radius;
    to.resize(product(shorter));
    const std::size_t stride = index(size, axis == 0 ? 1 : 0, axis == 1 ? 1 : 0, axis == 2 ? 1 : 0);
    for (int k = 0; k < shorter[2]; ++k)
      for (int j = 0; j < shorter[1]; ++j) {
        const float* const in = from.data() + index(size, 0, j, k);
        float* const out = to.data() + index(shorter, 0, j, k);
        const auto width = static_cast<std::size_t>(shorter[0]);
        std::copy_n(in, width, out);
        for (std::size_t n = 1; n <= 2 * static_cast<std::size_t>(radius); ++n)
          for (std::size_t i = 0; i < width; ++i) out[i] += in[i + n * stride];
      }
  }

  /// What the voxels at this offset add to those of the tile.
  void add(const Reach& offset) {
    squares_.resize(product(wide_));
    for (int k = 0; k < wide_[2]; ++k)
      for (int j = 0; j < wide_[1]; ++j) {
        const float* const here = place(plan_.search[0], plan_.search[1] + j, plan_.search[2] + k);
        const float* const there = place(plan_.search[0] + offset[0], plan_.search[1] + j + offset[1],
                                         plan_.search[2] + k + offset[2]);
        float* const out = squares_.data() + index(wide_, 0, j, k);
        for (int i = 0; i < wide_[0]; ++i) out[i] = (here[i] - there[i]) * (here[i] - there[i]);
      }
    Reach first{};
    Reach second{};
    Reach third{};
    sum_along(0, plan_.patch[0], squares_, wide_, along_i_, first);
    sum_along(1, plan_.patch[1], along_i_, first, along_j_, second);
    sum_along(2, plan_.patch[2], along_j_, second, along_k_, third);
    const float count = (2.0F * static_cast<float>(plan_.patch[0]) + 1.0F) *
                        (2.0F * static_cast<float>(plan_.patch[1]) + 1.0F) *
                        (2.0F * static_cast<float>(plan_.patch[2]) + 1.0F);
    const float scale = 1.0F / (count * plan_.widest);
    const float shift = plan_.noise / plan_.widest;
    for (int k = 0; k < size_[2]; ++k)
      for (int j = 0; j < size_[1]; ++j) {
        const std::size_t row = index(size_, 0, j, k);
        const float* const there =
            place(margin_[0] + offset[0], margin_[1] + j + offset[1], margin_[2] + k + offset[2]);
        for (std::size_t i = 0; i < static_cast<std::size_t>(size_[0]); ++i) {
          const float beyond = std::max(0.0F, along_k_[row + i] * scale - shift);
          const float left = std::max(0.0F, 1.0F - beyond);
          const float weight = left * left;
          sum_[row + i] += static_cast<double>(weight) * static_cast<double>(there[i]);
          weights_[row + i] += static_cast<double>(weight);
        }
      }
  }

  const core::Volume& volume_;
  const Plan& plan_;
  Tile tile_;
  Reach size_;
  Reach margin_{}, padded_{}, wide_{};
  std::vector<float> copied_, squares_, along_i_, along_j_, along_k_;
  std::vector<double> sum_, weights_;  // so that an average of equals is exactly that
};

core::Volume denoise(const FilterCall& call) {
  const auto& geometry = call.volume.geometry();
  const double sigma = call.measured.front();
  if (!(sigma > 0.0)) return call.volume;  // nothing varies from voxel to voxel
  const double strength = call.parameter("strength");
  Plan plan{flat_aware(geometry, call.parameter("radius_voxels")),
            flat_aware(geometry, call.parameter("patch_voxels")), static_cast<float>(2.0 * sigma * sigma),
            static_cast<float>(4.0 * strength * strength * sigma * sigma)};
  // Some 8 000 voxels: they stay in the cache, and one tile takes well under a second.
  const auto& dims = geometry.dims();
  const int rows = std::max(1, 8192 / dims[0]);
  const int deep = dims[2] == 1 ? 1 : std::min(4, rows);
  const std::array<int, 2> size{std::max(1, rows / deep), deep};
  const std::array<int, 2> tiles{(dims[1] + size[0] - 1) / size[0], (dims[2] + size[1] - 1) / size[1]};
  std::vector<float> voxels(call.volume.size());
  for_each_part(tiles[0] * tiles[1], call.progress, "Patch denoising", [&](int n) {
    Tile tile{{(n % tiles[0]) * size[0], (n / tiles[0]) * size[1]}, size};
    tile.rows[0] = std::min(size[0], dims[1] - tile.first[0]);
    tile.rows[1] = std::min(size[1], dims[2] - tile.first[1]);
    TileDenoiser(call.volume, plan, tile).run(voxels.data(), call.progress.cancel());
  });
  return {geometry, std::move(voxels)};
}

Reach patch_reach(const core::ImageGeometry& geometry, const FilterParameters& parameters) {
  return flat_aware(geometry, parameters.at("radius_voxels") + parameters.at("patch_voxels"));
}

}  // namespace

FilterEntry patch_denoise_entry() {
  return {{"patch-denoise",
           "Patch denoising",
           "Averages voxels whose surroundings look alike: removes noise, keeps structure; slow.",
           {{"radius_voxels", "How far to look for the like", 3.0, 1.0, 6.0, true, "voxels"},
            {"patch_voxels", "Radius of the surroundings", 1.0, 1.0, 3.0, true, "voxels"},
            {"strength", "Strength (1: for the noise found)", 1.0, 0.1, 10.0, false, ""}}},
          denoise,
          patch_reach,
          measure_noise,
          5.0};
}

}  // namespace palpate::imaging
