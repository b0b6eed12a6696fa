#pragma once

#include "palpate/core/volume.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/model/mask.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace palpate::model {

using Cell = std::array<int, 3>;

/// Where the points' lattice lies in the volume: site (a, b, c) is voxel
/// begin + stride * (a, b, c).
struct LatticeFrame {
  Cell begin{0, 0, 0};
  Cell size{0, 0, 0};
  int stride = 1;

  Cell voxel_of(const Cell& site) const noexcept {
    return {begin[0] + stride * site[0], begin[1] + stride * site[1], begin[2] + stride * site[2]};
  }
  Cell site_of(const Cell& voxel) const noexcept {
    return {(voxel[0] - begin[0]) / stride, (voxel[1] - begin[1]) / stride, (voxel[2] - begin[2]) / stride};
  }
};

/// The crop clipped to the volume. Throws Error(usage) where nothing is left.
CropBox clip(const std::optional<CropBox>& crop, const Cell& dims);
LatticeFrame frame_of(const CropBox& box, int stride);

/// Uniform in [-amplitude, amplitude] lattice spacings for each axis: a hash of
/// seed, voxel and axis, so that order, threads and crop do not matter.
class Jitter {
 public:
  Jitter(std::uint64_t seed, double amplitude) noexcept;
  std::array<float, 3> at(std::size_t voxel_index) const noexcept;
  double amplitude() const noexcept { return amplitude_; }

 private:
  std::uint64_t key_;
  double amplitude_;
};

/// Which sites hold a point, a bit each, and the number of points before every
/// 64 of them: finds the point at a site, or that there is none. Points are
/// numbered in voxel order. The lattice is padded on all sides, so that a
/// search may look `pad` sites beyond it without asking.
class Occupancy {
 public:
  Occupancy(const Cell& size, const Cell& pad);

  static constexpr std::uint32_t none = 0xFFFFFFFFU;

  std::size_t bit_of(const Cell& site) const noexcept {
    return ((static_cast<std::size_t>(site[2] + pad_[2]) * rows_ +
             static_cast<std::size_t>(site[1] + pad_[1])) *
            words_per_row_) *
               64 +
           static_cast<std::size_t>(site[0] + pad_[0]);
  }
  std::ptrdiff_t bit_step(const Cell& offset) const noexcept {
    return (static_cast<std::ptrdiff_t>(offset[2]) * static_cast<std::ptrdiff_t>(rows_) + offset[1]) *
               static_cast<std::ptrdiff_t>(words_per_row_) * 64 +
           offset[0];
  }
  std::uint32_t point_at(std::size_t bit) const noexcept {
    const std::uint64_t word = bits_[bit >> 6U];
    const std::uint64_t mask = std::uint64_t{1} << (bit & 63U);
    if ((word & mask) == 0) return none;
    return before_[bit >> 6U] + static_cast<std::uint32_t>(ones_in(word & (mask - 1)));
  }

  /// Only one thread may set the sites of one row (b, c).
  void set(const Cell& site) noexcept {
    const std::size_t bit = bit_of(site);
    bits_[bit >> 6U] |= std::uint64_t{1} << (bit & 63U);
  }
  /// After the last set(). Throws Error(usage) where there are too many points to number.
  void number_points();
  std::size_t count() const noexcept { return count_; }
  Cell site_of(std::uint32_t point) const noexcept;

  /// f(site, point) for the points of row (b, c), in order.
  template <typename F>
  void for_row(int b, int c, const F& f) const {
    const std::size_t first = bit_of({-pad_[0], b, c}) >> 6U;
    for (std::size_t word = first; word < first + words_per_row_; ++word) {
      std::uint32_t point = before_[word];
      for (std::uint64_t left = bits_[word]; left != 0; left &= left - 1) {
        const int a = static_cast<int>((word - first) * 64) + ones_in((left & (~left + 1)) - 1) - pad_[0];
        f(Cell{a, b, c}, point++);
      }
    }
  }
  const Cell& size() const noexcept { return size_; }

 private:
  static int ones_in(std::uint64_t x) noexcept {
    // Not std::bitset: without a population count instruction that is a call.
    x -= (x >> 1U) & 0x5555555555555555ULL;
    x = (x & 0x3333333333333333ULL) + ((x >> 2U) & 0x3333333333333333ULL);
    x = (x + (x >> 4U)) & 0x0F0F0F0F0F0F0F0FULL;
    return static_cast<int>((x * 0x0101010101010101ULL) >> 56U);
  }

  Cell size_;
  Cell pad_;
  std::size_t words_per_row_;  ///< rows start at a word, so that threads share none
  std::size_t rows_;
  std::size_t count_ = 0;
  std::vector<std::uint64_t> bits_;
  std::vector<std::uint32_t> before_;
};

/// What is tissue: finite and within [low, high].
struct IntensityWindow {
  double low = 0.0;
  double high = 0.0;
  bool holds(float value) const noexcept;
};

/// Which voxels are tissue: those of the window, within the mask where there is one.
struct TissueRule {
  IntensityWindow window;
  std::optional<MaskLookup> mask;
};

/// Marks and numbers the tissue of the lattice.
Occupancy occupy(const core::Volume& volume, const LatticeFrame& frame, const TissueRule& rule,
                 const Cell& pad, unsigned threads, const core::Progress& progress);

/// otsu_threshold() that can be stopped.
double otsu(const core::Volume& volume, const CropBox& box, unsigned threads, const core::Progress& progress);

}  // namespace palpate::model
