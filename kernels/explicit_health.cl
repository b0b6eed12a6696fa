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
// Work-item: a walk over the share of its group, POINTS_PER_ITEM points at a
// time, in sums of a few points each, so that float does. Defines: GROUP_SIZE,
// and those of explicit_lanes.cl.
// Preconditions: work-groups of GROUP_SIZE; `partials` holds every group;
// point_count as in explicit.cl. Build without relaxed arithmetic, so that what
// is not finite shows in the sums.
// CPU twin: simulation::Solver::link_health.
#include "explicit_lanes.cl"

typedef struct {
  float value;
} One;

/// The numbers at scattered places.
Lanes gathered_floats(__global const float* restrict from, const Indices at) {
#define READ(n) const One p##n = {from[LANE(at, n)]};
  EACH_LANE(READ)
#undef READ
  return JOINED(value);
}

__kernel void link_health(__global const float4* restrict positions, __global const float4* restrict velocities,
                          __global const uint* restrict partners, __global const float* restrict rest_lengths,
                          __global const float* restrict freedom, __global float4* restrict partials,
                          const uint point_count, const float stiffness, const float rest_scale,
                          const float4 gravity, const float mass) {
  __local float4 own[GROUP_SIZE];
  const uint item = get_local_id(0);
  const uint walks = point_count / POINTS_PER_ITEM;
  const uint share = (walks + get_num_groups(0) - 1) / get_num_groups(0);
  const uint begin = min((uint)get_group_id(0) * share, walks);
  const uint end = min(begin + share, walks);
  Lanes kinetic = (Lanes)(0.0f);
  Lanes potential = (Lanes)(0.0f);
  Lanes fastest = (Lanes)(0.0f);
  for (uint walk = begin + item; walk < end; walk += GROUP_SIZE) {
    const uint first = walk * POINTS_PER_ITEM;
    const Vectors x = loaded(positions + first);
    const Vectors v = loaded(velocities + first);
    const Lanes own_freedom = LOAD(freedom + first);
#ifdef SCALED_MASS
    const Lanes m = mass * x.w;
#else
    const float m = mass;
#endif
    kinetic += 0.5f * m * (v.x * v.x + v.y * v.y + v.z * v.z);
    potential -= m * (gravity.x * x.x + gravity.y * x.y + gravity.z * x.z);
    for (uint slot = 0; slot < LINKS_PER_POINT; ++slot) {
      const Indices partner = LOAD(partners + COLUMN(slot, first));
      const Lanes rest_length = LOAD(rest_lengths + COLUMN(slot, first));
      const Vectors there = gathered(positions, partner);
      const Vectors speed = gathered(velocities, partner);
      const Lanes dx = there.x - x.x;
      const Lanes dy = there.y - x.y;
      const Lanes dz = there.z - x.z;
      const Lanes along = dx * (speed.x - v.x) + dy * (speed.y - v.y) + dz * (speed.z - v.z);
      const Lanes length = sqrt(dx * dx + dy * dy + dz * dz);
      const Lanes extension = length - rest_scale * rest_length;
#ifdef SCALED_STIFFNESS
      const Lanes k = 0.5f * stiffness * (x.w + there.w);
#else
      const float k = stiffness;
#endif
      potential += rest_length > 0.0f ? 0.25f * k * extension * extension : (Lanes)(0.0f);
      const Lanes rate = fabs(along) / fmax(length * rest_length, 1e-30f);
      const Lanes freest = fmin(own_freedom, gathered_floats(freedom, partner));
      fastest = fmax(fastest, ((rest_length > 0.0f) & (freest == 1.0f)) ? rate : (Lanes)(0.0f));
    }
  }
  float4 sum = (float4)(0.0f);
#define ADD(n) sum = (float4)(sum.x + LANE(kinetic, n), sum.y + LANE(potential, n), fmax(sum.z, LANE(fastest, n)), 0.0f);
  EACH_LANE(ADD)
#undef ADD
  own[item] = sum;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item != 0) return;
  for (uint other = 1; other < GROUP_SIZE; ++other)
    sum = (float4)(sum.xy + own[other].xy, fmax(sum.z, own[other].z), 0.0f);
  partials[get_group_id(0)] = sum;
}
