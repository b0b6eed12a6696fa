#pragma once

#include "palpate/model/tissue.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace palpate::simulation {

using LatticeSite = std::array<int, 3>;

/// The slots of kernels/lattice.cl: 0 along the row; three for each of the
/// rows (y+1, z) and (y, z+1); one, or three, for (y+1, z+1) and (y-1, z+1).
struct LatticeSlots {
  static constexpr unsigned most = 13;
  static constexpr std::uint32_t all = (1U << most) - 1U;
  std::uint32_t used = 0;  ///< a bit each
  unsigned stored() const noexcept;
  unsigned rank_of(unsigned slot) const noexcept;  ///< where a used one is stored
};

/// Where a link's rest length is kept.
struct LatticePlace {
  bool in_stencil = false;
  std::size_t rest = 0;                   ///< index into LatticeLayout::rest
  std::array<std::size_t, 2> overflow{};  ///< else: indices into LatticeLayout::overflow, both directions
};

/// A link outside the stencil, seen from one end, as the kernel reads it.
struct OverflowLink {
  std::uint32_t partner = 0;      ///< its lane: segment * lanes + lane
  float rest_length_mm = 0.0F;    ///< 0: does not act
  std::uint32_t apart_x_y = 0;    ///< sites from here to the partner: two signed numbers of 16 bits
  std::uint32_t apart_z_own = 0;  ///< a signed number of 16 bits, and the lane of this end above
};

/// A tissue on its lattice, cut into segments of `lanes` consecutive sites of a
/// row wherever there is a point. Segments are numbered from 1 in the order of
/// plane, row and place in the row; segment 0 and the one after the last stand
/// for what is not there. Pure; kernels/lattice.cl is what reads it.
struct LatticeLayout {
  unsigned lanes = 16;
  std::array<int, 3> axes{0, 1, 2};  ///< the image axis along rows, from row to row, from plane to plane
  std::size_t segments = 0;          ///< without the two that are not there
  std::array<int, 3> size{0, 0, 0};  ///< sites along the lattice's axes
  std::size_t blocks_in_row = 0;
  int shift = 0;  ///< sites that rows are moved by, so that fewer segments are cut

  std::vector<std::uint32_t> segment_at;     ///< [plane][row][block]; 0 where there is none
  std::vector<std::uint32_t> row_begins;     ///< first segment of a row (plane * rows + row), and one more
  std::vector<std::uint32_t> lane_of_point;  ///< segment * lanes + lane
  std::vector<std::array<std::uint32_t, 4>> rows;  ///< of segments + 2: those beside it, 0 for none
  std::vector<LatticeSite> first_sites;            ///< of segments + 2: of lane 0

  /// Vectors of the solver are in a frame along the lattice's axes; LPS where
  /// those are not at right angles (is_sheared).
  Eigen::Matrix3d to_lps = Eigen::Matrix3d::Identity();
  bool is_sheared = false;
  Eigen::Vector3d corner_mm = Eigen::Vector3d::Zero();  ///< of site 0 0 0, LPS, relative to the centre
  std::array<Eigen::Vector3d, 3> steps_mm;  ///< in that frame, from a site to the next; exact in float32

  LatticeSlots slots;
  std::vector<std::uint16_t>
      rest;  ///< [segments + 2][slots.stored()][lanes]; L = quantum n + offset, 0: none
  float rest_quantum_mm = 0.0F;
  float rest_offset_mm = 0.0F;
  std::vector<std::uint16_t> groups;  ///< of segments + 2: which rows have links, as the kernel's flags

  std::vector<std::uint32_t> overflow_begins;  ///< of segments + 3
  std::vector<OverflowLink> overflow;
  std::size_t links = 0;
  std::size_t links_in_overflow = 0;

  double lanes_per_point() const noexcept;
  LatticeSite site_of(std::uint32_t lane) const noexcept;
  /// LPS, relative to the centre. Where the lattice lies along LPS all sites are
  /// numbers that float32 holds.
  Eigen::Vector3d site_mm(std::uint32_t lane) const noexcept;
  std::uint16_t stored_length(float rest_length_mm) const noexcept;
  /// What the kernels make factor L of: a stored n stands for first n + second.
  std::array<float, 2> scaled_rest(double factor) const noexcept {
    return {static_cast<float>(factor * static_cast<double>(rest_quantum_mm)),
            static_cast<float>(factor * static_cast<double>(rest_offset_mm))};
  }
  LatticePlace place_of(std::uint32_t lane_a, std::uint32_t lane_b) const;
};

/// Throws Error(usage) where choose_layout() says no for want of a lattice.
LatticeLayout build_lattice(const model::Tissue& tissue, unsigned lanes);
/// The lanes a tissue would take with this width.
double lattice_lanes_per_point(const model::Tissue& tissue, unsigned lanes);

struct LayoutVerdict {
  bool lattice = false;
  bool possible = false;       ///< lattice could be had by asking for it
  std::string reason;          ///< for people
  double share_outside = 0.0;  ///< of the links, that join no lattice neighbours
};
/// What `auto` takes, and why.
LayoutVerdict choose_layout(const model::Tissue& tissue);

/// The lists of segments that the work-items of a launch go through.
struct LatticeSchedule {
  struct Slab {
    std::uint32_t first_chunk = 0;
    std::uint32_t chunks = 0;
  };
  std::vector<std::array<std::uint32_t, 2>> entries;  ///< segment and flags
  std::vector<std::uint32_t> chunks;                  ///< where each begins, and the end
  std::vector<Slab> slabs;
  std::uint32_t most_chunks = 0;  ///< of a slab
};
/// Slabs of whole planes with about `segments_in_slab` segments, each cut into
/// `chunks_in_slab` bands of rows that take equally long. No slab but the last
/// has fewer planes than a link spans.
LatticeSchedule schedule_of(const LatticeLayout& layout, std::size_t segments_in_slab,
                            std::size_t chunks_in_slab);

/// The lists that kernels/lattice_march.cl goes through: slabs of planes, cut into
/// bands of rows where there are too few of them to keep all cores at work. A turn
/// is passes_at_once passes over a band. In its nth pass a band is n times `rows_back`
/// rows further back, as far as links reach: so a pass needs of what came before
/// only its own band's and the band before's, and writes over nothing that the
/// next band still reads.
struct MarchSchedule {
  static constexpr std::size_t passes_at_once = 2;
  std::vector<std::array<std::uint32_t, 2>> entries;  ///< segment and flags
  /// Where each chunk begins, and the end: [nth pass of a turn][band][slab], or
  /// [slab] where there is one band.
  std::vector<std::uint32_t> chunks;
  std::size_t slabs = 0;
  std::size_t bands = 0;
  std::size_t turns_at_once = 1;  ///< cores that find work
  int rows_back = 1;
};
/// Slabs are of about `segments_in_slab` segments, but of no fewer planes than a link spans.
MarchSchedule march_schedule_of(const LatticeLayout& layout, std::size_t segments_in_slab, std::size_t cores);

}  // namespace palpate::simulation
