#include "build.hpp"
#include "device_bytes.hpp"
#include "links.hpp"
#include "parallel.hpp"
#include "runs.hpp"
#include "scatter.hpp"

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

/// The neighbours on the lattice are few enough to be counted at every point.
LinkSample count_neighbours(const Occupancy& occupancy, const std::vector<Cell>& half_stencil,
                            unsigned threads, const core::Progress& progress) {
  std::vector<std::ptrdiff_t> steps;
  for (const Cell& step : half_stencil) steps.push_back(occupancy.bit_step(step));
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
LatticeFrame densest_block(const LatticeFrame& whole, const std::vector<Run>& runs, double most_sites) {
  Cell edge = whole.size;
  const auto sites = [&] { return static_cast<double>(edge[0]) * edge[1] * edge[2]; };
  while (sites() > most_sites) {
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

/// The statistics of voxels, turned to those of points without a lattice.
void share_out(const RunComponents& components, std::size_t voxels, int stride,
               TissueStatistics& statistics) {
  const double share = static_cast<double>(stride) * stride * stride;
  const auto points_in = [&](std::size_t count) {
    return static_cast<std::size_t>(std::llround(static_cast<double>(count) / share));
  };
  statistics.points = scattered_count(voxels, stride);
  statistics.largest_component = std::max<std::size_t>(1, points_in(statistics.largest_component));
  statistics.components = statistics.isolated = 0;
  for (const std::size_t count : components.points) {
    const std::size_t points = points_in(count);
    if (points > 0) ++statistics.components;
    if (points == 1) ++statistics.isolated;
  }
  statistics.components = std::max<std::size_t>(1, statistics.components);
}

/// The links of a block's points that do not lie beside a face where the
/// tissue was cut off.
LinkSample sample_inside(const Tissue& block, const LatticeFrame& frame, const LatticeFrame& whole) {
  constexpr double cut_off = 2.5;  // spacings; longer links are few
  std::vector<int> degree(block.points.size(), 0);
  for (const auto& pair : block.links.pairs)
    for (const std::uint32_t end : pair) ++degree[end];
  const Eigen::Vector3d voxel_mm = block.geometry.spacing_mm();
  LinkSample inside;
  LinkSample all;
  for (std::size_t point = 0; point < degree.size(); ++point) {
    bool is_inside = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto row = static_cast<Eigen::Index>(axis);
      const double margin = cut_off * block.spacing_mm[row] / voxel_mm[row];
      const int end = frame.begin[axis] + frame.size[axis];
      const int at = block.points.voxels[point][axis];
      if (frame.begin[axis] > whole.begin[axis] && at - frame.begin[axis] < margin) is_inside = false;
      if (end < whole.begin[axis] + whole.size[axis] && end - 1 - at < margin) is_inside = false;
    }
    all.add(degree[point]);
    if (is_inside) inside.add(degree[point]);
  }
  return inside.points > 0 ? inside : all;
}

void scale_up(const LinkSample& links, TissueStatistics& statistics) {
  statistics.mean_links_per_point = links.mean();
  statistics.links =
      static_cast<std::size_t>(std::llround(0.5 * links.mean() * static_cast<double>(statistics.points)));
  statistics.min_links_per_point = statistics.isolated > 0 ? 0 : links.fewest;
  statistics.max_links_per_point = links.most;
  statistics.bytes = bytes_of(statistics.points, statistics.links, links.most);
}

TissueEstimate estimate_scattered(const core::Volume& volume, const TissueParameters& parameters, Plan plan,
                                  const Occupancy& occupancy, unsigned threads,
                                  const core::Progress& progress) {
  TissueEstimate result;
  const RunComponents components = components_of_runs(occupancy, Touch{}, progress.cancel());
  progress.report(0.2, "Estimating components");
  TissueParameters all_pieces = parameters;
  all_pieces.min_component = 1;
  describe(components, volume, all_pieces, plan, result.statistics);
  share_out(components, occupancy.count(), parameters.stride, result.statistics);
  if (parameters.min_component > 1)
    count_what_stays(build(volume, parameters, plan, occupancy, threads, progress.part(0.2, 0.7)),
                     parameters.min_component, result.statistics);
  const LatticeFrame whole = plan.frame;
  const double share = std::pow(parameters.stride, 3);
  plan.frame = densest_block(whole, components.runs, share * static_cast<double>(block_sites));
  const Occupancy voxels = occupy(volume, plan, threads, progress.part(0.7, 0.75));
  result.sample = build(volume, parameters, plan, voxels, threads, progress.part(0.75, 1.0));
  scale_up(sample_inside(result.sample, plan.frame, whole), result.statistics);
  return result;
}

TissueEstimate estimate_on_lattice(const core::Volume& volume, const TissueParameters& parameters,
                                   const Plan& plan, const Occupancy& occupancy, unsigned threads,
                                   const core::Progress& progress) {
  TissueEstimate result;
  const bool by_distance = parameters.links == LinkRule::nearest;
  const core::Progress counting = progress.part(0.0, 0.3);
  const LinkSample links =
      by_distance ? sample_nearest(volume, parameters, plan, occupancy, threads, counting)
                  : count_neighbours(occupancy, half_stencil(parameters.links), threads, counting);
  Touch touch;
  if (by_distance) touch.along = links.along;
  if (parameters.links == LinkRule::six) touch.across = 1;
  if (parameters.links == LinkRule::lattice18) touch.across = 2;
  const RunComponents components = components_of_runs(occupancy, touch, progress.cancel());
  progress.report(0.5, "Estimating components");

  describe(components, volume, parameters, plan, result.statistics);
  if (result.statistics.points == 0 && !components.points.empty())
    throw_all_dropped(parameters.min_component,
                      *std::max_element(components.points.begin(), components.points.end()));
  if (by_distance && parameters.min_component > 1)
    count_what_stays(build(volume, parameters, plan, occupancy, threads, progress.part(0.3, 0.5)),
                     parameters.min_component, result.statistics);
  scale_up(links, result.statistics);

  Plan block = plan;
  block.frame = densest_block(plan.frame, components.runs, static_cast<double>(block_sites));
  const Occupancy sites = occupy(volume, block, threads, progress.part(0.5, 0.6));
  result.sample = build(volume, parameters, block, sites, threads, progress.part(0.6, 1.0));
  return result;
}

}  // namespace

TissueEstimate estimate(const core::Volume& volume, const TissueParameters& parameters,
                        const core::Progress& progress) {
  const unsigned threads = core_count();
  Plan plan = make_plan(volume, parameters, threads, progress.part(0.0, 0.2));
  const Occupancy occupancy = occupy(volume, plan, threads, progress.part(0.2, 0.4));
  if (occupancy.count() == 0) throw_no_tissue(volume, plan.rule, plan.box);

  const bool scattered = parameters.points == PointRule::blue_noise;
  const std::size_t points =
      scattered ? scattered_count(occupancy.count(), parameters.stride) : occupancy.count();
  if (points <= small_tissue) {
    TissueEstimate result;
    TissueParameters same = parameters;
    same.threshold_low = plan.rule.window.low;
    result.sample = generate_with(volume, same, threads, progress.part(0.4, 1.0));
    result.statistics = statistics_of(result.sample);
    result.sampled = false;
    return result;
  }
  const core::Progress rest = progress.part(0.4, 1.0);
  return scattered ? estimate_scattered(volume, parameters, plan, occupancy, threads, rest)
                   : estimate_on_lattice(volume, parameters, plan, occupancy, threads, rest);
}

}  // namespace palpate::model
