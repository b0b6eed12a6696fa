// What the links of the explicit layout say of a run: energy and strain rate.
//
// Equation: per work-group, over its share of the points,
//   partial = (sum m |v|^2/2,
//              sum over links k (l - s L0)^2/4 - m g.x,  a link being met at both ends
//              max |dl/dt|/L0 over links whose ends are both free, 0)
// Symbols      arguments                         units
//   x, v       positions (w: factor), velocities mm, mm/s (xyz)
//   j, L0      partners, rest_lengths            as in explicit.cl
//   k, s k     stiffness, s as rest_scale        1/s^2, 1
//   g, m       gravity (xyz), mass               mm/s^2, 1
//   partial    partials, one float4 a group      mm^2/s^2, mm^2/s^2, 1/s
// Work-item: a walk over the share of its group, GROUP_SIZE points apart, in
// sums of a few points each, so that float does. Defines: GROUP_SIZE,
// LINKS_PER_POINT, COLUMN_BLOCK, SCALED_STIFFNESS and SCALED_MASS where they are.
// Preconditions: work-groups of GROUP_SIZE; `partials` holds every group.
// CPU twin: simulation::Solver::link_health.
#include "explicit_columns.cl"

__kernel void link_health(__global const float4* restrict positions, __global const float4* restrict velocities,
                          __global const uint* restrict partners, __global const float* restrict rest_lengths,
                          __global const float* restrict freedom, __global float4* restrict partials,
                          const uint point_count, const float stiffness, const float rest_scale,
                          const float4 gravity, const float mass) {
  __local float4 own[GROUP_SIZE];
  const uint item = get_local_id(0);
  const uint share = (point_count + get_num_groups(0) - 1) / get_num_groups(0);
  const uint begin = min((uint)get_group_id(0) * share, point_count);
  const uint end = min(begin + share, point_count);
  float4 sum = (float4)(0.0f);
  for (uint point = begin + item; point < end; point += GROUP_SIZE) {
    const float4 x = positions[point];
    const float4 v = velocities[point];
    const bool is_free = freedom[point] == 1.0f;
#ifdef SCALED_MASS
    const float m = mass * x.w;
#else
    const float m = mass;
#endif
    sum.x += 0.5f * m * (v.x * v.x + v.y * v.y + v.z * v.z);
    sum.y -= m * (gravity.x * x.x + gravity.y * x.y + gravity.z * x.z);
    for (uint slot = 0; slot < LINKS_PER_POINT; ++slot) {
      const float rest_length = rest_lengths[COLUMN(slot, point)];
      if (rest_length == 0.0f) continue;
      const uint other = partners[COLUMN(slot, point)];
      const float4 there = positions[other];
      const float4 d = there - x;
      const float4 u = velocities[other] - v;
      const float length = sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
      const float extension = length - rest_scale * rest_length;
#ifdef SCALED_STIFFNESS
      const float k = 0.5f * stiffness * (x.w + there.w);
#else
      const float k = stiffness;
#endif
      sum.y += 0.25f * k * extension * extension;
      if (!is_free || length == 0.0f || freedom[other] != 1.0f) continue;
      const float rate = fabs(d.x * u.x + d.y * u.y + d.z * u.z) / (length * rest_length);
      sum.z = fmax(sum.z, rate);
    }
  }
  own[item] = sum;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item != 0) return;
  for (uint other = 1; other < GROUP_SIZE; ++other)
    sum = (float4)(sum.xy + own[other].xy, fmax(sum.z, own[other].z), 0.0f);
  partials[get_group_id(0)] = sum;
}
