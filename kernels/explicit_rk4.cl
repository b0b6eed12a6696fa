// RK4 of point masses joined by explicit spring-damper links.
//
// Equation (thesis 3.1, 3.2), unit mass, with d = x_j - x_i, l = |d|, n = d/l:
//   a_i  = sum_j n [ k (l - L0) + c n.(v_j - v_i) ] - D v_i + g
//   f_i  = (1 - alpha_i) (v_i, a_i)              derivative of a held point
// A link whose ends coincide gives no force. RK4 without accumulators: with
//   s2 = y + h/2 f(y),  s3 = y + h/2 f(s2),  s4 = y + h f(s3)
//   y' = (s2 + 2 s3 + s4 - y)/3 + h/6 f(s4)
// the first three are the kernel `stage`, the last is `finish`, which writes
// over y: a work-item reads y of its own points only. y' is summed as
// differences from y, which are small and lose nothing to rounding.
//
// Symbols     arguments               units
//   x, v      *_positions, *_velocities  mm, mm/s (xyz; w is zero)
//   j, L0     partners, rest_lengths  index, mm; [slot][point], point fastest;
//                                     unused slots name the point itself
//   k, c, D   stiffness, damping, drag  1/s^2, 1/s, 1/s
//   g         gravity (xyz)           mm/s^2
//   1-alpha   freedom                 0 held .. 1 free
//   h         step fraction as said at each kernel, s
// Work-item: POINTS_PER_ITEM consecutive points, a lane each: on a CPU the
// compiler does not vectorise over work-items, so the lanes say it (1 on a
// GPU). Defines: POINTS_PER_ITEM = 1, 4, 8 or 16; LINKS_PER_POINT >= 1.
// Preconditions: point_count, the length of all arrays and columns, is a
// multiple of POINTS_PER_ITEM (points that fill it up have freedom 0 and no
// links); partners < point_count; the source state is not the target.
// CPU twin: simulation::make_reference_solver.

#if POINTS_PER_ITEM == 1
typedef float Lanes;
typedef uint Indices;
#define LOAD(from) (*(from))
#define LANE(lanes, n) (lanes)
#define EACH_LANE(use) use(0)
#define JOINED(component) (p0.component)
#elif POINTS_PER_ITEM == 4
typedef float4 Lanes;
typedef uint4 Indices;
#define LOAD(from) vload4(0, from)
#define LANE(lanes, n) (lanes).s##n
#define EACH_LANE(use) use(0) use(1) use(2) use(3)
#define JOINED(component) (float4)(p0.component, p1.component, p2.component, p3.component)
#elif POINTS_PER_ITEM == 8
typedef float8 Lanes;
typedef uint8 Indices;
#define LOAD(from) vload8(0, from)
#define LANE(lanes, n) (lanes).s##n
#define EACH_LANE(use) use(0) use(1) use(2) use(3) use(4) use(5) use(6) use(7)
#define JOINED(component)                                                                                    \
  (float8)(p0.component, p1.component, p2.component, p3.component, p4.component, p5.component, p6.component, \
           p7.component)
#elif POINTS_PER_ITEM == 16
typedef float16 Lanes;
typedef uint16 Indices;
#define LOAD(from) vload16(0, from)
#define LANE(lanes, n) (lanes).s##n
#define EACH_LANE(use)                                                                                      \
  use(0) use(1) use(2) use(3) use(4) use(5) use(6) use(7) use(8) use(9) use(a) use(b) use(c) use(d) use(e) \
      use(f)
#define JOINED(component)                                                                                      \
  (float16)(p0.component, p1.component, p2.component, p3.component, p4.component, p5.component, p6.component, \
            p7.component, p8.component, p9.component, pa.component, pb.component, pc.component, pd.component, \
            pe.component, pf.component)
#endif

/// Vectors of all lanes.
typedef struct {
  Lanes x, y, z;
} Vectors;

/// The vectors at scattered places.
Vectors gathered(__global const float4* restrict from, const Indices at) {
#define READ(n) const float4 p##n = from[LANE(at, n)];
  EACH_LANE(READ)
#undef READ
  Vectors result;
  result.x = JOINED(x);
  result.y = JOINED(y);
  result.z = JOINED(z);
  return result;
}

/// The vectors at consecutive places.
Vectors loaded(__global const float4* restrict from) {
#define READ(n) const float4 p##n = from[0x##n];
  EACH_LANE(READ)
#undef READ
  Vectors result;
  result.x = JOINED(x);
  result.y = JOINED(y);
  result.z = JOINED(z);
  return result;
}

typedef struct {
  Vectors velocity;
  Vectors acceleration;
} Derivatives;

Derivatives derivatives_at(__global const float4* restrict positions, __global const float4* restrict velocities,
                           __global const uint* restrict partners, __global const float* restrict rest_lengths,
                           __global const float* restrict freedom, const uint first, const uint point_count,
                           const float stiffness, const float damping, const float drag, const float4 gravity) {
  const Vectors x = loaded(positions + first);
  const Vectors v = loaded(velocities + first);
  Vectors a;
  a.x = gravity.x - drag * v.x;
  a.y = gravity.y - drag * v.y;
  a.z = gravity.z - drag * v.z;
  for (uint slot = 0; slot < LINKS_PER_POINT; ++slot) {
    const Indices partner = LOAD(partners + slot * point_count + first);
    const Lanes rest_length = LOAD(rest_lengths + slot * point_count + first);
    const Vectors there = gathered(positions, partner);
    const Vectors speed = gathered(velocities, partner);
    const Lanes dx = there.x - x.x;
    const Lanes dy = there.y - x.y;
    const Lanes dz = there.z - x.z;
    const Lanes squared = dx * dx + dy * dy + dz * dz;
    const Lanes along = dx * (speed.x - v.x) + dy * (speed.y - v.y) + dz * (speed.z - v.z);
    // Below 1e-15 mm the direction means nothing; 0 gives no force since d is 0.
    const Lanes inverse = squared > 1e-30f ? rsqrt(squared) : (Lanes)(0.0f);
    const Lanes factor = stiffness - inverse * (stiffness * rest_length - damping * along * inverse);
    a.x += dx * factor;
    a.y += dy * factor;
    a.z += dz * factor;
  }
  const Lanes free = LOAD(freedom + first);
  Derivatives result;
  result.velocity.x = free * v.x;
  result.velocity.y = free * v.y;
  result.velocity.z = free * v.z;
  result.acceleration.x = free * a.x;
  result.acceleration.y = free * a.y;
  result.acceleration.z = free * a.z;
  return result;
}

#define VECTOR_OF(vectors, n) (float4)(LANE((vectors).x, n), LANE((vectors).y, n), LANE((vectors).z, n), 0.0f)

// target = base + h f(source); h is half a step, half a step, a step.
__kernel void stage(__global const float4* restrict source_positions, __global const float4* restrict source_velocities,
                    __global const float4* restrict base_positions, __global const float4* restrict base_velocities,
                    __global float4* restrict target_positions, __global float4* restrict target_velocities,
                    __global const uint* restrict partners, __global const float* restrict rest_lengths,
                    __global const float* restrict freedom, const uint point_count, const float stiffness,
                    const float damping, const float drag, const float4 gravity, const float h) {
  const uint first = get_global_id(0) * POINTS_PER_ITEM;
  if (first >= point_count) return;
  const Derivatives f = derivatives_at(source_positions, source_velocities, partners, rest_lengths, freedom, first,
                                       point_count, stiffness, damping, drag, gravity);
#define WRITE(n)                                                                                             \
  target_positions[first + 0x##n] = base_positions[first + 0x##n] + h * VECTOR_OF(f.velocity, n);           \
  target_velocities[first + 0x##n] = base_velocities[first + 0x##n] + h * VECTOR_OF(f.acceleration, n);
  EACH_LANE(WRITE)
#undef WRITE
}

/// (s2 + 2 s3 + s4 - y)/3 + h f, as y and differences from it.
float4 finished(const float4 y, const float4 s2, const float4 s3, const float4 s4, const float4 hf) {
  return y + (((s2 - y) + 2.0f * (s3 - y) + (s4 - y)) * (1.0f / 3.0f) + hf);
}

// y = (s2 + 2 s3 + s4 - y)/3 + h f(s4); h is a sixth of a step.
__kernel void finish(__global const float4* restrict s4_positions, __global const float4* restrict s4_velocities,
                     __global const float4* restrict s3_positions, __global const float4* restrict s3_velocities,
                     __global const float4* restrict s2_positions, __global const float4* restrict s2_velocities,
                     __global float4* restrict positions, __global float4* restrict velocities,
                     __global const uint* restrict partners, __global const float* restrict rest_lengths,
                     __global const float* restrict freedom, const uint point_count, const float stiffness,
                     const float damping, const float drag, const float4 gravity, const float h) {
  const uint first = get_global_id(0) * POINTS_PER_ITEM;
  if (first >= point_count) return;
  const Derivatives f = derivatives_at(s4_positions, s4_velocities, partners, rest_lengths, freedom, first,
                                       point_count, stiffness, damping, drag, gravity);
#define WRITE(n)                                                                                              \
  {                                                                                                           \
    const uint p = first + 0x##n;                                                                             \
    positions[p] =                                                                                            \
        finished(positions[p], s2_positions[p], s3_positions[p], s4_positions[p], h * VECTOR_OF(f.velocity, n)); \
    velocities[p] = finished(velocities[p], s2_velocities[p], s3_velocities[p], s4_velocities[p],             \
                             h * VECTOR_OF(f.acceleration, n));                                               \
  }
  EACH_LANE(WRITE)
#undef WRITE
}
