#include "links.hpp"

#include "parallel.hpp"

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <numeric>

namespace palpate::model {
namespace {

constexpr std::size_t chunk = 4096;
constexpr const char* what = "Linking points";

/// The n nearest of every point: n places each, unused ones are `none`.
class NeighbourLists {
 public:
  // Not a vector: the threads that fill the pages should also be the first to touch them.
  NeighbourLists(std::size_t count, std::size_t n) : n_(n), lists_(new std::uint32_t[count * n]) {}

  void store(std::size_t point, const NearestList& list) noexcept {
    std::uint32_t* to = lists_.get() + point * n_;
    for (std::size_t place = 0; place < n_; ++place)
      to[place] = place < list.size() ? list.point(place) : Occupancy::none;
  }
  const std::uint32_t* begin(std::size_t point) const noexcept { return lists_.get() + point * n_; }
  const std::uint32_t* end(std::size_t point) const noexcept { return begin(point) + n_; }
  bool holds(std::size_t point, std::uint32_t other) const noexcept {
    return std::find(begin(point), end(point), other) != end(point);
  }

 private:
  std::size_t n_;
  std::unique_ptr<std::uint32_t[]> lists_;
};

/// The graph of `partners(point, found)`, which gives the partners above
/// `point` in rising order and returns how many. It is asked twice: once to
/// count, once to fill, so that the links need no second copy.
template <typename Partners>
LinkGraph collect(const PointCloud& points, unsigned threads, const core::Progress& progress,
                  const Partners& partners) {
  using Found = std::array<std::uint32_t, NearestList::most>;
  const std::size_t count = points.size();
  std::vector<std::size_t> first((count + chunk - 1) / chunk + 1, 0);
  parallel_for(count, chunk, threads, progress.part(0.0, 0.5), what, [&](std::size_t begin, std::size_t end) {
    Found found;
    std::size_t sum = 0;
    for (std::size_t point = begin; point < end; ++point) sum += partners(point, found);
    first[begin / chunk + 1] = sum;
  });
  std::partial_sum(first.begin(), first.end(), first.begin());

  LinkGraph graph;
  graph.pairs.resize(first.back());
  graph.rest_lengths_mm.resize(first.back());
  parallel_for(count, chunk, threads, progress.part(0.5, 1.0), what, [&](std::size_t begin, std::size_t end) {
    Found found;
    std::size_t link = first[begin / chunk];
    for (std::size_t point = begin; point < end; ++point) {
      const std::size_t partner_count = partners(point, found);
      const Eigen::Vector3d here = points.positions_mm[point].template cast<double>();
      for (std::size_t n = 0; n < partner_count; ++n, ++link) {
        graph.pairs[link] = {static_cast<std::uint32_t>(point), found[n]};
        graph.rest_lengths_mm[link] =
            static_cast<float>((points.positions_mm[found[n]].template cast<double>() - here).norm());
      }
    }
  });
  return graph;
}

LinkGraph collect_mutual(const PointCloud& points, const NeighbourLists& lists, unsigned threads,
                         const core::Progress& progress) {
  return collect(points, threads, progress, [&](std::size_t point, auto& found) {
    std::size_t count = 0;
    for (const std::uint32_t* other = lists.begin(point); other != lists.end(point); ++other)
      if (*other != Occupancy::none && *other > point &&
          lists.holds(*other, static_cast<std::uint32_t>(point)))
        found[count++] = *other;
    std::sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  });
}

}  // namespace

std::vector<Cell> half_stencil(LinkRule rule) {
  const int most_axes = rule == LinkRule::six         ? 1
                        : rule == LinkRule::lattice18 ? 2
                        : rule == LinkRule::lattice26 ? 3
                                                      : 0;
  std::vector<Cell> steps;
  for (int c = 0; c <= 1; ++c)
    for (int b = -1; b <= 1; ++b)
      for (int a = -1; a <= 1; ++a) {
        const bool later = c > 0 || b > 0 || (b == 0 && a > 0);
        if (later && std::abs(a) + std::abs(b) + c <= most_axes) steps.push_back({a, b, c});
      }
  return steps;
}

LinkGraph link_neighbours(const LatticePoints& lattice, const std::vector<Cell>& half_stencil,
                          unsigned threads, const core::Progress& progress) {
  std::vector<std::ptrdiff_t> steps;
  for (const Cell& step : half_stencil) steps.push_back(lattice.occupancy.bit_step(step));
  return collect(lattice.points, threads, progress, [&](std::size_t point, auto& found) {
    const std::size_t bit = lattice.occupancy.bit_of(lattice.frame.site_of(lattice.points.voxels[point]));
    std::size_t count = 0;
    for (const std::ptrdiff_t step : steps) {
      const std::uint32_t other = lattice.occupancy.point_at(bit + static_cast<std::size_t>(step));
      if (other != Occupancy::none) found[count++] = other;
    }
    return count;
  });
}

LinkGraph link_mutual_nearest(const LatticePoints& lattice, const OffsetTable& table, const Metric& metric,
                              const Jitter& jitter, int max_links, unsigned threads,
                              const core::Progress& progress) {
  const PointCloud& points = lattice.points;
  const core::Progress search = progress.part(0.0, 0.7);
  // The jitter again, in lattice units: positions in mm have lost its last bits.
  std::vector<std::array<float, 3>> offsets(points.size());
  const auto place_of = [&](std::size_t point) {
    const Cell site = lattice.frame.site_of(points.voxels[point]);
    const std::array<float, 3>& offset = offsets[point];
    return std::array<double, 3>{site[0] + static_cast<double>(offset[0]),
                                 site[1] + static_cast<double>(offset[1]),
                                 site[2] + static_cast<double>(offset[2])};
  };
  parallel_for(points.size(), chunk, threads, search.part(0.0, 0.1), what,
               [&](std::size_t begin, std::size_t end) {
                 for (std::size_t point = begin; point < end; ++point) {
                   const Cell& voxel = points.voxels[point];
                   offsets[point] = jitter.at(lattice.geometry.index(voxel[0], voxel[1], voxel[2]));
                 }
               });

  NeighbourLists lists(points.size(), static_cast<std::size_t>(max_links));
  std::vector<std::uint32_t> lonely;
  std::mutex mutex;
  const auto offset_of = [&](std::uint32_t point, const Cell&) { return offsets[point]; };
  parallel_for(
      points.size(), chunk / 2, threads, search.part(0.1, 0.9), what,
      [&](std::size_t begin, std::size_t end) {
        NearestList list(static_cast<std::size_t>(max_links));
        std::vector<std::uint32_t> unsure;
        for (std::size_t point = begin; point < end; ++point) {
          const Cell site = lattice.frame.site_of(points.voxels[point]);
          if (nearest_by_table(lattice.occupancy, table, metric, site, offsets[point], offset_of, list))
            lists.store(point, list);
          else
            unsure.push_back(static_cast<std::uint32_t>(point));
        }
        const std::lock_guard<std::mutex> lock(mutex);
        lonely.insert(lonely.end(), unsure.begin(), unsure.end());
      });

  if (!lonely.empty()) {
    std::vector<Eigen::Vector3d> places(points.size());
    parallel_for(points.size(), chunk, threads, search.part(0.9, 0.92), what,
                 [&](std::size_t begin, std::size_t end) {
                   for (std::size_t point = begin; point < end; ++point) {
                     const auto at = place_of(point);
                     places[point] = metric.place(at[0], at[1], at[2]);
                   }
                 });
    const CellGrid grid(std::move(places), 2.0, progress.cancel());
    parallel_for(lonely.size(), 64, threads, search.part(0.92, 1.0), what,
                 [&](std::size_t begin, std::size_t end) {
                   NearestList list(static_cast<std::size_t>(max_links));
                   const auto squared = [&](std::uint32_t a, std::uint32_t b) {
                     const Cell from = lattice.frame.site_of(points.voxels[a]);
                     const Cell to = lattice.frame.site_of(points.voxels[b]);
                     // As nearest_by_table() does it, to the last bit: a link needs both sides to agree.
                     const auto along = [&](std::size_t axis) {
                       return (to[axis] - from[axis]) +
                              (static_cast<double>(offsets[b][axis]) - static_cast<double>(offsets[a][axis]));
                     };
                     return metric.squared(along(0), along(1), along(2));
                   };
                   for (std::size_t n = begin; n < end; ++n) {
                     grid.nearest(lonely[n], squared, list);
                     lists.store(lonely[n], list);
                   }
                 });
  }
  return collect_mutual(points, lists, threads, progress.part(0.7, 1.0));
}

LinkGraph link_by_positions(const PointCloud& points, double edge_mm, int max_links, unsigned threads,
                            const core::Progress& progress) {
  std::vector<Eigen::Vector3d> places(points.size());
  std::transform(points.positions_mm.begin(), points.positions_mm.end(), places.begin(),
                 [](const Eigen::Vector3f& position) { return Eigen::Vector3d(position.cast<double>()); });
  const CellGrid grid(std::move(places), edge_mm, progress.cancel());
  NeighbourLists lists(points.size(), static_cast<std::size_t>(max_links));
  parallel_for(points.size(), 256, threads, progress.part(0.0, 0.8), what,
               [&](std::size_t begin, std::size_t end) {
                 NearestList list(static_cast<std::size_t>(max_links));
                 const auto squared = [&](std::uint32_t a, std::uint32_t b) {
                   return (points.positions_mm[b].cast<double>() - points.positions_mm[a].cast<double>())
                       .squaredNorm();
                 };
                 for (std::size_t point = begin; point < end; ++point) {
                   grid.nearest(static_cast<std::uint32_t>(point), squared, list);
                   lists.store(point, list);
                 }
               });
  return collect_mutual(points, lists, threads, progress.part(0.8, 1.0));
}

}  // namespace palpate::model
