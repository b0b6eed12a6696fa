#include "lattice.hpp"

#include "hash.hpp"
#include "parallel.hpp"

#include "palpate/core/error.hpp"

#include <cmath>

namespace palpate::model {

CropBox clip(const std::optional<CropBox>& crop, const Cell& dims) {
  CropBox box{{0, 0, 0}, dims};
  if (!crop) return box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.begin[axis] = std::max(0, crop->begin[axis]);
    box.end[axis] = std::min(dims[axis], crop->end[axis]);
    if (box.begin[axis] >= box.end[axis])
      core::throw_usage("The crop " + std::to_string(crop->begin[axis]) + ":" +
                        std::to_string(crop->end[axis]) + " along axis " + "ijk"[axis] +
                        " holds no voxel; the volume has 0:" + std::to_string(dims[axis]) + " there.");
  }
  return box;
}

LatticeFrame frame_of(const CropBox& box, int stride) {
  LatticeFrame frame;
  frame.begin = box.begin;
  frame.stride = stride;
  for (std::size_t axis = 0; axis < 3; ++axis)
    frame.size[axis] = (box.end[axis] - box.begin[axis] - 1) / stride + 1;
  return frame;
}

Jitter::Jitter(std::uint64_t seed, double amplitude) noexcept
    : key_(mixed(seed + golden)), amplitude_(amplitude) {}

std::array<float, 3> Jitter::at(std::size_t voxel_index) const noexcept {
  std::array<float, 3> offset{0.0F, 0.0F, 0.0F};
  if (amplitude_ == 0.0) return offset;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::uint64_t hash = mixed(key_ ^ mixed((voxel_index * 3 + axis + 1) * golden));
    // 24 bits m: (2 m + 1) / 2^24 - 1 lies in (-1, 1), symmetric about 0.
    const double unit = static_cast<double>(2 * (hash >> 40U) + 1) / 16777216.0 - 1.0;
    float value = static_cast<float>(amplitude_ * unit);
    if (std::abs(static_cast<double>(value)) > amplitude_) value = std::nextafter(value, 0.0F);
    offset[axis] = value;
  }
  return offset;
}

Occupancy::Occupancy(const Cell& size, const Cell& pad)
    : size_(size),
      pad_(pad),
      words_per_row_(static_cast<std::size_t>(size[0] + 2 * pad[0] + 63) / 64),
      rows_(static_cast<std::size_t>(size[1] + 2 * pad[1])) {
  const std::size_t words = words_per_row_ * rows_ * static_cast<std::size_t>(size[2] + 2 * pad[2]);
  bits_.assign(words, 0);
  before_.assign(words, 0);
}

void Occupancy::number_points() {
  std::size_t total = 0;
  for (std::size_t word = 0; word < bits_.size(); ++word) {
    before_[word] = static_cast<std::uint32_t>(total);
    total += static_cast<std::size_t>(ones_in(bits_[word]));
    if (total >= none)
      core::throw_usage(
          "More than four thousand million points are too many; raise the threshold, crop, or use a stride.");
  }
  count_ = total;
}

Cell Occupancy::site_of(std::uint32_t point) const noexcept {
  const auto word =
      static_cast<std::size_t>(std::upper_bound(before_.begin(), before_.end(), point) - before_.begin()) - 1;
  std::uint64_t left = bits_[word];
  for (std::uint32_t skip = point - before_[word]; skip > 0; --skip) left &= left - 1;
  const std::size_t row = word / words_per_row_;
  return {static_cast<int>(word % words_per_row_ * 64) + ones_in((left & (~left + 1)) - 1) - pad_[0],
          static_cast<int>(row % rows_) - pad_[1], static_cast<int>(row / rows_) - pad_[2]};
}

bool IntensityWindow::holds(float value) const noexcept {
  const auto wide = static_cast<double>(value);
  return wide >= low && wide <= high && std::isfinite(value);
}

Occupancy occupy(const core::Volume& volume, const LatticeFrame& frame, const TissueRule& rule,
                 const Cell& pad, unsigned threads, const core::Progress& progress) {
  Occupancy occupancy(frame.size, pad);
  const auto rows = static_cast<std::size_t>(frame.size[1]);
  parallel_for(rows * static_cast<std::size_t>(frame.size[2]), 1024, threads, progress, "Choosing voxels",
               [&](std::size_t begin, std::size_t end) {
                 for (std::size_t row = begin; row < end; ++row) {
                   Cell site{0, static_cast<int>(row % rows), static_cast<int>(row / rows)};
                   const Cell voxel = frame.voxel_of(site);
                   const float* value = volume.data() + volume.geometry().index(voxel[0], voxel[1], voxel[2]);
                   for (; site[0] < frame.size[0]; ++site[0], value += frame.stride)
                     if (rule.window.holds(*value) && (!rule.mask || rule.mask->holds(frame.voxel_of(site))))
                       occupancy.set(site);
                 }
               });
  occupancy.number_points();
  return occupancy;
}

}  // namespace palpate::model
