#include "lattice_flags.hpp"
#include "lattice_layout.hpp"

#include <algorithm>
#include <cstdlib>
#include <set>
#include <vector>

namespace palpate::simulation {

namespace {

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
    schedule.bands.push_back({static_cast<std::uint32_t>(schedule.slabs.size()), y_begin, y_end});
    ++slab.chunks;
    y_begin = y_end;
  }
  schedule.most_chunks = std::max(schedule.most_chunks, slab.chunks);
  schedule.slabs.push_back(slab);
}

/// Who is the first to leave forces for a segment, and for which there are any:
/// so nothing need be cleared between passes.
void mark_first(const LatticeLayout& layout, LatticeSchedule& schedule) {
  std::vector<bool> has_forces(layout.segments + 2, false);
  for (auto& [segment, flags] : schedule.entries) {
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

}  // namespace

LatticeSchedule schedule_of(const LatticeLayout& layout, std::size_t segments_in_slab,
                            std::size_t chunks_in_slab) {
  LatticeSchedule schedule;
  schedule.chunks.push_back(0);
  const int planes = layout.size[2];
  const std::size_t rows_in_plane = index_of(layout.size[1]);
  const std::size_t slabs = std::max<std::size_t>(
      1, (layout.segments + segments_in_slab / 2) / std::max<std::size_t>(1, segments_in_slab));
  // A stage runs one slab behind the one before it, so that no link may span more.
  const int fewest_planes = planes_spanned(layout);
  int begin = 0;
  for (std::size_t slab = 0; slab < slabs && begin < planes; ++slab) {
    const std::size_t aim = layout.segments * (slab + 1) / slabs;
    int end = std::min(planes, begin + fewest_planes);
    while (end < planes && layout.row_begins[index_of(end) * rows_in_plane] - 1 < aim) ++end;
    if (slab + 1 == slabs) end = planes;
    add_slab(layout, begin, end, chunks_in_slab, schedule);
    begin = end;
  }
  mark_first(layout, schedule);
  return schedule;
}

LatticeNeeds needs_of(const LatticeSchedule& schedule, const LatticeLayout& layout) {
  const std::size_t count = schedule.bands.size();
  std::vector<std::set<std::uint32_t>> reached(count);
  for (const auto& slab : schedule.slabs)
    for (std::uint32_t chunk = slab.first_chunk; chunk < slab.first_chunk + slab.chunks; ++chunk) {
      const LatticeSchedule::Band& own = schedule.bands[chunk];
      for (std::uint32_t other = slab.first_chunk; other < count; ++other) {
        const LatticeSchedule::Band& band = schedule.bands[other];
        if (band.slab > own.slab + 1) break;
        if (band.y_begin > own.y_end || band.y_end < own.y_begin) continue;
        reached[chunk].insert(other);  // itself too: its pass before may still be under way
        reached[other].insert(chunk);
      }
    }
  if (!layout.overflow.empty()) {
    std::vector<std::uint32_t> chunk_of(layout.segments + 2, 0);
    for (std::uint32_t chunk = 0; chunk < count; ++chunk)
      for (std::uint32_t n = schedule.chunks[chunk]; n < schedule.chunks[chunk + 1]; ++n)
        if ((schedule.entries[n][1] & own_flag) != 0) chunk_of[schedule.entries[n][0]] = chunk;
    for (std::size_t segment = 1; segment <= layout.segments; ++segment)
      for (std::uint32_t n = layout.overflow_begins[segment]; n < layout.overflow_begins[segment + 1]; ++n) {
        const std::uint32_t other = chunk_of[layout.overflow[n].partner / layout.lanes];
        reached[chunk_of[segment]].insert(other);
        reached[other].insert(chunk_of[segment]);
      }
  }
  LatticeNeeds needs;
  for (std::uint32_t chunk = 0; chunk < count; ++chunk) {
    needs.begins.push_back(static_cast<std::uint32_t>(needs.chunks.size()));
    for (const std::uint32_t other : reached[chunk])
      needs.chunks.push_back(
          schedule.bands[other].slab < schedule.bands[chunk].slab ? other | LatticeNeeds::same_pass : other);
  }
  needs.begins.push_back(static_cast<std::uint32_t>(needs.chunks.size()));
  return needs;
}

}  // namespace palpate::simulation
