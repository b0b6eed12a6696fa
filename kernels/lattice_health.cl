// What the links of a lattice say of a run.
//
// Equation, per share of the segments, over links of rest length L0 > 0:
//   sums = (sum m |v|^2, sum m g.p, sum s (l - b L0)^2, max |dl/dt| / L0), LANES of each
//   the largest rate over links whose ends are both free alone
// Symbols     arguments                     units
//   x v       states, as in lattice.cl      mm, mm/s
//   L0        rest, overflow; L0 = q n + o  mm; quantum, offset
//   b         length_scale                  of the beat, 1 at rest
//   m g       factors where SCALED_MASS, else 1; gravity    1, mm/s^2
//   p         place relative to its site    mm
//   s         stiffness scale of a link: the mean of its ends' factors where SCALED_STIFFNESS
// Work-item: a share of the segments. Preconditions: as lattice.cl.
// CPU twin: Solver::link_health of simulation::make_reference_solver.
#include "lattice_links.cl"

typedef struct {
  Place place;
  Lanes free;     ///< 1 - selectance
  Lanes factors;  ///< of the material
} End;

End end_in(__global const Lanes* states, __global const Lanes* freedom, __global const Lanes* factors,
           const uint segment) {
  End result;
  result.place.x = loaded(states + 6 * segment);
  result.place.v = loaded(states + 6 * segment + 3);
  result.free = freedom[segment];
#ifdef SCALED_STIFFNESS
  result.factors = factors[segment];
#else
  result.factors = (Lanes)(1.0f);
#endif
  return result;
}

End next_end(const End own, const End next) {
  End result;
  result.place.x = pulled(own.place.x, next.place.x);
  result.place.v = pulled(own.place.v, next.place.v);
  result.free = NEXT_LANES(own.free, next.free);
  result.factors = NEXT_LANES(own.factors, next.factors);
  return result;
}

End previous_end(const End own, const End previous) {
  End result;
  result.place.x = pushed(own.place.x, previous.place.x);
  result.place.v = pushed(own.place.v, previous.place.v);
  result.free = PREVIOUS_LANES(own.free, previous.free);
  result.factors = PREVIOUS_LANES(own.factors, previous.factors);
  return result;
}

/// Adds a slot's links to the sums.
void add_links(const End a, const End b, const Stored rest, const float quantum, const float offset,
               const float length_scale, Lanes* elastic, Lanes* rate) {
  const Vector d = difference(b.place.x, a.place.x);
  const Lanes length = sqrt(dot_of(d, d));
  const Lanes rest_length = quantum * TO_LANES(rest) + offset;
  const Lanes stretch = length - length_scale * rest_length;
  const Lanes energy = 0.5f * (a.factors + b.factors) * stretch * stretch;
  const Lanes speed = fabs(dot_of(d, difference(b.place.v, a.place.v))) / max(length * rest_length, (Lanes)(1e-30f));
  const Truth acts = TO_WHOLE(rest) != (Whole)(0u);
  const Truth is_free = (a.free == (Lanes)(1.0f)) & (b.free == (Lanes)(1.0f));
  *elastic += acts ? energy : (Lanes)(0.0f);
  *rate = max(*rate, acts & is_free ? speed : (Lanes)(0.0f));
}

float4 overflow_sums(__global const float* states, __global const float* freedom, __global const float* factors,
                     const uint begin, const uint end, const uint segment, __global const uint4* overflow,
                     const float length_scale, const float4 step_x, const float4 step_y, const float4 step_z) {
  float4 result = (float4)(0.0f);
  for (uint n = begin; n < end; ++n) {
    const OverflowLink link = overflow_link(states, segment, overflow[n], step_x, step_y, step_z);
    if (link.rest_length == 0.0f) continue;
    const float length = sqrt(link.dx * link.dx + link.dy * link.dy + link.dz * link.dz);
    const float stretch = length - length_scale * link.rest_length;
    float stiffness = 1.0f;
#ifdef SCALED_STIFFNESS
    stiffness = 0.5f * (factors[link.own] + factors[link.other]);
#endif
    result.x += 0.5f * stiffness * stretch * stretch;  // each link is met from both ends
    if (freedom[link.own] != 1.0f || freedom[link.other] != 1.0f) continue;
    const float along = link.dx * link.ux + link.dy * link.uy + link.dz * link.uz;
    result.y = max(result.y, fabs(along) / max(length * link.rest_length, 1e-30f));
  }
  return result;
}

/// overflow_results: of each item the third and fourth over the links outside the stencil.
__kernel void link_health(__global const Lanes* restrict states, __global const Lanes* restrict freedom,
                          __global const Lanes* restrict factors, __global const Stored* restrict rest,
                          __global const uint4* restrict rows, __global const uint* restrict overflow_begins,
                          __global const uint4* restrict overflow, __global Lanes* restrict sums,
                          __global float4* restrict overflow_results, const uint segment_count, const uint share,
                          const uint item_count, const float quantum, const float offset, const float length_scale,
                          const float4 gravity, const float4 step_x, const float4 step_y, const float4 step_z) {
  const uint item = get_global_id(0);
  if (item >= item_count) return;
  const uint begin = min(item * share, segment_count) + 1;
  const uint end = min((item + 1) * share, segment_count) + 1;
  Lanes kinetic = (Lanes)(0.0f);
  Lanes weight = (Lanes)(0.0f);
  Lanes elastic = (Lanes)(0.0f);
  Lanes rate = (Lanes)(0.0f);
  float4 outside = (float4)(0.0f);
  for (uint segment = begin; segment < end; ++segment) {
    const End own = end_in(states, freedom, factors, segment);
#ifdef SCALED_MASS
    const Lanes mass = factors[segment];
#else
    const Lanes mass = (Lanes)(1.0f);
#endif
    kinetic += mass * dot_of(own.place.v, own.place.v);
    weight += mass * (own.place.x.x * gravity.x + own.place.x.y * gravity.y + own.place.x.z * gravity.z);
    End next = next_end(own, end_in(states, freedom, factors, segment + 1));
    next.place.x = moved(next.place.x, step_x);
    End previous = previous_end(own, end_in(states, freedom, factors, segment - 1));
    previous.place.x = moved(previous.place.x, -step_x);
    __global const Stored* lengths = rest + STORED_SLOTS * segment;
#define ADD(a, b, slot) \
  if (HAS(slot)) add_links(a, b, lengths[rank_of(slot)], quantum, offset, length_scale, &elastic, &rate);
    ADD(own, next, 0)
    const uint4 beside = rows[segment];
#define ADD_ROW(row, row_step, straight, ahead, behind)                                         \
  if (HAS(straight) | HAS(ahead) | HAS(behind)) {                                               \
    End there = end_in(states, freedom, factors, row);                                          \
    there.place.x = moved(there.place.x, row_step);                                             \
    ADD(own, there, straight)                                                                   \
    ADD(there, previous, ahead)                                                                 \
    ADD(there, next, behind)                                                                    \
  }
    ADD_ROW(beside.x, step_y, 1, 2, 3)
    ADD_ROW(beside.y, step_z, 4, 5, 6)
    ADD_ROW(beside.z, step_y + step_z, 7, 9, 10)
    ADD_ROW(beside.w, step_z - step_y, 8, 11, 12)
    const float4 more = overflow_sums((__global const float*)states, (__global const float*)freedom,
                                      (__global const float*)factors, overflow_begins[segment],
                                      overflow_begins[segment + 1], segment, overflow, length_scale, step_x,
                                      step_y, step_z);
    outside.x += more.x;
    outside.y = max(outside.y, more.y);
  }
  sums[4 * item] = kinetic;
  sums[4 * item + 1] = weight;
  sums[4 * item + 2] = elastic;
  sums[4 * item + 3] = rate;
  overflow_results[item] = outside;
}
