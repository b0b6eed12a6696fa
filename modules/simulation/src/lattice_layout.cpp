#include "lattice_layout.hpp"

#include "lattice_flags.hpp"
#include "lattice_threads.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <limits>
#include <mutex>

namespace palpate::simulation {

namespace {

constexpr unsigned no_slot = LatticeSlots::most;

std::size_t index_of(int value) noexcept { return static_cast<std::size_t>(value); }

/// Voxels to sites of a lattice that begins at the tissue's own corner.
struct Frame {
  LatticeSite first{0, 0, 0};
  LatticeSite size{0, 0, 0};  ///< sites along the image's axes
  int stride = 1;

  LatticeSite site_of(const std::array<std::int32_t, 3>& voxel) const noexcept {
    return {(voxel[0] - first[0]) / stride, (voxel[1] - first[1]) / stride, (voxel[2] - first[2]) / stride};
  }
};

Frame frame_of(const model::Tissue& tissue) {
  Frame frame;
  frame.stride = std::max(1, tissue.stride);
  const auto& voxels = tissue.points.voxels;
  if (voxels.empty()) return frame;
  LatticeSite last = voxels.front();
  frame.first = voxels.front();
  for (const auto& voxel : voxels)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      frame.first[axis] = std::min(frame.first[axis], voxel[axis]);
      last[axis] = std::max(last[axis], voxel[axis]);
    }
  for (std::size_t axis = 0; axis < 3; ++axis)
    frame.size[axis] = (last[axis] - frame.first[axis]) / frame.stride + 1;
  return frame;
}

/// A point a site, and all on sites.
bool lies_on_lattice(const model::Tissue& tissue, const Frame& frame) {
  const auto& voxels = tissue.points.voxels;
  if (!tissue.on_lattice || voxels.size() != tissue.points.size()) return false;
  const std::size_t sites = index_of(frame.size[0]) * index_of(frame.size[1]) * index_of(frame.size[2]);
  std::vector<bool> taken(sites, false);
  for (const auto& voxel : voxels) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      if ((voxel[axis] - frame.first[axis]) % frame.stride != 0) return false;
    const LatticeSite site = frame.site_of(voxel);
    const std::size_t at =
        (index_of(site[2]) * index_of(frame.size[1]) + index_of(site[1])) * index_of(frame.size[0]) +
        index_of(site[0]);
    if (taken[at]) return false;
    taken[at] = true;
  }
  return true;
}

/// Which sites have a point, a bit each; rows along one axis, each from a byte's begin.
class Occupied {
 public:
  Occupied(const model::Tissue& tissue, const Frame& frame, const std::array<int, 3>& axes)
      : length_(size_along(frame, axes[0])),
        rows_(size_along(frame, axes[1])),
        bytes_((length_ + 7) / 8 + 4),
        bits_(bytes_ * rows_ * size_along(frame, axes[2]) + 8) {
    for (const auto& voxel : tissue.points.voxels) {
      const LatticeSite site = frame.site_of(voxel);
      const auto at = [&](std::size_t axis) {
        return static_cast<std::size_t>(site[static_cast<std::size_t>(axes[axis])]);
      };
      bits_[(at(2) * rows_ + at(1)) * bytes_ + at(0) / 8] |= static_cast<std::uint8_t>(1U << (at(0) % 8));
    }
  }
  /// Segments of `lanes` sites that rows moved by `shift` take.
  std::size_t segments(unsigned lanes, unsigned shift) const {
    std::size_t count = 0;
    const std::size_t rows = (bits_.size() - 8) / bytes_;
    for (std::size_t row = 0; row < rows; ++row)
      for (std::size_t begin = 0; begin < length_ + shift; begin += lanes) {
        std::uint32_t mask = lanes >= 16 ? 0xFFFFU : (1U << lanes) - 1U;
        std::size_t from = begin - shift;
        if (begin < shift) {  // only the first
          mask = begin + lanes <= shift ? 0U : mask >> (shift - begin);
          from = 0;
        }
        if ((window(row, from) & mask) != 0) ++count;
      }
    return count;
  }

 private:
  static std::size_t size_along(const Frame& frame, int axis) {
    return static_cast<std::size_t>(frame.size[static_cast<std::size_t>(axis)]);
  }
  std::uint32_t window(std::size_t row, std::size_t from) const {
    const std::uint8_t* data = bits_.data() + row * bytes_ + from / 8;
    const std::uint32_t word =
        data[0] | (static_cast<std::uint32_t>(data[1]) << 8U) | (static_cast<std::uint32_t>(data[2]) << 16U);
    return word >> (from % 8);
  }

  std::size_t length_;
  std::size_t rows_;
  std::size_t bytes_;
  std::vector<std::uint8_t> bits_;
};

/// How rows lie and where they are cut: the fewest segments.
struct Cut {
  std::array<int, 3> axes{0, 1, 2};
  int shift = 0;
  std::size_t segments = std::numeric_limits<std::size_t>::max();
};

Cut best_cut(const model::Tissue& tissue, const Frame& frame, unsigned lanes) {
  const std::array<std::array<int, 3>, 3> choices{{{0, 1, 2}, {1, 0, 2}, {2, 0, 1}}};
  std::array<Cut, 3> cuts;
  in_parallel(3, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t choice = begin; choice < end; ++choice) {
      const Occupied occupied(tissue, frame, choices[choice]);
      cuts[choice].axes = choices[choice];
      for (unsigned shift = 0; shift < lanes; ++shift) {
        const std::size_t segments = occupied.segments(lanes, shift);
        if (segments < cuts[choice].segments) {
          cuts[choice].segments = segments;
          cuts[choice].shift = static_cast<int>(shift);
        }
      }
    }
  });
  // Rows along the image's own are read in the order of the points: a little worse is still better.
  std::size_t best = 0;
  for (std::size_t choice = 1; choice < 3; ++choice)
    if (static_cast<double>(cuts[choice].segments) < 0.97 * static_cast<double>(cuts[best].segments))
      best = choice;
  return cuts[best];
}

/// Offsets of a link from its first end in the order of planes, rows, sites.
struct Forward {
  bool swapped = false;
  int x = 0;
  int y = 0;
  int z = 0;
};
Forward forward_of(const LatticeSite& a, const LatticeSite& b) noexcept {
  Forward f{false, b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  if (f.z < 0 || (f.z == 0 && (f.y < 0 || (f.y == 0 && f.x < 0)))) f = {true, -f.x, -f.y, -f.z};
  return f;
}

/// Which row a link goes to: -1 its own, 0..3 those beside it; none past the 26.
std::optional<int> row_of(const Forward& f) noexcept {
  if (std::abs(f.x) > 1 || std::abs(f.y) > 1 || f.z > 1) return std::nullopt;
  if (f.z == 0) return f.y == 0 ? -1 : 0;
  return f.y == 0 ? 1 : f.y > 0 ? 2 : 3;
}
unsigned slot_of(int row, int x) noexcept {
  constexpr std::array<std::array<unsigned, 3>, 4> slots{
      {{3, 1, 2}, {6, 4, 5}, {10, 7, 9}, {12, 8, 11}}};  // behind, straight, ahead
  return row < 0 ? 0 : slots[static_cast<std::size_t>(row)][static_cast<std::size_t>(x + 1)];
}

}  // namespace

unsigned LatticeSlots::stored() const noexcept { return rank_of(most); }
unsigned LatticeSlots::rank_of(unsigned slot) const noexcept {
  unsigned rank = 0;
  for (unsigned before = 0; before < slot; ++before) rank += (used >> before) & 1U;
  return rank;
}

double LatticeLayout::lanes_per_point() const noexcept {
  return lane_of_point.empty()
             ? 0.0
             : static_cast<double>(segments * lanes) / static_cast<double>(lane_of_point.size());
}

std::uint16_t LatticeLayout::stored_length(float rest_length_mm) const noexcept {
  if (!(rest_length_mm > 0.0F)) return 0;
  const float steps = std::round((rest_length_mm - rest_offset_mm) / rest_quantum_mm);
  return static_cast<std::uint16_t>(std::clamp(steps, 1.0F, 65535.0F));
}

LatticeSite LatticeLayout::site_of(std::uint32_t lane) const noexcept {
  LatticeSite site = first_sites[lane / lanes];
  site[0] += static_cast<int>(lane % lanes);
  return site;
}

Eigen::Vector3d LatticeLayout::site_mm(std::uint32_t lane) const noexcept {
  const LatticeSite site = site_of(lane);
  return corner_mm + to_lps * (site[0] * steps_mm[0] + site[1] * steps_mm[1] + site[2] * steps_mm[2]);
}

namespace {

/// The segment and lane of a link's slot, where it has one.
struct StencilPlace {
  std::uint32_t segment;
  std::uint32_t lane;
  unsigned slot;
  int row;
};

std::optional<StencilPlace> stencil_place(const LatticeLayout& layout, std::uint32_t from, std::uint32_t to,
                                          const Forward& f) {
  const std::optional<int> row = row_of(f);
  if (!row) return std::nullopt;
  const unsigned slot = slot_of(*row, f.x);
  if (((layout.slots.used >> slot) & 1U) == 0) return std::nullopt;
  const std::uint32_t lanes = layout.lanes;
  const std::uint32_t from_segment = from / lanes;
  const std::uint32_t to_segment = to / lanes;
  StencilPlace place{from_segment, from % lanes, slot, *row};
  if (*row < 0 || f.x == 0) return place;
  // By the lane of theirs; our row must have the segment that faces it, beside our own.
  place.lane = to % lanes;
  if (f.x > 0 && place.lane == 0) ++place.segment;
  if (f.x < 0 && place.lane == lanes - 1) --place.segment;
  if (layout.rows[place.segment][index_of(*row)] != to_segment) return std::nullopt;
  return place;
}

std::size_t rest_index(const LatticeLayout& layout, const StencilPlace& place) {
  return (std::size_t{place.segment} * layout.slots.stored() + layout.slots.rank_of(place.slot)) *
             layout.lanes +
         place.lane;
}

}  // namespace

LatticePlace LatticeLayout::place_of(std::uint32_t lane_a, std::uint32_t lane_b) const {
  const Forward f = forward_of(site_of(lane_a), site_of(lane_b));
  const std::uint32_t from = f.swapped ? lane_b : lane_a;
  const std::uint32_t to = f.swapped ? lane_a : lane_b;
  LatticePlace result;
  if (const auto place = stencil_place(*this, from, to, f)) {
    result.in_stencil = true;
    result.rest = rest_index(*this, *place);
    return result;
  }
  const auto find = [&](std::uint32_t own, std::uint32_t partner) {
    for (std::size_t n = overflow_begins[own / lanes]; n < overflow_begins[own / lanes + 1]; ++n)
      if (overflow[n].partner == partner && overflow[n].apart_z_own >> 16U == own % lanes) return n;
    throw core::Error(core::ErrorKind::internal, "no-link", "A link is not in the lattice's overflow list.");
  };
  result.overflow = {find(lane_a, lane_b), find(lane_b, lane_a)};
  return result;
}

namespace {

/// Numbers the segments and finds each point's lane.
std::vector<LatticeSite> place_points(const model::Tissue& tissue, const Frame& frame, const Cut& cut,
                                      LatticeLayout& layout) {
  const auto& voxels = tissue.points.voxels;
  layout.axes = cut.axes;
  layout.shift = cut.shift;
  for (std::size_t axis = 0; axis < 3; ++axis) layout.size[axis] = frame.size[index_of(cut.axes[axis])];
  layout.blocks_in_row = (index_of(layout.size[0] + cut.shift) + layout.lanes - 1) / layout.lanes;
  const std::size_t row_count = index_of(layout.size[1]) * index_of(layout.size[2]);
  layout.segment_at.assign(row_count * layout.blocks_in_row, 0);
  std::vector<LatticeSite> sites(voxels.size());
  layout.lane_of_point.resize(voxels.size());
  in_parallel(voxels.size(), 65536, [&](std::size_t begin, std::size_t end) {
    for (std::size_t point = begin; point < end; ++point) {
      const LatticeSite site = frame.site_of(voxels[point]);
      for (std::size_t axis = 0; axis < 3; ++axis) sites[point][axis] = site[index_of(cut.axes[axis])];
    }
  });
  const auto block_of = [&](const LatticeSite& site) {
    return (index_of(site[2]) * index_of(layout.size[1]) + index_of(site[1])) * layout.blocks_in_row +
           index_of(site[0] + cut.shift) / layout.lanes;
  };
  for (const auto& site : sites) layout.segment_at[block_of(site)] = 1;
  layout.row_begins.resize(row_count + 1);
  std::uint32_t next = 1;
  for (std::size_t row = 0; row < row_count; ++row) {
    layout.row_begins[row] = next;
    for (std::size_t block = 0; block < layout.blocks_in_row; ++block) {
      std::uint32_t& segment = layout.segment_at[row * layout.blocks_in_row + block];
      if (segment != 0) segment = next++;
    }
  }
  layout.row_begins[row_count] = next;
  layout.segments = next - 1;
  in_parallel(voxels.size(), 65536, [&](std::size_t begin, std::size_t end) {
    for (std::size_t point = begin; point < end; ++point)
      layout.lane_of_point[point] = layout.segment_at[block_of(sites[point])] * layout.lanes +
                                    static_cast<std::uint32_t>(sites[point][0] + cut.shift) % layout.lanes;
  });
  return sites;
}

/// The lattice's frame. Steps and corner lie on a grid so coarse that float32
/// adds them without rounding.
void place_sites(const model::Tissue& tissue, const Frame& frame, LatticeLayout& layout) {
  const Eigen::Matrix4d& matrix = tissue.geometry.ijk_to_lps_mm();
  const Eigen::Vector3d first(frame.first[0], frame.first[1], frame.first[2]);
  layout.corner_mm = tissue.geometry.to_lps_mm(first) - tissue.points.center_mm;
  Eigen::Matrix3d steps;
  double extent = layout.corner_mm.cwiseAbs().maxCoeff();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto column = static_cast<Eigen::Index>(axis);
    steps.col(column) = matrix.col(layout.axes[axis]).head<3>() * frame.stride;
    extent += steps.col(column).norm() * (layout.size[axis] + 2.0 * layout.lanes);
  }
  const Eigen::Matrix3d directions = steps.colwise().normalized();
  layout.is_sheared = !(directions.transpose() * directions).isIdentity(1e-9);
  if (!layout.is_sheared) {
    layout.to_lps = directions;
    const Eigen::Vector3d lengths = steps.colwise().norm();
    steps = lengths.asDiagonal();
  }
  const double grid = std::ldexp(1.0, static_cast<int>(std::ceil(std::log2(std::max(extent, 1e-6)))) - 23);
  const auto rounded = [&](const Eigen::Vector3d& v) {
    return Eigen::Vector3d((v.array() / grid).round() * grid);
  };
  layout.corner_mm = rounded(layout.corner_mm);
  for (std::size_t axis = 0; axis < 3; ++axis)
    layout.steps_mm[axis] = rounded(steps.col(static_cast<Eigen::Index>(axis)));
  layout.first_sites.assign(layout.segments + 2, {0, 0, 0});
  const std::size_t rows_in_plane = index_of(layout.size[1]);
  in_parallel(layout.row_begins.size() - 1, 512, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row)
      for (std::size_t block = 0; block < layout.blocks_in_row; ++block)
        if (const std::uint32_t segment = layout.segment_at[row * layout.blocks_in_row + block]; segment != 0)
          layout.first_sites[segment] = {static_cast<int>(block * layout.lanes) - layout.shift,
                                         static_cast<int>(row % rows_in_plane),
                                         static_cast<int>(row / rows_in_plane)};
  });
}

void find_rows(LatticeLayout& layout) {
  layout.rows.assign(layout.segments + 2, {0, 0, 0, 0});
  const int rows_in_plane = layout.size[1];
  constexpr std::array<std::array<int, 2>, 4> beside{{{1, 0}, {0, 1}, {1, 1}, {-1, 1}}};
  in_parallel(layout.row_begins.size() - 1, 512, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row % index_of(rows_in_plane));
      const int z = static_cast<int>(row / index_of(rows_in_plane));
      for (std::size_t n = 0; n < 4; ++n) {
        const int other_y = y + beside[n][0];
        const int other_z = z + beside[n][1];
        if (other_y < 0 || other_y >= rows_in_plane || other_z >= layout.size[2]) continue;
        const std::size_t other = index_of(other_z) * index_of(rows_in_plane) + index_of(other_y);
        for (std::size_t block = 0; block < layout.blocks_in_row; ++block)
          if (const std::uint32_t segment = layout.segment_at[row * layout.blocks_in_row + block];
              segment != 0)
            layout.rows[segment][n] = layout.segment_at[other * layout.blocks_in_row + block];
      }
    }
  });
}

struct LengthRange {
  float shortest_mm = std::numeric_limits<float>::infinity();
  float longest_mm = 0.0F;
  void take(const LengthRange& other) {
    shortest_mm = std::min(shortest_mm, other.shortest_mm);
    longest_mm = std::max(longest_mm, other.longest_mm);
  }
};

/// What the links need: how many are in each slot (the last: none), and their lengths.
struct Census {
  std::array<std::size_t, LatticeSlots::most + 1> in_slot{};
  std::array<LengthRange, LatticeSlots::most + 1> lengths{};
};
Census census_of(const model::LinkGraph& links, const std::vector<LatticeSite>& sites) {
  Census all;
  std::mutex mutex;
  in_parallel(links.size(), 262144, [&](std::size_t begin, std::size_t end) {
    Census own;
    for (std::size_t link = begin; link < end; ++link) {
      const Forward f = forward_of(sites[links.pairs[link][0]], sites[links.pairs[link][1]]);
      const std::optional<int> row = row_of(f);
      const auto slot = row ? slot_of(*row, f.x) : no_slot;
      ++own.in_slot[slot];
      const float length = links.rest_lengths_mm[link];
      if (length > 0.0F) own.lengths[slot].take({length, length});
    }
    const std::lock_guard lock(mutex);
    for (std::size_t slot = 0; slot < own.in_slot.size(); ++slot) {
      all.in_slot[slot] += own.in_slot[slot];
      all.lengths[slot].take(own.lengths[slot]);
    }
  });
  return all;
}

/// A slot costs every segment about 20 cycles, a link in the overflow 80 (both ends).
constexpr double overflow_cost = 4.0;

LatticeSlots slots_for(const Census& census, std::size_t segments) {
  LatticeSlots slots;
  for (unsigned slot = 0; slot < LatticeSlots::most; ++slot)
    if (overflow_cost * static_cast<double>(census.in_slot[slot]) > static_cast<double>(segments))
      slots.used |= 1U << slot;
  return slots;
}

std::vector<std::uint32_t> store_links(const model::LinkGraph& links, const std::vector<LatticeSite>& sites,
                                       LatticeLayout& layout) {
  layout.rest.assign((layout.segments + 2) * layout.slots.stored() * layout.lanes, 0);
  std::vector<std::uint32_t> outside;
  std::mutex mutex;
  in_parallel(links.size(), 131072, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> own;
    for (std::size_t link = begin; link < end; ++link) {
      const auto [a, b] = links.pairs[link];
      const Forward f = forward_of(sites[a], sites[b]);
      const std::uint32_t from = layout.lane_of_point[f.swapped ? b : a];
      const std::uint32_t to = layout.lane_of_point[f.swapped ? a : b];
      if (const auto place = stencil_place(layout, from, to, f))
        layout.rest[rest_index(layout, *place)] = layout.stored_length(links.rest_lengths_mm[link]);
      else
        own.push_back(static_cast<std::uint32_t>(link));
    }
    const std::lock_guard lock(mutex);
    outside.insert(outside.end(), own.begin(), own.end());
  });
  std::sort(outside.begin(), outside.end());
  return outside;
}

void store_overflow(const model::LinkGraph& links, const std::vector<LatticeSite>& sites,
                    const std::vector<std::uint32_t>& outside, LatticeLayout& layout) {
  layout.links = links.size();
  layout.links_in_overflow = outside.size();
  layout.overflow_begins.assign(layout.segments + 3, 0);
  for (const std::uint32_t link : outside)
    for (const std::uint32_t point : links.pairs[link])
      ++layout.overflow_begins[layout.lane_of_point[point] / layout.lanes + 1];
  for (std::size_t n = 1; n < layout.overflow_begins.size(); ++n)
    layout.overflow_begins[n] += layout.overflow_begins[n - 1];
  std::vector<std::uint32_t> next = layout.overflow_begins;
  layout.overflow.resize(2 * outside.size());
  for (const std::uint32_t link : outside) {
    const auto [a, b] = links.pairs[link];
    for (const auto& [own, other] : {std::pair(a, b), std::pair(b, a)}) {
      const auto apart = [&](std::size_t axis) {
        return static_cast<std::uint32_t>(sites[other][axis] - sites[own][axis]) & 0xFFFFU;
      };
      const std::uint32_t lane = layout.lane_of_point[own];
      layout.overflow[next[lane / layout.lanes]++] = {
          layout.lane_of_point[other], links.rest_lengths_mm[link], apart(0) | (apart(1) << 16U),
          apart(2) | ((lane % layout.lanes) << 16U)};
    }
  }
}

}  // namespace

namespace {

/// Which rows each segment has links to.
void find_groups(LatticeLayout& layout) {
  constexpr std::array<int, LatticeSlots::most> row_of_slot{-1, 0, 0, 0, 1, 1, 1, 2, 3, 2, 2, 3, 3};
  layout.groups.assign(layout.segments + 2, 0);
  const std::size_t lanes = layout.lanes;
  const std::size_t stored = layout.slots.stored();
  in_parallel(layout.segments + 2, 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t segment = begin; segment < end; ++segment) {
      std::uint32_t flags = 0;
      for (unsigned slot = 0; slot < LatticeSlots::most; ++slot) {
        if (((layout.slots.used >> slot) & 1U) == 0) continue;
        const std::uint16_t* lengths =
            layout.rest.data() + (segment * stored + layout.slots.rank_of(slot)) * lanes;
        if (std::all_of(lengths, lengths + lanes, [](std::uint16_t n) { return n == 0; })) continue;
        const int row = row_of_slot[slot];
        flags |= row < 0 ? own_row_flag : row_flag(index_of(row));
      }
      if (layout.overflow_begins[segment] != layout.overflow_begins[segment + 1]) flags |= overflow_flag;
      layout.groups[segment] = static_cast<std::uint16_t>(flags);
    }
  });
}

}  // namespace

LatticeLayout build_lattice(const model::Tissue& tissue, unsigned lanes) {
  const Frame frame = frame_of(tissue);
  if (!lies_on_lattice(tissue, frame))
    core::throw_usage(
        "The lattice layout needs a point a voxel; these points do not lie on a lattice. Choose the layout "
        "auto.");
  LatticeLayout layout;
  layout.lanes = lanes;
  const std::vector<LatticeSite> sites = place_points(tissue, frame, best_cut(tissue, frame, lanes), layout);
  place_sites(tissue, frame, layout);
  find_rows(layout);
  const Census census = census_of(tissue.links, sites);
  layout.slots = slots_for(census, layout.segments);
  // Of the stencil alone: one long link between specks must not make all others coarse.
  LengthRange stored;
  for (unsigned slot = 0; slot < LatticeSlots::most; ++slot)
    if (((layout.slots.used >> slot) & 1U) != 0) stored.take(census.lengths[slot]);
  if (stored.longest_mm > 0.0F) {
    layout.rest_quantum_mm =
        std::max((stored.longest_mm - stored.shortest_mm) / 65534.0F, stored.longest_mm * 1e-7F);
    layout.rest_offset_mm = stored.shortest_mm - layout.rest_quantum_mm;
  }
  const std::vector<std::uint32_t> outside = store_links(tissue.links, sites, layout);
  store_overflow(tissue.links, sites, outside, layout);
  find_groups(layout);
  return layout;
}

double lattice_lanes_per_point(const model::Tissue& tissue, unsigned lanes) {
  const Cut cut = best_cut(tissue, frame_of(tissue), lanes);
  return static_cast<double>(cut.segments * lanes) /
         static_cast<double>(std::max<std::size_t>(1, tissue.points.size()));
}

namespace {

/// With every twentieth link outside, a step takes half as long again; explicit
/// links take 2.8 times as long as a lattice without any (27 and 36 points a
/// side, spacings 1:1:1 to 1:1:3): alike at about this share.
constexpr double most_outside = 0.15;

std::string percent(double share) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%.2g %%", 100.0 * share);
  return text.data();
}

}  // namespace

LayoutVerdict choose_layout(const model::Tissue& tissue) {
  LayoutVerdict verdict;
  const Frame frame = frame_of(tissue);
  if (!lies_on_lattice(tissue, frame)) {
    verdict.reason = "The points do not lie on a lattice, a voxel each.";
    return verdict;
  }
  verdict.possible = true;
  const model::LinkGraph& links = tissue.links;
  std::atomic<std::size_t> outside{0};
  in_parallel(links.size(), 262144, [&](std::size_t begin, std::size_t end) {
    std::size_t own = 0;
    for (std::size_t link = begin; link < end; ++link) {
      const auto [a, b] = links.pairs[link];
      const Forward f =
          forward_of(frame.site_of(tissue.points.voxels[a]), frame.site_of(tissue.points.voxels[b]));
      if (!row_of(f)) ++own;
    }
    outside += own;
  });
  verdict.share_outside =
      static_cast<double>(outside) / static_cast<double>(std::max<std::size_t>(1, links.size()));
  verdict.lattice = verdict.share_outside <= most_outside;
  verdict.reason = verdict.lattice
                       ? (outside == 0 ? std::string("All links join neighbours on the lattice.")
                                       : percent(verdict.share_outside) +
                                             " of the links leave the lattice's neighbours, few enough.")
                       : percent(verdict.share_outside) +
                             " of the links leave the lattice's neighbours; above " + percent(most_outside) +
                             " explicit links are faster.";
  return verdict;
}

}  // namespace palpate::simulation
