// Implicit Euler for stiff tissue on explicit links.
//
// Equation (docs/adr/0012), symbols as in explicit.cl, e = 1 - s L0/l,
// t = min(1, |e|), K_ij = k (n nT + t (I - n nT)), C_ij = c n nT:
//   (m/f + h C + h D + h^2 K) u = b = h (F(x, v) - h K v),   v += u,   x += h f v
// by a fixed number of Chebyshev iterations (simulation::ImplicitPlan), with
//   r(u) = ((f/m) (b - h C u - h^2 K u - h D u) - u)/R
//   R_i  = 1 + (f/m) (h D + 2 |T|),   T = sum_j (h C_ij + h^2 K_ij) of the point
// |T| bounds the largest eigenvalue of T. R is the largest R_i, so that the
// matrix, seen through R m/f, has its eigenvalues in (0, 1] whatever the state;
// it is one for all points lest internal forces give a free tissue momentum. A
// point without links has its own R_i, and then its solution is exact.
//   implicit_load     b, R_i, and u_0 = (f/m) b; before = 0
//   implicit_largest  R, in two launches
//   implicit_iterate  before = u + momentum (u - before) + rate r(u)
//   implicit_advance  v += u, x += h f v
//
// Symbols     arguments               units
//   as in explicit.cl, but without the mass: k/m, c/m, D/m
//   s         rest_scale              1; of the end of the step
//   h c, h^2 k   damping, stiffness   1
//   h D       drag                    1
//   b, R_i    load (xyz, w)           mm/s, 1; R_i < 0 means -R_i and a point with links
//   R         largest                 1
//   u, before    correction, before   mm/s (xyz)
// Work-item, defines and preconditions: as in explicit.cl.
// CPU twin: simulation::implicit_step.

#include "explicit.cl"

/// What a link adds: T = along n nT + across I, of which n nT needs 1/l^2.
typedef struct {
  Lanes dx, dy, dz;
  Lanes along;    ///< (h c + h^2 k (1 - t))/l^2
  Lanes across;   ///< h^2 k t
  Lanes spring;   ///< h^2 k e
} Link;

Link link_between(const Vectors x, const Vectors there, const Lanes rest_length, const float stiffness,
                  const float damping) {
  Link link;
  link.dx = there.x - x.x;
  link.dy = there.y - x.y;
  link.dz = there.z - x.z;
  const Lanes squared = link.dx * link.dx + link.dy * link.dy + link.dz * link.dz;
  const Lanes inverse = rsqrt(max(squared, 1e-30f));
  const Lanes stretch = 1.0f - inverse * rest_length;
  const Lanes one = (Lanes)(1.0f);
  const Lanes zero = (Lanes)(0.0f);
  // A cut link has no rest length, and coincident ends have no direction.
  const Lanes acts = rest_length > 0.0f ? (squared > 1e-30f ? one : zero) : zero;
  Lanes k = stiffness * acts;
  Lanes c = damping * acts;
#ifdef SCALED
  const Lanes mean = 0.5f * (x.w + there.w);
#ifdef SCALED_STIFFNESS
  k *= mean;
#endif
#ifdef SCALED_DAMPING
  c *= mean;
#endif
#endif
  const Lanes part = min(one, fabs(stretch));
  link.across = k * part;
  link.along = (c + (k - link.across)) * inverse * inverse;
  link.spring = k * stretch;
  return link;
}

#define IMPLICIT_ARGUMENTS                                                                            \
  __global const uint *restrict partners, __global const float *restrict rest_lengths,               \
      __global const float *restrict freedom, const uint point_count, const float rest_scale,        \
      const float stiffness, const float damping, const float drag

#ifdef SCALED_DRAG
#define OWN_DRAG (drag * x.w)
#else
#define OWN_DRAG ((Lanes)(drag))
#endif
#ifdef SCALED_MASS
#define OWN_MASS (x.w)
#else
#define OWN_MASS ((Lanes)(1.0f))
#endif

__kernel void implicit_load(__global const float4* restrict positions, __global const float4* restrict velocities,
                            __global float4* restrict load, __global float4* restrict correction,
                            __global float4* restrict before, IMPLICIT_ARGUMENTS, const float4 gravity,
                            const float h) {
  const uint first = get_global_id(0) * POINTS_PER_ITEM;
  if (first >= point_count) return;
  const Vectors x = loaded(positions + first);
  const Vectors v = loaded(velocities + first);
  const Lanes zero = (Lanes)(0.0f);
  // h b: divided by h at the end.
  Lanes bx = zero, by = zero, bz = zero;
  Lanes xx = zero, yy = zero, zz = zero, xy = zero, xz = zero, yz = zero, all = zero;
  for (uint slot = 0; slot < LINKS_PER_POINT; ++slot) {
    const Indices partner = LOAD(partners + COLUMN(slot, first));
    const Lanes rest_length = rest_scale * LOAD(rest_lengths + COLUMN(slot, first));
    const Vectors there = gathered(positions, partner);
    const Vectors speed = gathered(velocities, partner);
    const Link link = link_between(x, there, rest_length, stiffness, damping);
    const Lanes sx = h * (speed.x - v.x);
    const Lanes sy = h * (speed.y - v.y);
    const Lanes sz = h * (speed.z - v.z);
    const Lanes factor = link.spring + link.along * (link.dx * sx + link.dy * sy + link.dz * sz);
    bx += link.dx * factor + link.across * sx;
    by += link.dy * factor + link.across * sy;
    bz += link.dz * factor + link.across * sz;
    const Lanes ax = link.along * link.dx;
    const Lanes ay = link.along * link.dy;
    const Lanes az = link.along * link.dz;
    xx += ax * link.dx;
    yy += ay * link.dy;
    zz += az * link.dz;
    xy += ax * link.dy;
    xz += ax * link.dz;
    yz += ay * link.dz;
    all += link.across;
  }
  // The largest eigenvalue: q + 2 p, with q the mean and 6 p^2 = |T - q I|^2.
  const Lanes q = (xx + yy + zz) * (1.0f / 3.0f);
  xx -= q;
  yy -= q;
  zz -= q;
  const Lanes apart = xx * xx + yy * yy + zz * zz + 2.0f * (xy * xy + xz * xz + yz * yz);
  const Lanes largest = all + q + 2.0f * sqrt(apart * (1.0f / 6.0f));
  const Lanes own_drag = OWN_DRAG;
  const Lanes mass = OWN_MASS;
  const Lanes free = LOAD(freedom + first);
  const Lanes by_mass = free / mass;
  const Lanes own = 1.0f + by_mass * (own_drag + 2.0f * largest);
  const Lanes bound = largest > 0.0f ? -own : own;
  const Lanes by_step = (Lanes)(h > 0.0f ? 1.0f / h : 0.0f);
  Vectors b;
  b.x = bx * by_step - own_drag * v.x + h * mass * gravity.x;
  b.y = by * by_step - own_drag * v.y + h * mass * gravity.y;
  b.z = bz * by_step - own_drag * v.z + h * mass * gravity.z;
#define WRITE(n)                                                                                                \
  {                                                                                                             \
    const float4 own_b = (float4)(LANE(b.x, n), LANE(b.y, n), LANE(b.z, n), LANE(bound, n));                    \
    load[first + 0x##n] = own_b;                                                                                \
    correction[first + 0x##n] = (float4)(LANE(by_mass, n) * own_b.xyz, 0.0f);                                   \
    before[first + 0x##n] = (float4)(0.0f);                                                                     \
  }
  EACH_LANE(WRITE)
#undef WRITE
}

// target[part] = the largest |source[stride n + offset]| of a part of the n < count, 1 at least.
// Work-item: a part.
__kernel void implicit_largest(__global const float* restrict source, __global float* restrict target,
                               const uint count, const uint stride, const uint offset, const uint parts) {
  const uint part = get_global_id(0);
  if (part >= parts) return;
  const uint length = (count + parts - 1) / parts;
  const uint end = min(count, (part + 1) * length);
  float largest = 1.0f;
  for (uint n = part * length; n < end; ++n) largest = max(largest, fabs(source[n * stride + offset]));
  target[part] = largest;
}

// Where one of the corrections is still u_0, its scale says what makes it u_1 = scale u_0/R; else it is 0.
__kernel void implicit_iterate(__global const float4* restrict positions, __global const float4* restrict load,
                               __global const float* restrict largest, __global const float4* restrict correction,
                               __global float4* restrict before, IMPLICIT_ARGUMENTS, const float momentum,
                               const float rate, const float scale, const float scale_before) {
  const uint first = get_global_id(0) * POINTS_PER_ITEM;
  if (first >= point_count) return;
  const Vectors x = loaded(positions + first);
  const Vectors u = loaded(correction + first);
  const Lanes zero = (Lanes)(0.0f);
  Lanes rx = zero, ry = zero, rz = zero;
  for (uint slot = 0; slot < LINKS_PER_POINT; ++slot) {
    const Indices partner = LOAD(partners + COLUMN(slot, first));
    const Lanes rest_length = rest_scale * LOAD(rest_lengths + COLUMN(slot, first));
    const Vectors there = gathered(positions, partner);
    const Vectors speed = gathered(correction, partner);
    const Link link = link_between(x, there, rest_length, stiffness, damping);
    const Lanes sx = speed.x - u.x;
    const Lanes sy = speed.y - u.y;
    const Lanes sz = speed.z - u.z;
    const Lanes factor = link.along * (link.dx * sx + link.dy * sy + link.dz * sz);
    rx += link.dx * factor + link.across * sx;
    ry += link.dy * factor + link.across * sy;
    rz += link.dz * factor + link.across * sz;
  }
  const Lanes own_drag = OWN_DRAG;
  const Lanes mass = OWN_MASS;
  const Lanes free = LOAD(freedom + first);
#define READ(n) const float4 p##n = load[first + 0x##n];
  EACH_LANE(READ)
#undef READ
  const Lanes own_bound = JOINED(w);
  const Lanes shared = (Lanes)(largest[0]);
  const Lanes bound = own_bound < 0.0f ? shared : own_bound;
  const Lanes own_rate = rate / bound;
  const Lanes size = (scale > 0.0f ? 0.0f : 1.0f) + scale / bound;
  const Lanes past = momentum * ((scale_before > 0.0f ? 0.0f : 1.0f) + scale_before / bound);
  const Lanes by_mass = free / mass;
  const Lanes keep = size * (1.0f + momentum - own_rate * (1.0f + by_mass * own_drag));
  const Lanes gain = own_rate * by_mass;
  Vectors next;
  next.x = keep * u.x + gain * (size * rx + JOINED(x));
  next.y = keep * u.y + gain * (size * ry + JOINED(y));
  next.z = keep * u.z + gain * (size * rz + JOINED(z));
#define WRITE(n) before[first + 0x##n] = VECTOR_OF(next, n) - LANE(past, n) * before[first + 0x##n];
  EACH_LANE(WRITE)
#undef WRITE
}

// Work-item: a point.
__kernel void implicit_advance(__global float4* restrict positions, __global float4* restrict velocities,
                               __global const float4* restrict correction, __global const float* restrict freedom,
                               const uint point_count, const float h) {
  const uint point = get_global_id(0);
  if (point >= point_count) return;
  const float4 u = correction[point];
  const float4 v = velocities[point] + (float4)(u.xyz, 0.0f);
  velocities[point] = v;
  positions[point] += h * freedom[point] * (float4)(v.xyz, 0.0f);
}
