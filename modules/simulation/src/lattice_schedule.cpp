#include "lattice_flags.hpp"
#include "lattice_layout.hpp"

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace palpate::simulation {

namespace {

using Entries = std::vector<std::array<std::uint32_t, 2>>;

std::size_t index_of(int value) noexcept { return static_cast<std::size_t>(value); }

/// The bands of rows of one slab: chunk by chunk the segments, with those of
/// the rows beside whose forces reach into the band.
void add_slab(const LatticeLayout& layout, int z_begin, int z_end, std::size_t chunks_in_slab,
              LatticeSchedule& schedule) {
  const int rows_in_plane = layout.size[1];
  const auto row_range = [&](int y, int z) {
    const std::size_t row = index_of(z) * index_of(rows_in_plane) + index_of(y);
    return std::pair(layout.row_begins[row], layout.row_begins[row + 1]);
  };
  std::vector<std::size_t> before(index_of(rows_in_plane) + 1, 0);
  for (int y = 0; y < rows_in_plane; ++y) {
    std::size_t count = 0;
    for (int z = z_begin; z < z_end; ++z) count += row_range(y, z).second - row_range(y, z).first;
    before[index_of(y) + 1] = before[index_of(y)] + count;
  }
  const std::size_t total = before.back();
  if (total == 0) return;
  LatticeSchedule::Slab slab{static_cast<std::uint32_t>(schedule.chunks.size() - 1), 0};
  int y_begin = 0;
  for (std::size_t chunk = 0; chunk < chunks_in_slab; ++chunk) {
    const std::size_t aim = total * (chunk + 1) / chunks_in_slab;
    int y_end = y_begin;
    const auto is_empty = [&] { return before[index_of(y_end)] == before[index_of(y_begin)]; };
    // The boundary nearest to the even share, but not before there is a segment.
    while (y_end < rows_in_plane && before[index_of(y_end)] < aim &&
           (is_empty() || 2 * aim > before[index_of(y_end)] + before[index_of(y_end) + 1]))
      ++y_end;
    if (chunk + 1 == chunks_in_slab) y_end = rows_in_plane;
    if (is_empty()) continue;
    for (int z = z_begin; z < z_end; ++z)
      for (int y = std::max(0, y_begin - 1); y < std::min(rows_in_plane, y_end + 1); ++y) {
        // Row 0 and 2 lie a row on, row 3 a row back.
        const std::array<int, 4> reached{y + 1, y, y + 1, y - 1};
        std::uint32_t writes = 0;
        std::uint32_t reads = 0;
        for (std::size_t n = 0; n < 4; ++n)
          if (reached[n] >= y_begin && reached[n] < y_end) {
            writes |= writes_flag(n);
            reads |= row_flag(n);
          }
        const bool is_own = y >= y_begin && y < y_end;
        const std::uint32_t kept = is_own ? ~0U : reads | writes;
        const auto [first, last] = row_range(y, z);
        for (std::uint32_t segment = first; segment < last; ++segment) {
          const std::uint32_t flags = (layout.groups[segment] | writes | (is_own ? own_flag : 0U)) & kept;
          if (is_own || (flags & reads) != 0) schedule.entries.push_back({segment, flags});
        }
      }
    schedule.entries.push_back({schedule.entries.back()[0], 0});  // completes the last one
    schedule.chunks.push_back(static_cast<std::uint32_t>(schedule.entries.size()));
    ++slab.chunks;
    y_begin = y_end;
  }
  schedule.most_chunks = std::max(schedule.most_chunks, slab.chunks);
  schedule.slabs.push_back(slab);
}

/// Who is the first to leave forces for a segment, and for which there are any:
/// so nothing need be cleared between passes.
void mark_first(const LatticeLayout& layout, Entries::iterator begin, Entries::iterator end) {
  std::vector<bool> has_forces(layout.segments + 2, false);
  for (auto entry = begin; entry != end; ++entry) {
    auto& [segment, flags] = *entry;
    for (std::size_t row = 0; row < 4; ++row) {
      if ((flags & row_flag(row)) == 0) continue;
      if ((flags & writes_flag(row)) == 0) {
        flags |= first_flag(row);  // goes where nobody reads
        continue;
      }
      const std::uint32_t target = layout.rows[segment][row];
      if (!has_forces[target]) flags |= first_flag(row);
      has_forces[target] = true;
    }
    if ((flags & own_flag) != 0 && has_forces[segment]) flags |= waits_flag;
  }
}

/// The planes that a link may span: one by the stencil, more in the overflow.
int planes_spanned(const LatticeLayout& layout) {
  int most = 1;
  for (const OverflowLink& link : layout.overflow)
    most = std::max(most, std::abs(static_cast<int>(static_cast<std::int16_t>(link.apart_z_own & 0xffffU))));
  return most;
}

/// The rows that a link may span: one by the stencil, more in the overflow.
int rows_spanned(const LatticeLayout& layout) {
  int most = 1;
  for (const OverflowLink& link : layout.overflow)
    most = std::max(most, std::abs(static_cast<int>(static_cast<std::int16_t>(link.apart_x_y >> 16U))));
  return most;
}

/// Where slabs of about so many segments begin, and the end.
std::vector<int> slab_planes(const LatticeLayout& layout, std::size_t segments_in_slab) {
  const int planes = layout.size[2];
  const std::size_t rows_in_plane = index_of(layout.size[1]);
  const std::size_t slabs = std::max<std::size_t>(
      1, (layout.segments + segments_in_slab / 2) / std::max<std::size_t>(1, segments_in_slab));
  // A stage runs one slab behind the one before it, so that no link may span more.
  const int fewest_planes = planes_spanned(layout);
  std::vector<int> begins{0};
  for (std::size_t slab = 0; slab < slabs && begins.back() < planes; ++slab) {
    const std::size_t aim = layout.segments * (slab + 1) / slabs;
    int end = std::min(planes, begins.back() + fewest_planes);
    while (end < planes && layout.row_begins[index_of(end) * rows_in_plane] - 1 < aim) ++end;
    if (slab + 1 == slabs) end = planes;
    begins.push_back(end);
  }
  return begins;
}

/// A band that moves back must not pass the one before it, nor reach beyond it.
int fewest_rows_in_band(int rows_back) {
  return static_cast<int>(MarchSchedule::passes_at_once) * rows_back + 1;
}

/// Where bands of rows with about as many segments each begin, and the end.
std::vector<int> band_rows(const LatticeLayout& layout, std::size_t bands, int fewest_rows) {
  const int rows = layout.size[1];
  std::vector<std::size_t> before(index_of(rows) + 1, 0);
  for (int y = 0; y < rows; ++y) {
    before[index_of(y) + 1] = before[index_of(y)];
    for (int z = 0; z < layout.size[2]; ++z) {
      const std::size_t row = index_of(z) * index_of(rows) + index_of(y);
      before[index_of(y) + 1] += layout.row_begins[row + 1] - layout.row_begins[row];
    }
  }
  std::vector<int> begins{0};
  for (std::size_t band = 1; band < bands; ++band) {
    const auto at = std::lower_bound(before.begin(), before.end(), layout.segments * band / bands);
    const int y = std::max(static_cast<int>(at - before.begin()), begins.back() + fewest_rows);
    if (y + fewest_rows > rows) break;
    begins.push_back(y);
  }
  begins.push_back(rows);
  return begins;
}

/// The list of a chunk: the band's rows in each plane of the slab, and the row
/// behind it for its links back into the band, which the next band comes to late.
void add_band(const LatticeLayout& layout, int z_begin, int z_end, int y_begin, int y_end, Entries& entries) {
  const int rows = layout.size[1];
  const std::size_t begin = entries.size();
  for (int z = z_begin; z < z_end; ++z)
    for (int y = y_begin; y < std::min(rows, y_end + 1); ++y) {
      const bool is_own = y < y_end;
      const std::uint32_t writes = writes_flag(0) | writes_flag(1) | writes_flag(2);
      const std::uint32_t back = y > y_begin ? writes_flag(3) : 0U;  // row 3 lies a row back
      const std::size_t row = index_of(z) * index_of(rows) + index_of(y);
      for (std::uint32_t segment = layout.row_begins[row]; segment < layout.row_begins[row + 1]; ++segment) {
        const std::uint32_t links = layout.groups[segment];
        if (is_own)
          entries.push_back({segment, links | writes | back | own_flag});
        else if ((links & row_flag(3)) != 0)
          entries.push_back({segment, row_flag(3) | back});
      }
    }
  if (entries.size() > begin) entries.push_back({entries.back()[0], 0});  // completes the last one
}

}  // namespace

LatticeSchedule schedule_of(const LatticeLayout& layout, std::size_t segments_in_slab,
                            std::size_t chunks_in_slab) {
  LatticeSchedule schedule;
  schedule.chunks.push_back(0);
  const std::vector<int> planes = slab_planes(layout, segments_in_slab);
  for (std::size_t slab = 0; slab + 1 < planes.size(); ++slab)
    add_slab(layout, planes[slab], planes[slab + 1], chunks_in_slab, schedule);
  mark_first(layout, schedule.entries.begin(), schedule.entries.end());
  return schedule;
}

MarchSchedule march_schedule_of(const LatticeLayout& layout, std::size_t segments_in_slab,
                                std::size_t cores) {
  MarchSchedule schedule;
  schedule.rows_back = rows_spanned(layout);
  const int rows = layout.size[1];
  const std::vector<int> planes = slab_planes(layout, segments_in_slab);
  schedule.slabs = planes.size() - 1;
  // A turn's first pass is at least a slab behind its predecessor's last one.
  constexpr std::size_t slabs_apart = MarchSchedule::passes_at_once + 2;
  const std::size_t wanted = (cores * slabs_apart + schedule.slabs) / (schedule.slabs + 1);
  const std::vector<int> cuts = band_rows(layout, wanted, fewest_rows_in_band(schedule.rows_back));
  schedule.bands = cuts.size() - 1;
  schedule.turns_at_once = std::clamp<std::size_t>(schedule.bands * (schedule.slabs + 1) / slabs_apart, 1,
                                                   std::max<std::size_t>(1, cores));
  schedule.chunks.push_back(0);
  // One band goes nowhere, and its lists are the same in each pass.
  const std::size_t lists = schedule.bands == 1 ? 1 : MarchSchedule::passes_at_once;
  for (std::size_t pass = 0; pass < lists; ++pass) {
    const std::size_t pass_begin = schedule.entries.size();
    const int back = static_cast<int>(pass) * schedule.rows_back;
    for (std::size_t band = 0; band < schedule.bands; ++band) {
      const int y_begin = band == 0 ? 0 : cuts[band] - back;
      const int y_end = band + 1 == schedule.bands ? rows : cuts[band + 1] - back;
      for (std::size_t slab = 0; slab < schedule.slabs; ++slab) {
        add_band(layout, planes[slab], planes[slab + 1], y_begin, y_end, schedule.entries);
        schedule.chunks.push_back(static_cast<std::uint32_t>(schedule.entries.size()));
      }
    }
    mark_first(layout, schedule.entries.begin() + static_cast<std::ptrdiff_t>(pass_begin),
               schedule.entries.end());
  }
  return schedule;
}

}  // namespace palpate::simulation
