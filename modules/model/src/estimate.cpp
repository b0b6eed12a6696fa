#include "build.hpp"
#include "device_bytes.hpp"
#include "parallel.hpp"
#include "runs.hpp"

#include "palpate/model/generate.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>

namespace palpate::model {
namespace {

constexpr std::size_t small_tissue = 30000;   ///< points; below this the tissue itself is built
constexpr std::size_t block_sites = 20000;    ///< of the block that is built
constexpr std::size_t sampled_points = 1500;  ///< the mean of their links is then within 1 %

/// What the sampled points tell of all.
struct LinkSample {
  std::size_t points = 0;
  std::size_t link_ends = 0;
  int fewest = std::numeric_limits<int>::max();
  int most = 0;
  std::array<bool, 3> along{false, false, false};  ///< some link leads across this axis

  void add(int links) {
    ++points;
    link_ends += static_cast<std::size_t>(links);
    fewest = std::min(fewest, links);
    most = std::max(most, links);
  }
  void add(const LinkSample& other) {
    points += other.points;
    link_ends += other.link_ends;
    fewest = std::min(fewest, other.fewest);
    most = std::max(most, other.most);
    for (std::size_t axis = 0; axis < 3; ++axis) along[axis] = along[axis] || other.along[axis];
  }
  double mean() const {
    return points == 0 ? 0.0 : static_cast<double>(link_ends) / static_cast<double>(points);
  }
};

/// f(first point, last point, sample) over `count` points from several threads.
template <typename F>
LinkSample gather(std::size_t count, std::size_t chunk, unsigned threads, const core::Progress& progress,
                  const F& f) {
  LinkSample sum;
  std::mutex mutex;
  parallel_for(count, chunk, threads, progress, "Estimating links", [&](std::size_t begin, std::size_t end) {
    LinkSample part;
    f(begin, end, part);
    const std::lock_guard<std::mutex> lock(mutex);
    sum.add(part);
  });
  return sum;
}

LinkSample sample_nearest(const core::Volume& volume, const TissueParameters& parameters, const Plan& plan,
                          const Occupancy& occupancy, unsigned threads, const core::Progress& progress) {
  const auto offset_at = [&](std::uint32_t, const Cell& site) {
    const Cell voxel = plan.frame.voxel_of(site);
    return plan.jitter.at(volume.geometry().index(voxel[0], voxel[1], voxel[2]));
  };
  const auto search = [&](const Cell& site, NearestList& list) {
    nearest_by_table(occupancy, plan.table, plan.metric, site, offset_at(0, site), offset_at, list);
  };
  return gather(
      sampled_points, 25, threads, progress, [&](std::size_t begin, std::size_t end, LinkSample& sample) {
        NearestList list(static_cast<std::size_t>(parameters.max_links));
        NearestList partners(static_cast<std::size_t>(parameters.max_links));
        for (std::size_t n = begin; n < end; ++n) {
          // One of each of `sampled_points` equal parts; not evenly, rows would show through.
          const std::uint64_t part = occupancy.count() / sampled_points;
          const std::uint64_t shift = (n * 0x9E3779B97F4A7C15ULL >> 32U) % part;
          const auto point = static_cast<std::uint32_t>(n * occupancy.count() / sampled_points + shift);
          const Cell site = occupancy.site_of(point);
          search(site, list);
          int links = 0;
          for (std::size_t place = 0; place < list.size(); ++place) {
            const Cell other = occupancy.site_of(list.point(place));
            search(other, partners);
            if (!partners.holds(point)) continue;
            ++links;
            for (std::size_t axis = 0; axis < 3; ++axis)
              sample.along[axis] = sample.along[axis] || site[axis] != other[axis];
          }
          sample.add(links);
        }
      });
}

/// Six neighbours are few enough to be counted at every point.
LinkSample count_six(const Occupancy& occupancy, unsigned threads, const core::Progress& progress) {
  std::array<std::ptrdiff_t, 3> steps{occupancy.bit_step({1, 0, 0}), occupancy.bit_step({0, 1, 0}),
                                      occupancy.bit_step({0, 0, 1})};
  const auto rows = static_cast<std::size_t>(occupancy.size()[1]);
  const std::size_t all_rows = rows * static_cast<std::size_t>(occupancy.size()[2]);
  return gather(
      all_rows, 256, threads, progress, [&](std::size_t begin, std::size_t end, LinkSample& sample) {
        for (std::size_t row = begin; row < end; ++row)
          occupancy.for_row(static_cast<int>(row % rows), static_cast<int>(row / rows),
                            [&](const Cell& site, std::uint32_t) {
                              const auto bit = static_cast<std::ptrdiff_t>(occupancy.bit_of(site));
                              int links = 0;
                              for (const std::ptrdiff_t step : steps)
                                for (const std::ptrdiff_t to : {bit + step, bit - step})
                                  if (occupancy.point_at(static_cast<std::size_t>(to)) != Occupancy::none)
                                    ++links;
                              sample.add(links);
                            });
      });
}

/// Adds points, components and bounds, of the components that stay.
void describe(const RunComponents& components, const core::Volume& volume, const TissueParameters& parameters,
              const Plan& plan, TissueStatistics& statistics) {
  for (const std::size_t points : components.points) {
    if (points == 0 || points < parameters.min_component) continue;
    statistics.points += points;
    ++statistics.components;
    statistics.largest_component = std::max(statistics.largest_component, points);
    if (points == 1) ++statistics.isolated;
  }
  bool first = true;
  for (const Run& run : components.runs) {
    if (components.points[run.component] < parameters.min_component) continue;
    // The extremes of a row are at its ends, whatever the direction of the axes.
    for (const int a : {run.begin, run.end - 1}) {
      const Cell voxel = plan.frame.voxel_of({a, run.b, run.c});
      const Eigen::Vector3d lps = volume.geometry().to_lps_mm(Eigen::Vector3d(voxel[0], voxel[1], voxel[2]));
      statistics.bounds_min_mm = first ? lps : Eigen::Vector3d(statistics.bounds_min_mm.cwiseMin(lps));
      statistics.bounds_max_mm = first ? lps : Eigen::Vector3d(statistics.bounds_max_mm.cwiseMax(lps));
      first = false;
    }
  }
}

/// Which points stay depends on every link where small components are dropped
/// and links do not follow from touching voxels: so all are made, and counted.
void count_what_stays(const Tissue& all, std::size_t min_component, TissueStatistics& statistics) {
  statistics.points = statistics.components = statistics.largest_component = statistics.isolated = 0;
  const std::vector<std::size_t> sizes = components_of(all.links, all.points.size()).sizes;
  if (sizes.front() < min_component) throw_all_dropped(min_component, sizes.front());
  for (const std::size_t points : sizes) {
    if (points < min_component) continue;
    statistics.points += points;
    ++statistics.components;
    statistics.largest_component = std::max(statistics.largest_component, points);
  }
}

/// The block of about `block_sites` sites that holds most points.
LatticeFrame densest_block(const LatticeFrame& whole, const std::vector<Run>& runs) {
  Cell edge = whole.size;
  const auto sites = [&] { return static_cast<double>(edge[0]) * edge[1] * edge[2]; };
  while (sites() > static_cast<double>(block_sites)) {
    int& longest = *std::max_element(edge.begin(), edge.end());
    longest = std::max(1, longest * 9 / 10);
  }
  Cell blocks{};
  for (std::size_t axis = 0; axis < 3; ++axis) blocks[axis] = (whole.size[axis] - 1) / edge[axis] + 1;
  const auto index = [&](int a, int b, int c) {
    return (static_cast<std::size_t>(c) * static_cast<std::size_t>(blocks[1]) + static_cast<std::size_t>(b)) *
               static_cast<std::size_t>(blocks[0]) +
           static_cast<std::size_t>(a);
  };
  std::vector<std::size_t> points(index(blocks[0] - 1, blocks[1] - 1, blocks[2] - 1) + 1, 0);
  for (const Run& run : runs)
    for (int a = run.begin; a < run.end;) {
      const int block = a / edge[0];
      const int stop = std::min(run.end, (block + 1) * edge[0]);
      points[index(block, run.b / edge[1], run.c / edge[2])] += static_cast<std::size_t>(stop - a);
      a = stop;
    }
  const auto best = static_cast<std::size_t>(std::max_element(points.begin(), points.end()) - points.begin());
  const auto across = static_cast<std::size_t>(blocks[0]);
  const auto down = static_cast<std::size_t>(blocks[1]);
  const Cell block{static_cast<int>(best % across), static_cast<int>(best / across % down),
                   static_cast<int>(best / across / down)};
  LatticeFrame frame = whole;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int start = block[axis] * edge[axis];
    frame.begin[axis] = whole.begin[axis] + whole.stride * start;
    frame.size[axis] = std::min(edge[axis], whole.size[axis] - start);
  }
  return frame;
}

}  // namespace

TissueEstimate estimate(const core::Volume& volume, const TissueParameters& parameters,
                        const core::Progress& progress) {
  const unsigned threads = core_count();
  Plan plan = make_plan(volume, parameters, threads, progress.part(0.0, 0.2));
  const Occupancy occupancy = occupy(volume, plan, threads, progress.part(0.2, 0.4));
  if (occupancy.count() == 0) throw_no_tissue(volume, plan.window);

  TissueEstimate result;
  if (occupancy.count() <= small_tissue) {
    TissueParameters same = parameters;
    same.threshold_low = plan.window.low;
    result.sample = generate_with(volume, same, threads, progress.part(0.4, 1.0));
    result.statistics = statistics_of(result.sample);
    result.sampled = false;
    return result;
  }

  const bool six = parameters.links == LinkRule::six;
  const LinkSample links =
      six ? count_six(occupancy, threads, progress.part(0.4, 0.6))
          : sample_nearest(volume, parameters, plan, occupancy, threads, progress.part(0.4, 0.6));
  Touch touch;
  touch.corners = !six;
  if (!six) touch.along = links.along;
  const RunComponents components = components_of_runs(occupancy, touch, progress.cancel());
  progress.report(0.7, "Estimating components");

  TissueStatistics& statistics = result.statistics;
  describe(components, volume, parameters, plan, statistics);
  if (!six && parameters.min_component > 1)
    count_what_stays(build(volume, parameters, plan, occupancy, threads, progress.part(0.6, 0.7)),
                     parameters.min_component, statistics);
  statistics.mean_links_per_point = links.mean();
  statistics.links =
      static_cast<std::size_t>(std::llround(0.5 * links.mean() * static_cast<double>(statistics.points)));
  statistics.min_links_per_point = statistics.isolated > 0 ? 0 : links.fewest;
  statistics.max_links_per_point = links.most;
  statistics.bytes = bytes_of(statistics.points, statistics.links, links.most);

  Plan block = plan;
  block.frame = densest_block(plan.frame, components.runs);
  const Occupancy sites = occupy(volume, block, threads, progress.part(0.7, 0.75));
  result.sample = build(volume, parameters, block, sites, threads, progress.part(0.75, 1.0));
  return result;
}

}  // namespace palpate::model
