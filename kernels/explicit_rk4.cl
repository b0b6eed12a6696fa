// RK4 of point masses joined by explicit spring-damper links.
//
// Equation (thesis 3.1, 3.2), unit mass, with d = x_j - x_i, l = |d|, n = d/l:
//   a_i  = sum_j n [ k (l - L0) + c n.(v_j - v_i) ] - D v_i + g
//   f_i  = (1 - alpha_i) (v_i, a_i)              derivative of a held point
// A link whose ends coincide gives no force. RK4 without accumulators: with
//   s2 = y + h/2 f(y),  s3 = y + h/2 f(s2),  s4 = y + h f(s3)
//   y' = (s2 + 2 s3 + s4 - y)/3 + h/6 f(s4)
// the first three are the kernel `stage`, the last is `finish`, which writes
// over y: a work-item reads y of its own point only. y' is summed as
// differences from y, which are small and lose nothing to rounding.
//
// Symbols     arguments               units
//   x, v      *_positions, _velocities  mm, mm/s (xyz; w unused and kept)
//   j, L0     partners, rest_lengths  index, mm; [slot][point], point fastest;
//                                     unused slots name the point itself
//   k, c, D   stiffness, damping, drag  1/s^2, 1/s, 1/s
//   g         gravity (xyz)           mm/s^2
//   1-alpha   freedom                 0 held .. 1 free
//   h         step fraction as said at each kernel, s
// Work-item: a point. Defines: LINKS_PER_POINT >= 1.
// Preconditions: partners < point_count; the source state is not the target.
// CPU twin: simulation::make_reference_solver.

typedef struct {
  float4 velocity;
  float4 acceleration;
} Derivative;

Derivative derivative_at(__global const float4* restrict positions, __global const float4* restrict velocities,
                         __global const uint* restrict partners, __global const float* restrict rest_lengths,
                         __global const float* restrict freedom, const uint point, const uint point_count,
                         const float stiffness, const float damping, const float drag, const float4 gravity) {
  const float4 x = positions[point];
  const float4 v = velocities[point];
  float4 force = gravity - drag * v;
#pragma unroll
  for (uint slot = 0; slot < LINKS_PER_POINT; ++slot) {
    const uint link = slot * point_count + point;
    const uint partner = partners[link];
    const float4 d = positions[partner] - x;
    const float4 u = velocities[partner] - v;
    const float squared = d.x * d.x + d.y * d.y + d.z * d.z;
    const float along = d.x * u.x + d.y * u.y + d.z * u.z;
    // Below 1e-15 mm the direction means nothing; 0 gives no force since d is 0.
    const float inverse = squared > 1e-30f ? rsqrt(squared) : 0.0f;
    force += d * (stiffness - inverse * (stiffness * rest_lengths[link] - damping * along * inverse));
  }
  const float free = freedom[point];
  Derivative result;
  result.velocity = free * v;
  result.acceleration = free * force;
  return result;
}

// target = base + h f(source); h is half a step, half a step, a step.
__kernel void stage(__global const float4* restrict source_positions, __global const float4* restrict source_velocities,
                    __global const float4* restrict base_positions, __global const float4* restrict base_velocities,
                    __global float4* restrict target_positions, __global float4* restrict target_velocities,
                    __global const uint* restrict partners, __global const float* restrict rest_lengths,
                    __global const float* restrict freedom, const uint point_count, const float stiffness,
                    const float damping, const float drag, const float4 gravity, const float h) {
  const uint point = get_global_id(0);
  if (point >= point_count) return;
  const Derivative f = derivative_at(source_positions, source_velocities, partners, rest_lengths, freedom, point,
                                     point_count, stiffness, damping, drag, gravity);
  target_positions[point] = base_positions[point] + h * f.velocity;
  target_velocities[point] = base_velocities[point] + h * f.acceleration;
}

// y = (s2 + 2 s3 + s4 - y)/3 + h f(s4); h is a sixth of a step.
__kernel void finish(__global const float4* restrict s4_positions, __global const float4* restrict s4_velocities,
                     __global const float4* restrict s3_positions, __global const float4* restrict s3_velocities,
                     __global const float4* restrict s2_positions, __global const float4* restrict s2_velocities,
                     __global float4* restrict positions, __global float4* restrict velocities,
                     __global const uint* restrict partners, __global const float* restrict rest_lengths,
                     __global const float* restrict freedom, const uint point_count, const float stiffness,
                     const float damping, const float drag, const float4 gravity, const float h) {
  const uint point = get_global_id(0);
  if (point >= point_count) return;
  const Derivative f = derivative_at(s4_positions, s4_velocities, partners, rest_lengths, freedom, point, point_count,
                                     stiffness, damping, drag, gravity);
  const float third = 1.0f / 3.0f;
  const float4 x = positions[point];
  const float4 v = velocities[point];
  positions[point] =
      x + (third * ((s2_positions[point] - x) + 2.0f * (s3_positions[point] - x) + (s4_positions[point] - x)) +
           h * f.velocity);
  velocities[point] =
      v + (third * ((s2_velocities[point] - v) + 2.0f * (s3_velocities[point] - v) + (s4_velocities[point] - v)) +
           h * f.acceleration);
}
