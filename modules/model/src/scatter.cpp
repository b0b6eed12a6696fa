#include "scatter.hpp"

#include "hash.hpp"
#include "nearest.hpp"
#include "parallel.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

namespace palpate::model {
namespace {

/// Distances in units of the edge of a point's share of the volume. No more
/// than sqrt(2)^(1/3) = 1.12 can be kept by all; darts alone reach 0.90.
constexpr double first_distance = 1.1;
constexpr double shrinking = 0.97;  ///< a round; each throws a dart into each cell

double unit_number(std::uint64_t hash) noexcept { return static_cast<double>(hash >> 11U) * 0x1p-53; }

/// A point in the voxels of the frame, counted from the corner of the first
/// voxel's cell: floor() is its voxel.
using Place = std::array<double, 3>;

/// A board of cells, each as large as a point's share, and the darts in them.
class Board {
 public:
  Board(const core::ImageGeometry& geometry, const Occupancy& tissue, int stride, std::uint64_t seed,
        const core::CancelToken& cancel)
      : tissue_(tissue), metric_(geometry, 1), key_(mixed(seed + golden)), cells_({1, 1, 1}, {0, 0, 0}) {
    Eigen::Matrix3d axes;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
      axes.col(axis) = metric_.place(unit[0], unit[1], unit[2]);
    }
    edge_ = stride * std::cbrt(std::abs(axes.determinant()));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      width_[axis] = edge_ / metric_.unit()[axis];
      size_[axis] = static_cast<int>(tissue.size()[axis] / width_[axis]) + 1;
    }
    mark_cells(cancel);
    heads_.assign(cells_.count(), Occupancy::none);
    fresh_.resize(cells_.count());
    is_fresh_.assign(cells_.count(), 0);
  }

  std::size_t size() const noexcept { return places_.size(); }
  const std::vector<Place>& places() const noexcept { return places_; }

  /// A dart for each cell; keeps those that are `distance` edges from all
  /// others, and of them only as many as are still wanted.
  void throw_round(int round, double distance, std::size_t wanted, unsigned threads,
                   const core::Progress& progress) {
    const double least = distance * edge_;
    Cell apart{};  // rows so far apart do not see each other's darts
    Place reach{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      reach[axis] = least / (metric_.unit()[axis] * metric_.least_stretch());
      apart[axis] = std::min(size_[axis], static_cast<int>(reach[axis] / width_[axis]) + 2);
    }
    std::vector<std::uint32_t> phases(static_cast<std::size_t>(apart[1]) *
                                      static_cast<std::size_t>(apart[2]));
    std::iota(phases.begin(), phases.end(), 0U);
    const auto rank = [&](std::uint32_t phase) {
      return mixed(key_ ^ mixed((static_cast<std::uint64_t>(round) << 32U | phase) * golden));
    };
    std::sort(phases.begin(), phases.end(),
              [&](std::uint32_t a, std::uint32_t b) { return rank(a) < rank(b); });
    for (const std::uint32_t phase : phases) {
      const Cell first{0, static_cast<int>(phase) % apart[1], static_cast<int>(phase) / apart[1]};
      throw_phase(round, least * least, reach, first, apart, threads, progress);
    }
    take_in(round, wanted);
  }

 private:
  void mark_cells(const core::CancelToken& cancel) {
    cells_ = Occupancy(size_, {0, 0, 0});
    const auto cell_at = [&](std::size_t axis, double place) {
      return std::min(size_[axis] - 1, static_cast<int>(place / width_[axis]));
    };
    for (int k = 0; k < tissue_.size()[2]; ++k) {
      cancel.check();
      for (int j = 0; j < tissue_.size()[1]; ++j)
        tissue_.for_row(j, k, [&](const Cell& voxel, std::uint32_t) {
          Cell low{};
          Cell high{};
          for (std::size_t axis = 0; axis < 3; ++axis) {
            low[axis] = cell_at(axis, voxel[axis]);
            high[axis] = cell_at(axis, voxel[axis] + 1.0);
          }
          for (int c = low[2]; c <= high[2]; ++c)
            for (int b = low[1]; b <= high[1]; ++b)
              for (int a = low[0]; a <= high[0]; ++a) cells_.set({a, b, c});
        });
    }
    cells_.number_points();
  }

  /// The rows of cells that are `first` and whole steps of `apart` from it.
  void throw_phase(int round, double least_squared, const Place& reach, const Cell& first, const Cell& apart,
                   unsigned threads, const core::Progress& progress) {
    const auto rows = static_cast<std::size_t>((size_[1] - first[1] - 1) / apart[1] + 1);
    const auto slices = static_cast<std::size_t>((size_[2] - first[2] - 1) / apart[2] + 1);
    parallel_for(rows * slices, 64, threads, core::Progress({}, progress.cancel()), "Spreading points",
                 [&](std::size_t begin, std::size_t end) {
                   for (std::size_t row = begin; row < end; ++row)
                     cells_.for_row(first[1] + apart[1] * static_cast<int>(row % rows),
                                    first[2] + apart[2] * static_cast<int>(row / rows),
                                    [&](const Cell& cell, std::uint32_t number) {
                                      throw_dart(round, least_squared, reach, cell, number);
                                    });
                 });
  }

  void throw_dart(int round, double least_squared, const Place& reach, const Cell& cell,
                  std::uint32_t number) {
    Place dart{};
    Cell voxel{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      dart[axis] = (cell[axis] + unit_number(hash_of(round, number, axis))) * width_[axis];
      voxel[axis] = static_cast<int>(dart[axis]);
      if (voxel[axis] >= tissue_.size()[axis]) return;
    }
    if (tissue_.point_at(tissue_.bit_of(voxel)) == Occupancy::none) return;
    if (is_near_another(dart, number, least_squared)) return;  // mostly told by its own cell
    Cell low{};
    Cell high{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::max(0, static_cast<int>(std::floor((dart[axis] - reach[axis]) / width_[axis])));
      high[axis] = std::min(size_[axis] - 1, static_cast<int>((dart[axis] + reach[axis]) / width_[axis]));
    }
    for (int c = low[2]; c <= high[2]; ++c)
      for (int b = low[1]; b <= high[1]; ++b)
        for (int a = low[0]; a <= high[0]; ++a) {
          const std::uint32_t other = cells_.point_at(cells_.bit_of({a, b, c}));
          if (other != Occupancy::none && is_near_another(dart, other, least_squared)) return;
        }
    fresh_[number] = dart;
    is_fresh_[number] = 1;
  }

  bool is_near_another(const Place& dart, std::uint32_t cell, double least_squared) const noexcept {
    const auto near = [&](const Place& other) {
      return metric_.squared(other[0] - dart[0], other[1] - dart[1], other[2] - dart[2]) < least_squared;
    };
    if (is_fresh_[cell] != 0 && near(fresh_[cell])) return true;
    for (std::uint32_t point = heads_[cell]; point != Occupancy::none; point = next_[point])
      if (near(places_[point])) return true;
    return false;
  }

  std::uint64_t hash_of(int round, std::uint32_t number, std::size_t what) const noexcept {
    const std::uint64_t counter =
        (static_cast<std::uint64_t>(round) << 34U) + (static_cast<std::uint64_t>(number) << 2U) + what;
    return mixed(key_ ^ mixed((counter + 1) * golden));
  }

  /// Takes the round's darts in, by the order of their cells.
  void take_in(int round, std::size_t wanted) {
    std::vector<std::uint32_t> taken;
    for (std::uint32_t cell = 0; cell < is_fresh_.size(); ++cell)
      if (is_fresh_[cell] != 0) taken.push_back(cell);
    std::fill(is_fresh_.begin(), is_fresh_.end(), std::uint8_t{0});
    const std::size_t room = wanted - places_.size();
    if (taken.size() > room) {
      // Those that stay are any of them, not the first, so that the last round
      // is as even as the others.
      const auto by_hash = [&](std::uint32_t a, std::uint32_t b) {
        return hash_of(round, a, 3) < hash_of(round, b, 3);
      };
      std::nth_element(taken.begin(), taken.begin() + static_cast<std::ptrdiff_t>(room), taken.end(),
                       by_hash);
      taken.resize(room);
      std::sort(taken.begin(), taken.end());
    }
    for (const std::uint32_t cell : taken) {
      next_.push_back(heads_[cell]);
      heads_[cell] = static_cast<std::uint32_t>(places_.size());
      places_.push_back(fresh_[cell]);
    }
  }

  const Occupancy& tissue_;
  Metric metric_;
  std::uint64_t key_;
  double edge_ = 1.0;
  Place width_{1.0, 1.0, 1.0};  ///< of a cell, in voxels
  Cell size_{1, 1, 1};
  Occupancy cells_;  ///< those that tissue reaches into
  std::vector<std::uint32_t> heads_;
  std::vector<std::uint32_t> next_;
  std::vector<Place> places_;
  std::vector<Place> fresh_;  ///< of this round, one a cell
  std::vector<std::uint8_t> is_fresh_;
};

}  // namespace

std::size_t scattered_count(std::size_t voxels, int stride) {
  const double share = static_cast<double>(stride) * stride * stride;
  return voxels == 0 ? 0
                     : std::max<std::size_t>(
                           1, static_cast<std::size_t>(std::llround(static_cast<double>(voxels) / share)));
}

double scattered_spacing_mm(const core::ImageGeometry& geometry, int stride) {
  return stride * std::cbrt(std::abs(geometry.ijk_to_lps_mm().topLeftCorner<3, 3>().determinant()));
}

PointCloud scatter(const core::Volume& volume, const LatticeFrame& frame, const Occupancy& tissue, int stride,
                   std::uint64_t seed, unsigned threads, const core::Progress& progress) {
  const core::ImageGeometry& geometry = volume.geometry();
  const std::size_t wanted = scattered_count(tissue.count(), stride);
  Board board(geometry, tissue, stride, seed, progress.cancel());
  double distance = first_distance;
  for (int round = 0; board.size() < wanted; ++round, distance *= shrinking) {
    progress.report(0.95 * static_cast<double>(board.size()) / static_cast<double>(wanted),
                    "Spreading points");
    board.throw_round(round, distance, wanted, threads, progress);
  }

  const auto voxel_of = [&](const Place& place) {
    return frame.voxel_of(
        {static_cast<int>(place[0]), static_cast<int>(place[1]), static_cast<int>(place[2])});
  };
  std::vector<std::pair<std::size_t, std::uint32_t>> order(wanted);
  for (std::uint32_t point = 0; point < wanted; ++point) {
    const Cell voxel = voxel_of(board.places()[point]);
    order[point] = {geometry.index(voxel[0], voxel[1], voxel[2]), point};
  }
  std::sort(order.begin(), order.end());
  progress.cancel().check();

  PointCloud points;
  points.center_mm = geometry.center_mm();
  points.positions_mm.reserve(wanted);
  points.voxels.reserve(wanted);
  points.intensities.reserve(wanted);
  const Eigen::Matrix3d axes = geometry.ijk_to_lps_mm().topLeftCorner<3, 3>();
  const Eigen::Vector3d middle =
      0.5 * Eigen::Vector3d(geometry.dims()[0] - 1, geometry.dims()[1] - 1, geometry.dims()[2] - 1);
  const Eigen::Vector3d corner(frame.begin[0] - 0.5, frame.begin[1] - 0.5, frame.begin[2] - 0.5);
  for (const auto& [index, point] : order) {
    const Place& place = board.places()[point];
    const Eigen::Vector3d ijk = corner + Eigen::Vector3d(place[0], place[1], place[2]);
    points.positions_mm.emplace_back((axes * (ijk - middle)).cast<float>());
    points.voxels.push_back(voxel_of(place));
    points.intensities.push_back(volume.data()[index]);
  }
  progress.report(1.0, "Spreading points");
  return points;
}

}  // namespace palpate::model
