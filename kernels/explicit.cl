// Point masses joined by explicit spring-damper links: the explicit integrators.
//
// Equation (thesis 3.1, 3.2), with d = x_j - x_i, l = |d|, n = d/l:
//   a_i  = (sum_j n [ k (l - s L0) + c n.(v_j - v_i) ] - D v_i)/m + g
//   f    = freedom: 1 - selectance; 0 for an anchor
// A link with L0 = 0 (cut, or a column's unused end) and a link whose ends
// coincide give no force. Where the material is scaled by factors w, k and c of
// a link count (w_i + w_j)/2 times, D and m of a point w_i times; SCALED_* say
// which, and w rides in positions.w, which every kernel hands on.
// Every scheme is made of three kernels, a step being h:
//   stage    target = base + (h f (v + lead f a), h f a), v and a of the source
//   finish   y = (s2 + 2 s3 + s4 - y)/3 + h f (v, a)(s4)
//   correct  y = (x(s2), (v + v(s2))/2 + h f a(s2))
// Euler: stage(h, lead 0). Symplectic Euler, and Verlet in position form with
// v = (x - x_before)/h: stage(h, lead h). Velocity Verlet: s2 = stage(h, lead
// h/2), correct(h/2): the second force is at the new place with the velocity
// predicted, v + h a, so that damping is of second order too. RK4 without
// accumulators: s2 = stage(h/2), s3 = stage of s2 (h/2), s4 = stage of s3 (h),
// finish(h/6), summed as differences from y, which lose nothing to rounding.
// finish and correct write over y: a work-item reads y of its own points only.
//
// Symbols     arguments               units
//   x, v      *_positions, *_velocities  mm, mm/s (xyz)
//   j, L0     partners, rest_lengths  index, mm; places as explicit_lanes.cl says
//   k/m, c/m, D/m   stiffness, damping, drag  1/s^2, 1/s, 1/s
//   s k/m     rest_stiffness          1/s^2; s is the beat's rest_scale_at(t)
//   g         gravity (xyz)           mm/s^2
//   f         freedom                 0 held .. 1 free
//   h, lead   h, lead                 s
// Work-item: POINTS_PER_ITEM consecutive points, a lane each (explicit_lanes.cl,
// which names the defines).
// Preconditions: point_count, the length of all arrays, is a multiple of
// COLUMN_BLOCK (points that fill it up have freedom 0 and no links); partners
// < point_count; the source state is not the target.
// CPU twin: simulation::make_reference_solver.
#include "explicit_lanes.cl"

/// f a, in all lanes, and f v.
typedef struct {
  Vectors velocity;
  Vectors acceleration;
} Derivatives;

#define LINK_ARGUMENTS                                                                                \
  __global const uint *restrict partners, __global const float *restrict rest_lengths,               \
      __global const float *restrict freedom, const uint point_count, const float stiffness,         \
      const float rest_stiffness, const float damping, const float drag, const float4 gravity
#define LINKS partners, rest_lengths, freedom, point_count, stiffness, rest_stiffness, damping, drag, gravity

Derivatives derivatives_at(__global const float4* restrict positions, __global const float4* restrict velocities,
                           const uint first, LINK_ARGUMENTS) {
  const Vectors x = loaded(positions + first);
  const Vectors v = loaded(velocities + first);
#ifdef SCALED_DRAG
  const Lanes own_drag = drag * x.w;
#else
  const float own_drag = drag;
#endif
  Vectors a;
  a.x = -own_drag * v.x;
  a.y = -own_drag * v.y;
  a.z = -own_drag * v.z;
  for (uint slot = 0; slot < LINKS_PER_POINT; ++slot) {
    const Indices partner = LOAD(partners + COLUMN(slot, first));
    const Lanes rest_length = LOAD(rest_lengths + COLUMN(slot, first));
    const Vectors there = gathered(positions, partner);
    const Vectors speed = gathered(velocities, partner);
    const Lanes dx = there.x - x.x;
    const Lanes dy = there.y - x.y;
    const Lanes dz = there.z - x.z;
    const Lanes squared = dx * dx + dy * dy + dz * dz;
    const Lanes along = dx * (speed.x - v.x) + dy * (speed.y - v.y) + dz * (speed.z - v.z);
    // Below 1e-15 mm the direction means nothing; coincident ends have d = 0 and so no force.
    const Lanes inverse = rsqrt(max(squared, 1e-30f));
#ifdef SCALED
    const Lanes mean = 0.5f * (x.w + there.w);
    Lanes spring = stiffness - inverse * (rest_stiffness * rest_length);
    Lanes damper = damping * along * inverse * inverse;
#ifdef SCALED_STIFFNESS
    spring *= mean;
#endif
#ifdef SCALED_DAMPING
    damper *= mean;
#endif
    const Lanes pull = spring + damper;
#else
    const Lanes pull = stiffness - inverse * (rest_stiffness * rest_length - damping * along * inverse);
#endif
    const Lanes factor = rest_length > 0.0f ? pull : (Lanes)(0.0f);
    a.x += dx * factor;
    a.y += dy * factor;
    a.z += dz * factor;
  }
#ifdef SCALED_MASS
  const Lanes by_mass = 1.0f / x.w;
  a.x *= by_mass;
  a.y *= by_mass;
  a.z *= by_mass;
#endif
  const Lanes free = LOAD(freedom + first);
  Derivatives result;
  result.velocity.x = free * v.x;
  result.velocity.y = free * v.y;
  result.velocity.z = free * v.z;
  result.acceleration.x = free * (a.x + gravity.x);
  result.acceleration.y = free * (a.y + gravity.y);
  result.acceleration.z = free * (a.z + gravity.z);
  return result;
}

#define VECTOR_OF(vectors, n) (float4)(LANE((vectors).x, n), LANE((vectors).y, n), LANE((vectors).z, n), 0.0f)

// target = base + (h f (v + lead f a), h f a)
__kernel void stage(__global const float4* restrict source_positions, __global const float4* restrict source_velocities,
                    __global const float4* restrict base_positions, __global const float4* restrict base_velocities,
                    __global float4* restrict target_positions, __global float4* restrict target_velocities,
                    LINK_ARGUMENTS, const float h, const float lead) {
  const uint first = get_global_id(0) * POINTS_PER_ITEM;
  if (first >= point_count) return;
  Derivatives d = derivatives_at(source_positions, source_velocities, first, LINKS);
  const Lanes ahead = lead * LOAD(freedom + first);
  d.velocity.x += ahead * d.acceleration.x;
  d.velocity.y += ahead * d.acceleration.y;
  d.velocity.z += ahead * d.acceleration.z;
#define WRITE(n)                                                                                             \
  target_positions[first + 0x##n] = base_positions[first + 0x##n] + h * VECTOR_OF(d.velocity, n);           \
  target_velocities[first + 0x##n] = base_velocities[first + 0x##n] + h * VECTOR_OF(d.acceleration, n);
  EACH_LANE(WRITE)
#undef WRITE
}

/// (s2 + 2 s3 + s4 - y)/3 + hf, as y and differences from it.
float4 finished(const float4 y, const float4 s2, const float4 s3, const float4 s4, const float4 hf) {
  return y + (((s2 - y) + 2.0f * (s3 - y) + (s4 - y)) * (1.0f / 3.0f) + hf);
}

// y = (s2 + 2 s3 + s4 - y)/3 + h f (v, a)(s4); h is a sixth of a step.
__kernel void finish(__global const float4* restrict s4_positions, __global const float4* restrict s4_velocities,
                     __global const float4* restrict s3_positions, __global const float4* restrict s3_velocities,
                     __global const float4* restrict s2_positions, __global const float4* restrict s2_velocities,
                     __global float4* restrict positions, __global float4* restrict velocities, LINK_ARGUMENTS,
                     const float h) {
  const uint first = get_global_id(0) * POINTS_PER_ITEM;
  if (first >= point_count) return;
  const Derivatives d = derivatives_at(s4_positions, s4_velocities, first, LINKS);
#define WRITE(n)                                                                                              \
  {                                                                                                           \
    const uint p = first + 0x##n;                                                                             \
    positions[p] =                                                                                            \
        finished(positions[p], s2_positions[p], s3_positions[p], s4_positions[p], h * VECTOR_OF(d.velocity, n)); \
    velocities[p] = finished(velocities[p], s2_velocities[p], s3_velocities[p], s4_velocities[p],             \
                             h * VECTOR_OF(d.acceleration, n));                                               \
  }
  EACH_LANE(WRITE)
#undef WRITE
}

// y = (x(s2), (v + v(s2))/2 + h f a(s2)); h is half a step.
__kernel void correct(__global const float4* restrict s2_positions, __global const float4* restrict s2_velocities,
                      __global float4* restrict positions, __global float4* restrict velocities, LINK_ARGUMENTS,
                      const float h) {
  const uint first = get_global_id(0) * POINTS_PER_ITEM;
  if (first >= point_count) return;
  const Derivatives d = derivatives_at(s2_positions, s2_velocities, first, LINKS);
#define WRITE(n)                                                                              \
  {                                                                                           \
    const uint p = first + 0x##n;                                                             \
    positions[p] = s2_positions[p];                                                           \
    velocities[p] = 0.5f * (velocities[p] + s2_velocities[p]) + h * VECTOR_OF(d.acceleration, n); \
  }
  EACH_LANE(WRITE)
#undef WRITE
}

// Cuts links and brings them back: rest_lengths[places[n]] = values[n].
// Work-item: a place. Preconditions: no place twice.
__kernel void set_rest_lengths(__global float* restrict rest_lengths, __global const uint* restrict places,
                               __global const float* restrict values, const uint count) {
  const uint item = get_global_id(0);
  if (item < count) rest_lengths[places[item]] = values[item];
}
