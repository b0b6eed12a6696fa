#include "palpate/model/generate.hpp"

#include "build.hpp"
#include "components.hpp"
#include "links.hpp"
#include "parallel.hpp"
#include "scatter.hpp"

#include "palpate/core/error.hpp"

#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

namespace palpate::model {
namespace {

template <typename... Parts>
[[noreturn]] void usage(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  core::throw_usage(text.str());
}

void check(const core::Volume& volume, const TissueParameters& p) {
  if (volume.empty()) usage("There is no volume to make tissue of; open a scan first.");
  if (p.threshold_low && std::isnan(*p.threshold_low)) usage("The lower threshold is not a number.");
  if (std::isnan(p.threshold_high)) usage("The upper threshold is not a number.");
  if (p.threshold_low && *p.threshold_low > p.threshold_high)
    usage("The lower threshold ", *p.threshold_low, " is above the upper one, ", p.threshold_high, ".");
  if (p.stride < 1) usage("The stride is ", p.stride, "; it must be 1 or more.");
  if (!(p.noise >= 0.0 && p.noise <= 0.5))
    usage("The noise is ", p.noise, "; it must be between 0 and 0.5 of the spacing.");
  if (p.max_links < 1 || p.max_links > static_cast<int>(NearestList::most))
    usage("The number of links per point is ", p.max_links, "; it must be between 1 and ", NearestList::most,
          ".");
  if (p.links < LinkRule::six || p.links > LinkRule::lattice26) usage("The rule for links is unknown.");
  if (p.points != PointRule::lattice && p.points != PointRule::blue_noise)
    usage("The rule for points is unknown.");
  if (p.points == PointRule::blue_noise && p.links != LinkRule::nearest)
    usage("Points without a lattice (blue-noise) have no neighbours on one: link them by nearest.");
  if (p.mask && p.mask->empty()) usage("The mask holds no voxels.");
}

PointCloud make_points(const core::Volume& volume, const Plan& plan, const Occupancy& occupancy,
                       unsigned threads, const core::Progress& progress) {
  const core::ImageGeometry& geometry = volume.geometry();
  PointCloud points;
  points.center_mm = geometry.center_mm();
  points.positions_mm.resize(occupancy.count());
  points.voxels.resize(occupancy.count());
  points.intensities.resize(occupancy.count());
  const Eigen::Matrix3d axes = geometry.ijk_to_lps_mm().topLeftCorner<3, 3>();
  const Eigen::Vector3d middle =
      0.5 * Eigen::Vector3d(volume.dims()[0] - 1, volume.dims()[1] - 1, volume.dims()[2] - 1);
  const auto rows = static_cast<std::size_t>(occupancy.size()[1]);
  parallel_for(rows * static_cast<std::size_t>(occupancy.size()[2]), 256, threads, progress, "Placing points",
               [&](std::size_t begin, std::size_t end) {
                 const auto place = [&](const Cell& site, std::uint32_t point) {
                   const Cell voxel = plan.frame.voxel_of(site);
                   const std::size_t index = geometry.index(voxel[0], voxel[1], voxel[2]);
                   const std::array<float, 3> offset = plan.jitter.at(index);
                   Eigen::Vector3d ijk;
                   for (std::size_t axis = 0; axis < 3; ++axis)
                     ijk[static_cast<Eigen::Index>(axis)] =
                         voxel[axis] + plan.frame.stride * static_cast<double>(offset[axis]);
                   points.positions_mm[point] = (axes * (ijk - middle)).cast<float>();
                   points.voxels[point] = voxel;
                   points.intensities[point] = volume.data()[index];
                 };
                 for (std::size_t row = begin; row < end; ++row)
                   occupancy.for_row(static_cast<int>(row % rows), static_cast<int>(row / rows), place);
               });
  return points;
}

/// Whether `f(voxel)` holds for some voxel of the box.
template <typename F>
bool any_voxel(const CropBox& box, const F& f) {
  for (int k = box.begin[2]; k < box.end[2]; ++k)
    for (int j = box.begin[1]; j < box.end[1]; ++j)
      for (int i = box.begin[0]; i < box.end[0]; ++i)
        if (f(Cell{i, j, k})) return true;
  return false;
}

/// Where there is no tissue because of the mask alone, says how it fails.
void throw_if_mask_is_to_blame(const core::Volume& volume, const MaskLookup& mask, const CropBox& box) {
  const auto reaches = [&](const Cell& voxel) { return mask.reaches(voxel); };
  if (!any_voxel(CropBox{{0, 0, 0}, volume.dims()}, reaches))
    throw core::Error(core::ErrorKind::input, "mask-outside",
                      "The mask lies outside the scan: no voxel of the scan is in it. Take a mask that was "
                      "made of this scan, and check spacing and orientation of both.");
  if (any_voxel(box, [&](const Cell& voxel) { return mask.holds(voxel); })) return;
  std::ostringstream text;
  text << "The mask marks no voxel of the scan";
  if (mask.label()) text << " with label " << *mask.label();
  const core::IntensityRange& labels = mask.mask().range();
  text << "; its labels reach from " << labels.min << " to " << labels.max
       << ". Choose another label or mask, or a larger crop.";
  throw core::Error(core::ErrorKind::input, "mask-empty", text.str());
}

/// Keeps what `keep` says, in order.
template <typename T, typename Keep>
void compact(std::vector<T>& values, const Keep& keep) {
  std::size_t kept = 0;
  for (std::size_t n = 0; n < values.size(); ++n)
    if (keep(n)) values[kept++] = values[n];
  values.resize(kept);
  values.shrink_to_fit();
}

void drop_small_components(Tissue& tissue, std::size_t min_component, const core::Progress& progress) {
  progress.report(0.0, "Dropping specks");
  const Components components = components_with(tissue.links, tissue.points.size(), progress.cancel());
  if (components.sizes.back() >= min_component) return;
  if (components.sizes.front() < min_component) throw_all_dropped(min_component, components.sizes.front());
  progress.report(0.4, "Dropping specks");
  const auto stays = [&](std::size_t point) {
    return components.sizes[components.component[point]] >= min_component;
  };
  std::vector<std::uint32_t> number(tissue.points.size());
  std::uint32_t next = 0;
  for (std::size_t point = 0; point < number.size(); ++point)
    number[point] = stays(point) ? next++ : Occupancy::none;

  // Both ends of a link are in the same component.
  LinkGraph& links = tissue.links;
  std::size_t kept = 0;
  for (std::size_t link = 0; link < links.size(); ++link) {
    if (link % (1U << 20U) == 0) progress.cancel().check();
    const auto pair = links.pairs[link];
    if (number[pair[0]] == Occupancy::none) continue;
    links.pairs[kept] = {number[pair[0]], number[pair[1]]};
    links.rest_lengths_mm[kept++] = links.rest_lengths_mm[link];
  }
  links.pairs.resize(kept);
  links.rest_lengths_mm.resize(kept);
  progress.report(0.8, "Dropping specks");
  compact(tissue.points.positions_mm, stays);
  compact(tissue.points.voxels, stays);
  compact(tissue.points.intensities, stays);
  progress.report(1.0, "Dropping specks");
}

}  // namespace

void throw_no_tissue(const core::Volume& volume, const TissueRule& rule, const CropBox& box) {
  if (rule.mask) throw_if_mask_is_to_blame(volume, *rule.mask, box);
  const IntensityWindow& window = rule.window;
  std::ostringstream text;
  text << (rule.mask ? "No voxel of the mask lies " : "No voxel lies ");
  if (std::isfinite(window.high))
    text << "between " << window.low << " and " << window.high;
  else
    text << "at " << window.low << " or above";
  text << "; the volume's values reach from " << volume.range().min << " to " << volume.range().max
       << ". Choose a threshold in that range, or a larger " << (rule.mask ? "mask." : "crop.");
  throw core::Error(core::ErrorKind::input, "no-tissue", text.str());
}

void throw_all_dropped(std::size_t min_component, std::size_t largest_component) {
  std::ostringstream text;
  text << "Every piece of tissue is smaller than " << min_component << " points; the largest has "
       << largest_component << ". Lower the smallest component or the threshold.";
  throw core::Error(core::ErrorKind::input, "no-tissue", text.str());
}

Plan make_plan(const core::Volume& volume, const TissueParameters& parameters, unsigned threads,
               const core::Progress& progress) {
  check(volume, parameters);
  const CropBox box = clip(parameters.crop, volume.dims());
  const double low = parameters.threshold_low ? *parameters.threshold_low
                     : parameters.mask        ? -std::numeric_limits<double>::infinity()
                                              : otsu(volume, box, threads, progress);
  const bool scattered = parameters.points == PointRule::blue_noise;
  const double amplitude = scattered ? 0.0 : parameters.noise;
  const Metric metric(volume.geometry(), parameters.stride);
  TissueRule rule{{low, parameters.threshold_high}, std::nullopt};
  if (parameters.mask) rule.mask.emplace(*parameters.mask, parameters.mask_label, volume.geometry());
  return {box,
          frame_of(box, scattered ? 1 : parameters.stride),
          std::move(rule),
          Jitter(parameters.seed, amplitude),
          metric,
          OffsetTable(metric, amplitude, parameters.max_links)};
}

Occupancy occupy(const core::Volume& volume, Plan& plan, unsigned threads, const core::Progress& progress) {
  Cell pad = plan.table.pad();
  // Neighbours are looked for one site beyond the lattice.
  for (int& sites : pad) sites = std::max(sites, 1);
  Occupancy occupancy = occupy(volume, plan.frame, plan.rule, pad, threads, progress);
  plan.table.bind(occupancy);
  return occupancy;
}

Tissue build(const core::Volume& volume, const TissueParameters& parameters, const Plan& plan,
             const Occupancy& occupancy, unsigned threads, const core::Progress& progress) {
  Tissue tissue;
  tissue.geometry = volume.geometry();
  tissue.stride = parameters.stride;
  const LatticeFrame sites = frame_of(plan.box, parameters.stride);
  for (std::size_t axis = 0; axis < 3; ++axis) tissue.first_voxel[axis] = sites.begin[axis];
  tissue.on_lattice = parameters.points == PointRule::lattice;
  if (!tissue.on_lattice) {
    for (std::size_t axis = 0; axis < 3; ++axis) tissue.last_voxel[axis] = plan.box.end[axis] - 1;
    const double edge_mm = scattered_spacing_mm(volume.geometry(), parameters.stride);
    tissue.spacing_mm = Eigen::Vector3d::Constant(edge_mm);
    tissue.points = scatter(volume, plan.frame, occupancy, parameters.stride, parameters.seed, threads,
                            progress.part(0.0, 0.5));
    tissue.links = link_by_positions(tissue.points, 2.0 * edge_mm, parameters.max_links, threads,
                                     progress.part(0.5, 1.0));
    return tissue;
  }
  tissue.last_voxel = sites.voxel_of({sites.size[0] - 1, sites.size[1] - 1, sites.size[2] - 1});
  tissue.spacing_mm = volume.geometry().spacing_mm() * parameters.stride;
  tissue.points = make_points(volume, plan, occupancy, threads, progress.part(0.0, 0.1));
  const LatticePoints lattice{tissue.points, occupancy, plan.frame, volume.geometry()};
  const core::Progress rest = progress.part(0.1, 1.0);
  tissue.links = parameters.links == LinkRule::nearest
                     ? link_mutual_nearest(lattice, plan.table, plan.metric, plan.jitter,
                                           parameters.max_links, threads, rest)
                     : link_neighbours(lattice, half_stencil(parameters.links), threads, rest);
  return tissue;
}

Tissue generate_with(const core::Volume& volume, const TissueParameters& parameters, unsigned threads,
                     const core::Progress& progress) {
  Plan plan = make_plan(volume, parameters, threads, progress.part(0.0, 0.03));
  const Occupancy occupancy = occupy(volume, plan, threads, progress.part(0.03, 0.06));
  if (occupancy.count() == 0) throw_no_tissue(volume, plan.rule, plan.box);
  Tissue tissue = build(volume, parameters, plan, occupancy, threads, progress.part(0.06, 0.92));
  if (parameters.min_component > 1)
    drop_small_components(tissue, parameters.min_component, progress.part(0.92, 1.0));
  progress.report(1.0, "Tissue is ready");
  return tissue;
}

Tissue generate(const core::Volume& volume, const TissueParameters& parameters,
                const core::Progress& progress) {
  return generate_with(volume, parameters, core_count(), progress);
}

LinkGraph link_nearest(const PointCloud& points, const Eigen::Vector3d& point_spacing_mm, int max_links,
                       const core::Progress& progress) {
  if (max_links < 1 || max_links > static_cast<int>(NearestList::most))
    usage("The number of links per point is ", max_links, "; it must be between 1 and ", NearestList::most,
          ".");
  if (!point_spacing_mm.allFinite() || !(point_spacing_mm.minCoeff() > 0.0))
    usage("The spacing of the points must be positive along each axis.");
  // About eight points a cell where the lattice is full.
  return link_by_positions(points, 2.0 * std::cbrt(point_spacing_mm.prod()), max_links, core_count(),
                           progress);
}

}  // namespace palpate::model
