// How the lattice layout stores its links, for the kernels that read them.
//
// Symbols     arguments                      units
//   SLOTS     a bit for each slot that is used (lattice.cl); only those are stored
//   overflow  links that leave the stencil, from both ends: partner's segment
//             and lane; rest length; offset of its site as three signed numbers
//             of 16 bits; own lane            -, mm, sites, -
// Work-item: none; included by other kernels.
// CPU twin: LatticeLayout (lattice_layout.hpp).
#include "lanes.cl"

#define HAS(slot) ((SLOTS >> (slot)) & 1u)

/// Where a slot is stored: the used ones before it.
uint rank_of(const uint slot) {
  uint rank = 0;
#pragma unroll
  for (uint before = 0; before < 13; ++before)
    if (before < slot) rank += HAS(before);
  return rank;
}
#define STORED_SLOTS rank_of(13)

/// A link that leaves the stencil, as its own end sees it.
typedef struct {
  float rest_length;  ///< mm; 0 where it is cut
  float dx, dy, dz;   ///< to the partner, mm
  float ux, uy, uz;   ///< the partner's velocity, seen from here, mm/s
  uint lane;          ///< own
  uint own, other;    ///< segment times LANES and lane
} OverflowLink;

OverflowLink overflow_link(__global const float* source, const uint segment, const uint4 stored,
                           const float4 step_x, const float4 step_y, const float4 step_z) {
  OverflowLink link;
  link.rest_length = as_float(stored.y);
  link.lane = stored.w >> 16;
  link.own = segment * LANES + link.lane;
  link.other = stored.x;
  __global const float* own = source + segment * 6 * LANES + link.lane;
  __global const float* other = source + stored.x / LANES * 6 * LANES + stored.x % LANES;
  const float4 apart = (float)((int)(stored.z << 16) >> 16) * step_x + (float)((int)stored.z >> 16) * step_y +
                       (float)((int)(stored.w << 16) >> 16) * step_z;
  link.dx = other[0] - own[0] + apart.x;
  link.dy = other[LANES] - own[LANES] + apart.y;
  link.dz = other[2 * LANES] - own[2 * LANES] + apart.z;
  link.ux = other[3 * LANES] - own[3 * LANES];
  link.uy = other[4 * LANES] - own[4 * LANES];
  link.uz = other[5 * LANES] - own[5 * LANES];
  return link;
}

/// x y z of LANES lanes as vectors.
Vector vector_of(const float* sums) {
#if LANES == 1
  const Vector result = {sums[0], sums[1], sums[2]};
#elif LANES == 4
  const Vector result = {vload4(0, sums), vload4(1, sums), vload4(2, sums)};
#elif LANES == 8
  const Vector result = {vload8(0, sums), vload8(1, sums), vload8(2, sums)};
#else
  const Vector result = {vload16(0, sums), vload16(1, sums), vload16(2, sums)};
#endif
  return result;
}
