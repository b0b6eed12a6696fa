// What a lattice of points shows of itself, and what moves single points of it.
//
// Equations
//   publish  x of a point = the site of its lane + A its place relative to it
//   grab     x += alpha u h, v = (1 - alpha) v + alpha u (thesis 3.4.1)
//   health   partial = (max |x - x0|^2, max |v|^2, 1 if any component is not finite)
// Symbols      arguments                       units
//   states     as in lattice.cl                mm, mm/s
//   site       origins, step_x                 mm: of lane 0, and from lane to lane
//   A          axis_x, axis_y, axis_z          1: the lattice's frame in LPS
//   x0         rest_positions, as states       mm
//   alpha u h  selectances, velocity, h        0 .. 1, mm/s, s; h = 0 sets the velocity alone
//   lanes      lane_of_point, held             segment * LANES + lane
// Work-item: publish, a point; grab, a held point; health, a share of the segments.
// Preconditions: each held lane is listed once.
// CPU twin: simulation::make_reference_solver.
#include "lanes.cl"

__kernel void publish(__global const float* restrict states, __global const uint* restrict lane_of_point,
                      __global const float4* restrict origins, __global float4* restrict positions,
                      const uint point_count, const float4 step_x, const float4 axis_x, const float4 axis_y,
                      const float4 axis_z) {
  const uint point = get_global_id(0);
  if (point >= point_count) return;
  const uint segment = lane_of_point[point] / LANES;
  const uint lane = lane_of_point[point] % LANES;
  __global const float* own = states + segment * 6 * LANES + lane;
  const float4 place = own[0] * axis_x + own[LANES] * axis_y + own[2 * LANES] * axis_z;
  positions[point] = (origins[segment] + (float)lane * step_x) + place;
}

__kernel void grab(__global float* restrict states, __global const uint* restrict held,
                   __global const float* restrict selectances, const uint held_count, const float4 velocity,
                   const float h) {
  const uint item = get_global_id(0);
  if (item >= held_count) return;
  __global float* own = states + held[item] / LANES * 6 * LANES + held[item] % LANES;
  const float alpha = selectances[item];
  own[0] += alpha * h * velocity.x;
  own[LANES] += alpha * h * velocity.y;
  own[2 * LANES] += alpha * h * velocity.z;
  own[3 * LANES] = (1.0f - alpha) * own[3 * LANES] + alpha * velocity.x;
  own[4 * LANES] = (1.0f - alpha) * own[4 * LANES] + alpha * velocity.y;
  own[5 * LANES] = (1.0f - alpha) * own[5 * LANES] + alpha * velocity.z;
}

/// Read off the exponent bits, which no compiler option may reason away.
uint is_broken(const float value) { return (as_uint(value) & 0x7f800000u) == 0x7f800000u ? 1u : 0u; }

__kernel void health(__global const float* restrict states, __global const float* restrict rest_positions,
                     __global float4* restrict partials, const uint segment_count, const uint share,
                     const uint item_count) {
  const uint item = get_global_id(0);
  if (item >= item_count) return;
  const uint begin = min(item * share, segment_count) + 1;
  const uint end = min((item + 1) * share, segment_count) + 1;
  float displacement = 0.0f;
  float speed = 0.0f;
  uint broken = 0;
  for (uint segment = begin; segment < end; ++segment) {
    __global const float* own = states + segment * 6 * LANES;
    __global const float* rest = rest_positions + segment * 3 * LANES;
    for (uint lane = 0; lane < LANES; ++lane) {
      const float dx = own[lane] - rest[lane];
      const float dy = own[LANES + lane] - rest[LANES + lane];
      const float dz = own[2 * LANES + lane] - rest[2 * LANES + lane];
      const float vx = own[3 * LANES + lane];
      const float vy = own[4 * LANES + lane];
      const float vz = own[5 * LANES + lane];
      const uint bad = is_broken(dx) | is_broken(dy) | is_broken(dz) | is_broken(vx) | is_broken(vy) | is_broken(vz);
      broken |= bad;
      displacement = max(displacement, bad ? 0.0f : dx * dx + dy * dy + dz * dz);
      speed = max(speed, bad ? 0.0f : vx * vx + vy * vy + vz * vz);
    }
  }
  partials[item] = (float4)(displacement, speed, broken ? 1.0f : 0.0f, 0.0f);
}
