// One stage of a step over a lattice of points, every link evaluated once.
//
// Equation, for a link of rest length L between points i and j (physics.md),
// with d = x_j - x_i, l = |d|, r = 1/l, k and c per unit mass:
//   F_i = d [k + r (c r d.(v_j - v_i) - k L)] = -F_j, nothing where L = 0
//   a_i = sum of F_i - D v_i + g, and f = (v, a) times the freedom of i
// and then, by `mode` (S the source, B the base, T the target):
//   0  T = S + h f                     1  T = B + h f
//   2  T = (S2 + 2 S3 + S - B)/3 + h f, as B and differences from it: the end of RK4
//   3  v+ = v + h f.a, x+ = x + h free v+: symplectic Euler, Verlet with lagged velocity
//   4  x+ = x + h free (v + h/2 f.a), v+ = v + h f.a: velocity Verlet, first half
//   5  x+ = S.x, v+ = (B.v + S.v)/2 + h f.a: its second half
//
// The lattice's rows are cut into segments of LANES sites; there are segments
// only where there are points. A site without a point is a lane without links.
// Positions are kept relative to their site, which float32 likes better.
//
// Symbols     arguments                      units
//   S B T     source, base, target           mm, mm/s; x y z vx vy vz of LANES lanes a segment
//   S2 S3     second, third                  stages of RK4, as S
//   F so far  waiting                        mm/s^2; x y z a segment, as far as FIRST and WAITS say
//   L         rest: slots of a segment       L = q n + o, n = 0 for no link
//   k         stiffness                      1/s^2
//   k q, k o  rest_scale, rest_offset, half  mm/s^2 (times the beat's scale)
//   c         damping, a quarter             1/s
//   D g h     drag, gravity, h               1/s, mm/s^2, s
//   freedom   1 - selectance; 0 where there is no point or an anchor
//   factors   of the material, where one of SCALED_... is defined
//   step_x .. from a site to the next along a row, to the next row, to the next plane; mm
// Slots, from site (x, y, z): 0 (+1,0,0); 1 2 3 row (y+1, z) straight, ahead,
// behind; 4 5 6 row (y, z+1); 7 row (y+1, z+1); 8 row (y-1, z+1); 9 10 and 11 12
// ahead and behind in those two. Straight: same x; ahead: from our x-1 to their
// x; behind: from our x+1 to their x; kept in the lane of their x. SLOTS has a
// bit for each that is used; only those are stored. So only our own row is
// shifted by a lane, once for all rows beside it.
// Vectors are in the lattice's own frame, so that its steps are along x, y and
// z; where the lattice's axes are not at right angles (SHEARED) they are in LPS.
//
// Work-item: a chunk, a list of segments in the order of z, y, x. Forces on a
// segment from those before it wait in `waiting`; what leaves the chunk's own
// rows goes to a segment that nobody reads, and the chunk beside evaluates it
// again (entries without OWN). So nothing is shared and nothing is atomic, and
// every sum has one order.
// Preconditions: segment 0 and the one after the last are zero; a chunk ends with
// an entry without flags, which only completes the one before it; chunks of a
// launch own different rows; launches, or the tasks of lattice_march.cl, go
// through the slabs in order. The target may be the source where the step has one
// pass, a slab one chunk and nothing overflows: nobody looks at a place again
// once its forces are whole.
// CPU twin: simulation::make_reference_solver.
#include "lattice_links.cl"

#define OWN_ROW 1u
#define ROW(n) (2u << (n))
#define OWN 32u
#define WRITES(n) (64u << (n))
#define OVERFLOWS 1024u
#define FIRST(n) (2048u << (n))  // nothing waits in that row yet
#define WAITS 32768u             // something waits here

// Rows that have slots, and what a segment needs for the way without questions.
#define ROW_IF(n, slots) ((SLOTS & (slots)) != 0u ? ROW(n) | WRITES(n) : 0u)
#define WHOLE (ROW_IF(0, 0xEu) | ROW_IF(1, 0x70u) | ROW_IF(2, 0x680u) | ROW_IF(3, 0x1900u))
// Of the rows that leave forces in a row inside the tissue the one that comes first.
#define FIRST_ROW ((SLOTS & 0x680u) != 0u ? 2u : (SLOTS & 0x70u) != 0u ? 1u : (SLOTS & 0x1900u) != 0u ? 3u : 0u)
#define ANY_FIRST (15u * FIRST(0))

#if defined(SCALED_STIFFNESS) || defined(SCALED_DAMPING) || defined(SCALED_DRAG) || defined(SCALED_MASS)
#define SCALED
#endif

typedef struct {
  float stiffness, rest_scale, rest_offset, damping, step;
} Law;

#ifdef IMPLICIT
#include "implicit_lattice.cl"
#else
#define opposed difference

/// The force on a. Where both are at one place d is 0 and so is the force.
__attribute__((always_inline)) Vector force_of(const Place a, const Place b, const Lanes factor_a, const Lanes factor_b, const Stored rest,
                const Law law) {
  const Vector d = difference(b.x, a.x);
  const Lanes squared = d.x * d.x + (d.y * d.y + (d.z * d.z + 1e-30f));
#ifdef RSQRT_IS_EXACT
  const Lanes two_over_length = 2.0f * rsqrt(squared);
#else
  const Lanes rough = ROUGH_RSQRT(squared);
  const Lanes two_over_length = rough * (3.0f - squared * rough * rough);
#endif
  const Whole steps = TO_WHOLE(rest);
  const Lanes pull = law.rest_scale * TO_LANES(rest) + law.rest_offset;
#ifdef SCALED
#ifdef SCALED_STIFFNESS
  const Lanes stiffer = 0.5f * (factor_a + factor_b);
#else
  const Lanes stiffer = (Lanes)(1.0f);
#endif
  Lanes factor = stiffer * (law.stiffness - two_over_length * pull);
#ifndef UNDAMPED
  Lanes along = dot_of(d, difference(b.v, a.v));
#ifdef SCALED_DAMPING
  along *= 0.5f * (factor_a + factor_b);
#endif
  factor += law.damping * along * two_over_length * two_over_length;
#endif
#else
#ifdef UNDAMPED
  Lanes factor = law.stiffness - pull * two_over_length;
#else
  const Lanes along = dot_of(d, difference(b.v, a.v)) * two_over_length;
  Lanes factor = law.stiffness + (law.damping * along - pull) * two_over_length;
#endif
#endif
  factor = steps != (Whole)(0u) ? factor : (Lanes)(0.0f);
  const Vector force = {d.x * factor, d.y * factor, d.z * factor};
  return force;
}
#endif

Place place_in(__global const Lanes* restrict states, const uint segment) {
  Place result;
  result.x = loaded(states + 6 * segment);
#ifndef UNDAMPED
  result.v = loaded(states + 6 * segment + 3);
#else
  result.v = zero_vector();
#endif
  return result;
}

/// The place of each lane's next in the row, and of the one before it.
Place next_of(const Place own, const Place next) {
  Place result;
  result.x = pulled(own.x, next.x);
#ifndef UNDAMPED
  result.v = pulled(own.v, next.v);
#else
  result.v = own.v;
#endif
  return result;
}
Place previous_of(const Place own, const Place previous) {
  Place result;
  result.x = pushed(own.x, previous.x);
#ifndef UNDAMPED
  result.v = pushed(own.v, previous.v);
#else
  result.v = own.v;
#endif
  return result;
}

// Which components of a step are not zero.
#ifdef SHEARED
#define ALONG_X 7u
#define ALONG_Y 7u
#define ALONG_Z 7u
#else
#define ALONG_X 1u
#define ALONG_Y 2u
#define ALONG_Z 4u
#endif
Vector moved_by(const Vector x, const float4 by, const uint components) {
  Vector result = x;
  if (components & 1u) result.x += by.x;
  if (components & 2u) result.y += by.y;
  if (components & 4u) result.z += by.z;
  return result;
}

#ifdef SCALED
#define FACTORS_IN(segment) factors[segment]
#else
#define FACTORS_IN(segment) (Lanes)(1.0f)
#endif

/// A segment as its links see it.
typedef struct {
  Place next, previous;  ///< of each lane's point the one after and before it
  Lanes factors_here, factors_next, factors_previous;  ///< of the material
  Vector force;      ///< on the points
  Vector on_next;    ///< on each lane's next, turned round
  Vector on_previous;  ///< on the one before, turned round
} Work;

/// The links between the segment and the row whose sites beside it are in `row`.
__attribute__((always_inline)) void links_to_row(
    Work* work, __global const Lanes* source, __global const Lanes* factors, __global Lanes* waiting,
    __global const Stored* rest, const uint segment, const uint row, const uint target, const float4 row_step,
    const uint components, const uint straight, const uint ahead, const uint behind, const bool is_first,
    const Law law) {
  Place there = place_in(source, row);
  there.x = moved_by(there.x, row_step, components);
  const Lanes factors_there = FACTORS_IN(row);
  __global Lanes* sums = waiting + 3 * target;
  Vector on_them = is_first ? zero_vector() : loaded(sums);
  if (HAS(straight)) {
    const Vector force = force_of(there, place_in(source, segment), factors_there, work->factors_here,
                                  rest[rank_of(straight)], law);
    on_them = sum(on_them, force);
    work->force = opposed(work->force, force);
  }
  if (HAS(ahead)) {
    const Vector force =
        force_of(there, work->previous, factors_there, work->factors_previous, rest[rank_of(ahead)], law);
    on_them = sum(on_them, force);
    work->on_previous = sum(work->on_previous, force);
  }
  if (HAS(behind)) {
    const Vector force =
        force_of(there, work->next, factors_there, work->factors_next, rest[rank_of(behind)], law);
    on_them = sum(on_them, force);
    work->on_next = sum(work->on_next, force);
  }
  store(on_them, sums);
}

// Asks the processor's cache for lines that will be read or written soon: its own foresight follows
// straight runs within one page, and a segment's numbers are in ten places. 12 % at 216 thousand points.
#define SEGMENTS_AHEAD 2u
#if LANES > 1 && defined(__has_builtin)
#if __has_builtin(__builtin_prefetch)
#define WILL_USE(from, bytes)                                         \
  _Pragma("unroll") for (size_t line = 0; line < (bytes); line += 64) \
    __builtin_prefetch((const void*)((size_t)(from) + line));
#endif
#endif
#ifndef WILL_USE
#define WILL_USE(from, bytes)
#endif
#ifdef UNDAMPED
#define SEEN 3u  // of the six numbers of a place, those that links look at
#else
#define SEEN 6u
#endif

#ifndef IMPLICIT
/// Links that leave the stencil, one by one.
Vector overflow_links(__global const float* restrict source, __global const float* restrict factors,
                      const uint segment, const uint begin, const uint end, __global const uint4* restrict overflow,
                      const float4 step_x, const float4 step_y, const float4 step_z, const float length_scale,
                      const Law law) {
  float sums[3 * LANES];
  for (uint n = 0; n < 3 * LANES; ++n) sums[n] = 0.0f;
  for (uint n = begin; n < end; ++n) {
    const OverflowLink link = overflow_link(source, segment, overflow[n], step_x, step_y, step_z);
    if (link.rest_length == 0.0f) continue;
    const float over_length = rsqrt(link.dx * link.dx + link.dy * link.dy + link.dz * link.dz + 1e-30f);
    float elastic = law.stiffness * (1.0f - length_scale * link.rest_length * over_length);
    float viscous = 4.0f * law.damping * over_length * over_length *
                    (link.dx * link.ux + link.dy * link.uy + link.dz * link.uz);
#ifdef SCALED
    const float mean = 0.5f * (factors[link.own] + factors[link.other]);
#ifdef SCALED_STIFFNESS
    elastic *= mean;
#endif
#ifdef SCALED_DAMPING
    viscous *= mean;
#endif
#endif
    const float factor = elastic + viscous;
    sums[link.lane] += link.dx * factor;
    sums[LANES + link.lane] += link.dy * factor;
    sums[2 * LANES + link.lane] += link.dz * factor;
  }
  return vector_of(sums);
}

/// Writes the segment's target, once all its forces are known. `drag` is per unit of the point's mass;
/// all_free: nothing is held and there is no gravity.
__attribute__((always_inline)) void advance(const uint segment, Vector a, const Lanes free, __global const Lanes* source,
             __global const Lanes* base, __global const Lanes* second, __global const Lanes* third,
             __global Lanes* target, const Lanes drag, const Lanes over_mass, const float4 gravity, const float h,
             const uint mode, const uint all_free) {
  const Vector x = loaded(source + 6 * segment);
  const Vector v = loaded(source + 6 * segment + 3);
  a.x = over_mass * a.x - drag * v.x;
  a.y = over_mass * a.y - drag * v.y;
  a.z = over_mass * a.z - drag * v.z;
  if (!all_free) {
    a.x = free * (a.x + gravity.x);
    a.y = free * (a.y + gravity.y);
    a.z = free * (a.z + gravity.z);
  }
  const Lanes step = (Lanes)(h);
  const Lanes free_step = h * free;
  Vector new_x;
  Vector new_v;
  if (mode == 0) {
    new_x = step_along(x, free_step, v);
    new_v = step_along(v, step, a);
  } else if (mode == 1) {
    new_x = step_along(loaded(base + 6 * segment), free_step, v);
    new_v = step_along(loaded(base + 6 * segment + 3), step, a);
  } else if (mode == 2) {
    const Vector y_x = loaded(base + 6 * segment);
    const Vector y_v = loaded(base + 6 * segment + 3);
    const Vector d2_x = difference(loaded(second + 6 * segment), y_x);
    const Vector d2_v = difference(loaded(second + 6 * segment + 3), y_v);
    const Vector d3_x = difference(loaded(third + 6 * segment), y_x);
    const Vector d3_v = difference(loaded(third + 6 * segment + 3), y_v);
    const Vector mean_x = step_along(sum(d2_x, difference(x, y_x)), (Lanes)(2.0f), d3_x);
    const Vector mean_v = step_along(sum(d2_v, difference(v, y_v)), (Lanes)(2.0f), d3_v);
    const Lanes third_part = (Lanes)(1.0f / 3.0f);
    const Vector by_x = step_along(zero_vector(), free_step, v);
    const Vector by_v = step_along(zero_vector(), step, a);
    new_x = sum(y_x, step_along(by_x, third_part, mean_x));
    new_v = sum(y_v, step_along(by_v, third_part, mean_v));
  } else if (mode == 3) {
    new_v = step_along(v, step, a);
    new_x = step_along(x, free_step, new_v);
  } else if (mode == 4) {
    new_v = step_along(v, step, a);
    new_x = step_along(x, free_step, step_along(v, 0.5f * step, a));
  } else {
    const Vector mean = step_along(v, (Lanes)(1.0f), loaded(base + 6 * segment + 3));
    new_x = x;
    new_v = step_along(step_along(zero_vector(), (Lanes)(0.5f), mean), step, a);
  }
  store(new_x, target + 6 * segment);
  store(new_v, target + 6 * segment + 3);
}

#endif
/// One chunk of a stage: its entries from begin to end.
__attribute__((always_inline)) void walk(
    __global const Lanes* source, __global const Lanes* base, __global const Lanes* second,
    __global const Lanes* third, __global Lanes* target, __global Lanes* waiting,
    __global const Stored* restrict rest, __global const uint4* restrict rows,
    __global const uint2* restrict entries, const uint begin, const uint end,
    __global const uint* restrict overflow_begins, __global const uint4* restrict overflow,
    __global const Lanes* restrict freedom, __global const Lanes* restrict factors, const uint trash,
    const uint all_free, const uint mode, const float h, const float stiffness, const float rest_scale,
    const float rest_offset, const float damping, const float length_scale, const float drag,
    const float4 gravity, const float over_mass, const float4 step_x, const float4 step_y, const float4 step_z) {
  const Law law = {stiffness, rest_scale, rest_offset, damping, h};
  // Of the segment before: its forces but for those that this one's first lane has on its last.
  Vector pending = zero_vector();
  Vector on_previous = zero_vector();
  Vector on_next = zero_vector();
  uint previous = 0;
  uint previous_flags = 0;
  for (uint n = begin; n < end; ++n) {
    const uint segment = entries[n].x;
    const uint flags = entries[n].y;
    __global const Stored* lengths = rest + STORED_SLOTS * segment;
    Work work;
    const Place here = place_in(source, segment);
    work.factors_here = FACTORS_IN(segment);
    if (HAS(0) | HAS(3) | HAS(6) | HAS(10) | HAS(12)) {
      work.next = next_of(here, place_in(source, segment + 1));
      work.next.x = moved_by(work.next.x, step_x, ALONG_X);
      work.factors_next = NEXT_LANES(work.factors_here, FACTORS_IN(segment + 1));
    }
    if (HAS(2) | HAS(5) | HAS(9) | HAS(11)) {
      work.previous = previous_of(here, place_in(source, segment - 1));
      work.previous.x = moved_by(work.previous.x, -step_x, ALONG_X);
      work.factors_previous = PREVIOUS_LANES(work.factors_here, FACTORS_IN(segment - 1));
    }
    work.on_previous = zero_vector();
    if (HAS(0)) {
      work.force = force_of(here, work.next, work.factors_here, work.factors_next, lengths[rank_of(0)], law);
      work.on_next = work.force;
    } else {
      work.force = zero_vector();
      work.on_next = zero_vector();
    }
    const uint4 beside = rows[segment];
    WILL_USE(lengths + SEGMENTS_AHEAD * STORED_SLOTS, STORED_SLOTS * sizeof(Stored))
    WILL_USE(source + 6 * (beside.z + SEGMENTS_AHEAD), SEEN * sizeof(Lanes))
    WILL_USE(waiting + 3 * (beside.z + SEGMENTS_AHEAD), 3 * sizeof(Lanes))
    const uint soon = 6 * (segment + SEGMENTS_AHEAD);
    WILL_USE(target + soon, 6 * sizeof(Lanes))
    if (mode == 1 || mode == 2 || mode == 5) {
      WILL_USE(base + soon, 6 * sizeof(Lanes))
    }
    if (mode == 2) {
      WILL_USE(second + soon, 6 * sizeof(Lanes))
      WILL_USE(third + soon, 6 * sizeof(Lanes))
    }
#define DO_ROW(target, is_first, component, row_step, components, straight, ahead, behind)                        \
  links_to_row(&work, source, factors, waiting, lengths, segment, beside.component, target, row_step, components, \
               straight, ahead, behind, is_first, law);
#define DO_ROW_IF(index, component, row_step, components, straight, ahead, behind)          \
  if ((HAS(straight) | HAS(ahead) | HAS(behind)) && (flags & ROW(index)))                   \
    DO_ROW(flags& WRITES(index) ? beside.component : trash, (flags & FIRST(index)) != 0u,   \
           component, row_step, components, straight, ahead, behind)
    if ((flags & (WHOLE | ANY_FIRST)) == (WHOLE | FIRST(FIRST_ROW))) {
      if (HAS(1) | HAS(2) | HAS(3)) DO_ROW(beside.x, FIRST_ROW == 0u, x, step_y, ALONG_Y, 1, 2, 3)
      if (HAS(4) | HAS(5) | HAS(6)) DO_ROW(beside.y, FIRST_ROW == 1u, y, step_z, ALONG_Z, 4, 5, 6)
      if (HAS(7) | HAS(9) | HAS(10))
        DO_ROW(beside.z, FIRST_ROW == 2u, z, step_y + step_z, ALONG_Y | ALONG_Z, 7, 9, 10)
      if (HAS(8) | HAS(11) | HAS(12))
        DO_ROW(beside.w, FIRST_ROW == 3u, w, step_z - step_y, ALONG_Y | ALONG_Z, 8, 11, 12)
    } else {
      DO_ROW_IF(0, x, step_y, ALONG_Y, 1, 2, 3)
      DO_ROW_IF(1, y, step_z, ALONG_Z, 4, 5, 6)
      DO_ROW_IF(2, z, step_y + step_z, ALONG_Y | ALONG_Z, 7, 9, 10)
      DO_ROW_IF(3, w, step_z - step_y, ALONG_Y | ALONG_Z, 8, 11, 12)
    }
    if (!(flags & OWN)) {  // its neighbours in the row may not be in the list
      work.on_next = zero_vector();
      work.on_previous = zero_vector();
    }
    if (previous_flags & OWN) {
      Vector force = opposed(pending, pulled(on_previous, work.on_previous));
      if (previous_flags & WAITS) force = sum(force, loaded(waiting + 3 * previous));
      if (previous_flags & OVERFLOWS)
        force = sum(force, overflow_links((__global const float*)source, (__global const float*)factors, previous,
                                          overflow_begins[previous], overflow_begins[previous + 1], overflow,
                                          step_x, step_y, step_z, length_scale, law));
      const Lanes free = all_free ? (Lanes)(1.0f) : freedom[previous];
#ifdef SCALED_DRAG
      const Lanes own_drag = drag * FACTORS_IN(previous);
#else
      const Lanes own_drag = (Lanes)(drag);
#endif
#ifdef SCALED_MASS
      const Lanes inverse_mass = over_mass / FACTORS_IN(previous);
#else
      const Lanes inverse_mass = (Lanes)(over_mass);
#endif
      advance(previous, force, free, source, base, second, third, target, own_drag * inverse_mass, inverse_mass, gravity, h, mode,
              all_free);
    }
    pending = opposed(work.force, pushed(work.on_next, on_next));
    on_next = work.on_next;
    on_previous = work.on_previous;
    previous = segment;
    previous_flags = flags;
  }
}

#ifndef MARCH
__kernel void sweep(__global const Lanes* source, __global const Lanes* base,
                    __global const Lanes* second, __global const Lanes* third, __global Lanes* target,
                    __global Lanes* waiting, __global const Stored* restrict rest,
                    __global const uint4* restrict rows, __global const uint2* restrict entries,
                    __global const uint* restrict chunks, __global const uint* restrict overflow_begins,
                    __global const uint4* restrict overflow, __global const Lanes* restrict freedom,
                    __global const Lanes* restrict factors, const uint first_chunk, const uint chunk_count,
                    const uint first_trash, const uint all_free, const uint mode, const float h,
                    const float stiffness, const float rest_scale, const float rest_offset, const float damping,
                    const float length_scale, const float drag, const float4 gravity, const float over_mass,
                    const float4 step_x, const float4 step_y, const float4 step_z) {
  // The second group does nothing: PoCL gives a core one group more than its
  // share of what is left, so that one of two cores would get both of two chunks.
  const uint group = get_global_id(0);
  const uint own_chunk = group > 1 ? group - 1 : group;
  if (group == 1 || own_chunk >= chunk_count) return;
  const uint chunk = first_chunk + own_chunk;
  walk(source, base, second, third, target, waiting, rest, rows, entries, chunks[chunk], chunks[chunk + 1],
       overflow_begins, overflow, freedom, factors, first_trash + own_chunk, all_free, mode, h, stiffness,
       rest_scale, rest_offset, damping, length_scale, drag, gravity, over_mass, step_x, step_y, step_z);
}
#endif
