// The parts of an implicit step on a lattice that no link has a say in.
//
// Equations (docs/adr/0012)
//   implicit_largest   R = the largest |R_i|, 1 at least
//   implicit_advance   v += u, x += h f v
// Symbols      arguments                  units
//   R_i        loads, or partial results  1; as implicit_lattice.cl stores them, or one after another
//   u          corrections                mm/s; as states
//   x, v       states                     mm, mm/s; as in lattice.cl
//   f, h       freedom, h                 1, s
// Work-item: implicit_largest, a part of the values; implicit_advance, a segment.
// CPU twin: simulation::implicit_step.
#include "lanes.cl"

// Value n lies at n / run * stride + n % run + offset.
__kernel void implicit_largest(__global const float* restrict source, __global float* restrict target,
                               const uint count, const uint run, const uint stride, const uint offset,
                               const uint parts) {
  const uint part = get_global_id(0);
  if (part >= parts) return;
  const uint length = (count / run + parts - 1) / parts * run;
  const uint end = min(count, (part + 1) * length);
  float largest = 1.0f;
  for (uint first = part * length; first < end; first += run)
    for (uint n = 0; n < run; ++n) largest = max(largest, fabs(source[first / run * stride + n + offset]));
  target[part] = largest;
}

__kernel void implicit_advance(__global Lanes* restrict states, __global const Lanes* restrict corrections,
                               __global const Lanes* restrict freedom, const uint segment_count, const float h) {
  const uint segment = get_global_id(0);
  if (segment >= segment_count) return;
  __global Lanes* own = states + 6 * segment;
  const Vector v = sum(loaded(own + 3), loaded(corrections + 6 * segment + 3));
  store(v, own + 3);
  store(step_along(loaded(own), h * freedom[segment], v), own);
}
