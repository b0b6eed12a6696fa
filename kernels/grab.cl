// Points that a grab holds follow it (thesis 3.4.1).
//
// Equation, for every held point with selectance alpha:
//   x += alpha u h          v = (1 - alpha) v + alpha u
// Symbols      arguments                units
//   x, v       positions, velocities    mm, mm/s (xyz)
//   alpha      selectances              0 .. 1
//   u          grab_velocity (xyz)      mm/s
//   h          h                        s; 0 sets the velocity alone
// Work-item: a held point. Preconditions: each point is listed once.
// CPU twin: simulation::make_reference_solver.
__kernel void grab(__global float4* restrict positions, __global float4* restrict velocities,
                   __global const uint* restrict held, __global const float* restrict selectances,
                   const uint held_count, const float4 grab_velocity, const float h) {
  const uint item = get_global_id(0);
  if (item >= held_count) return;
  const uint point = held[item];
  const float alpha = selectances[item];
  positions[point] += alpha * h * grab_velocity;
  velocities[point] = (1.0f - alpha) * velocities[point] + alpha * grab_velocity;
}
