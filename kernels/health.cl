// What a run is watched by: is the state finite, how far and how fast is it.
//
// Equation: per work-group, over its share of the points,
//   partial = (max |x - x0|^2, max |v|^2, 1 if any component is not finite)
// Symbols      arguments              units
//   x, v, x0   positions, velocities, rest_positions   mm, mm/s, mm (xyz)
//   partial    partials, one float4 a group            mm^2, mm^2/s^2, flag
// Work-item: a walk over the share of its group, GROUP_SIZE points apart.
// Preconditions: work-groups of GROUP_SIZE; `partials` holds every group.
// Finiteness is read off the exponent bits, which no compiler option may
// reason away; build without fast math all the same, so that max() is right.
// CPU twin: Solver::health of simulation::make_reference_solver.
bool is_broken(const float4 value) {
  const uint4 bits = as_uint4(value) & 0x7f800000u;
  return bits.x == 0x7f800000u || bits.y == 0x7f800000u || bits.z == 0x7f800000u;
}

__kernel void health(__global const float4* restrict positions, __global const float4* restrict velocities,
                     __global const float4* restrict rest_positions, __global float4* restrict partials,
                     const uint point_count) {
  __local float4 own[GROUP_SIZE];
  const uint item = get_local_id(0);
  const uint share = (point_count + get_num_groups(0) - 1) / get_num_groups(0);
  const uint begin = min((uint)get_group_id(0) * share, point_count);
  const uint end = min(begin + share, point_count);
  float4 worst = (float4)(0.0f);
  for (uint point = begin + item; point < end; point += GROUP_SIZE) {
    const float4 x = positions[point];
    const float4 v = velocities[point];
    if (is_broken(x) || is_broken(v)) {
      worst.z = 1.0f;
      continue;
    }
    const float4 d = x - rest_positions[point];
    worst.x = max(worst.x, d.x * d.x + d.y * d.y + d.z * d.z);
    worst.y = max(worst.y, v.x * v.x + v.y * v.y + v.z * v.z);
  }
  own[item] = worst;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item != 0) return;
  for (uint other = 1; other < GROUP_SIZE; ++other) worst = max(worst, own[other]);
  partials[get_group_id(0)] = worst;
}
