// Implicit Euler for stiff tissue on a lattice: what lattice.cl's sweep does
// with a link and with a segment where IMPLICIT is defined.
//
// Equation and scheme: as in implicit_explicit.cl, with e = 1 - L/l, t = min(1, |e|) and
//   T_ij = along d dT + across I,  along = (h c + h^2 k (1 - t))/l^2,  across = h^2 k t
// IMPLICIT says which pass it is:
//   1 load      on a link  h^2 k e d + h T_ij (v_j - v_i); of a segment b, u_0 = (f/m) b, before = 0
//   2 diagonal  on a link  the diagonal of T_ij, the same for both ends
//   3 bound     on a link  its other three numbers; of a segment R_i
//   4 iterate   on a link  T_ij (u_j - u_i); of a segment momentum, rate and so on
//
// Symbols     arguments of the sweep        units
//   h^2 k     stiffness                     1, before the mass
//   h c       damping                       1
//   h D       drag                          1
//   L         rest_scale n + rest_offset, and length_scale L in the overflow: mm
//   state and v, or u   source              mm, mm/s; 6 vectors a segment
//   u_0, u    target, and before in pass 4  x is the state's, once pass 1 has written it
//   before    third in pass 1               as target
//   b; R_i or T's diagonal   second         3 vectors and 1 or 3 of a segment; R_i < 0: -R_i, with links
//   R         third in pass 4               the largest R_i, one number
//   momentum, rate, scale, scale_before   gravity in pass 4
// Work-item and preconditions: as in lattice.cl.
// CPU twin: simulation::implicit_step.

// In the sweep: what a link does to its one end, against what it does to the other.
#if IMPLICIT == 2 || IMPLICIT == 3
#define opposed sum
#else
#define opposed difference
#endif

/// What the link adds to a; b gets the opposite, or in passes 2 and 3 the same.
__attribute__((always_inline)) Vector force_of(const Place a, const Place b, const Lanes factor_a,
                                               const Lanes factor_b, const Stored rest, const Law law) {
  const Vector d = difference(b.x, a.x);
  // Nearer than 1e-6 mm there is no direction, and d is as good as 0.
  const Lanes squared = d.x * d.x + (d.y * d.y + (d.z * d.z + 1e-12f));
#ifdef RSQRT_IS_EXACT
  const Lanes inverse = rsqrt(squared);
#elif IMPLICIT == 1
  const Lanes rough = ROUGH_RSQRT(squared);
  const Lanes inverse = rough * (1.5f - 0.5f * squared * rough * rough);
#else
  const Lanes inverse = ROUGH_RSQRT(squared);  // the matrix need not be exact, only the load
#endif
  const Whole steps = TO_WHOLE(rest);
  const Lanes rest_length = law.rest_scale * TO_LANES(rest) + law.rest_offset;
#ifdef SCALED_STIFFNESS
  const Lanes k = law.stiffness * (0.5f * (factor_a + factor_b));
#else
  const Lanes k = (Lanes)(law.stiffness);
#endif
#ifdef SCALED_DAMPING
  const Lanes c = law.damping * (0.5f * (factor_a + factor_b));
#else
  const Lanes c = (Lanes)(law.damping);
#endif
  const Lanes stretch = 1.0f - rest_length * inverse;
  const Lanes part = min(fabs(stretch), (Lanes)(1.0f));
  // Else no link, or a cut one, or its ends are at one place.
  const Truth acts = (steps != (Whole)(0u)) & (squared > 2e-12f);
  const Lanes across = acts ? k * part : (Lanes)(0.0f);
  const Lanes along = acts ? ((k + c) - k * part) * (inverse * inverse) : (Lanes)(0.0f);
#if IMPLICIT == 2
  const Vector result = {along * d.x * d.x + across, along * d.y * d.y + across, along * d.z * d.z + across};
#elif IMPLICIT == 3
  const Vector result = {along * d.x * d.y, along * d.x * d.z, along * d.y * d.z};
#else
#if IMPLICIT == 1
  const Lanes h = (Lanes)(law.step);
  const Vector change = {h * (b.v.x - a.v.x), h * (b.v.y - a.v.y), h * (b.v.z - a.v.z)};
  const Lanes spring = acts ? k * stretch : (Lanes)(0.0f);  // its force is 0 with d
  const Lanes factor = spring + along * dot_of(d, change);
#else
  const Vector change = difference(b.v, a.v);
  const Lanes factor = along * dot_of(d, change);
#endif
  const Vector result = {d.x * factor + across * change.x, d.y * factor + across * change.y,
                         d.z * factor + across * change.z};
#endif
  return result;
}

/// As in lattice.cl: links that leave the stencil, one by one.
Vector overflow_links(__global const float* restrict source, __global const float* restrict factors,
                      const uint segment, const uint begin, const uint end, __global const uint4* restrict overflow,
                      const float4 step_x, const float4 step_y, const float4 step_z, const float length_scale,
                      const Law law) {
  float sums[3 * LANES];
  for (uint n = 0; n < 3 * LANES; ++n) sums[n] = 0.0f;
  for (uint n = begin; n < end; ++n) {
    const OverflowLink link = overflow_link(source, segment, overflow[n], step_x, step_y, step_z);
    const float dx = link.dx;
    const float dy = link.dy;
    const float dz = link.dz;
    const float squared = dx * dx + dy * dy + dz * dz;
    const float rest_length = length_scale * link.rest_length;
    if (rest_length == 0.0f || squared < 1e-12f) continue;
    float k = law.stiffness;
    float c = law.damping;
#if defined(SCALED_STIFFNESS) || defined(SCALED_DAMPING)
    const float mean = 0.5f * (factors[link.own] + factors[link.other]);
#endif
#ifdef SCALED_STIFFNESS
    k *= mean;
#endif
#ifdef SCALED_DAMPING
    c *= mean;
#endif
    const float inverse = rsqrt(squared);
    const float stretch = 1.0f - rest_length * inverse;
    const float across = k * min(fabs(stretch), 1.0f);
    const float along = (c + (k - across)) * inverse * inverse;
#if IMPLICIT == 2
    sums[link.lane] += along * dx * dx + across;
    sums[LANES + link.lane] += along * dy * dy + across;
    sums[2 * LANES + link.lane] += along * dz * dz + across;
#elif IMPLICIT == 3
    sums[link.lane] += along * dx * dy;
    sums[LANES + link.lane] += along * dx * dz;
    sums[2 * LANES + link.lane] += along * dy * dz;
#else
#if IMPLICIT == 1
    const float h = law.step;
    const float spring = k * stretch;
#else
    const float h = 1.0f;
    const float spring = 0.0f;
#endif
    const float ux = h * link.ux;
    const float uy = h * link.uy;
    const float uz = h * link.uz;
    const float factor = spring + along * (dx * ux + dy * uy + dz * uz);
    sums[link.lane] += dx * factor + across * ux;
    sums[LANES + link.lane] += dy * factor + across * uy;
    sums[2 * LANES + link.lane] += dz * factor + across * uz;
#endif
  }
  return vector_of(sums);
}

/// The segment's part of a pass, once the sums over its links are known; drag
/// is h D/m.
__attribute__((always_inline)) void advance(const uint segment, Vector a, const Lanes free,
                                            __global const Lanes* source, __global const Lanes* base,
                                            __global const Lanes* second, __global const Lanes* third,
                                            __global Lanes* target, const Lanes drag, const Lanes over_mass,
                                            const float4 gravity, const float h, const uint mode,
                                            const uint all_free) {
  const Lanes by_mass = free * over_mass;
  __global Lanes* load = (__global Lanes*)second + 6 * segment;
#if IMPLICIT == 1
  const Vector v = loaded(source + 6 * segment + 3);
  const Lanes by_step = (Lanes)(h > 0.0f ? 1.0f / h : 0.0f);
  const Lanes mass = 1.0f / over_mass;
  const Vector b = {a.x * by_step + mass * (h * gravity.x - drag * v.x),
                    a.y * by_step + mass * (h * gravity.y - drag * v.y),
                    a.z * by_step + mass * (h * gravity.z - drag * v.z)};
  store(b, load);
  const Vector x = loaded(source + 6 * segment);
  store(x, target + 6 * segment);
  const Vector first = {by_mass * b.x, by_mass * b.y, by_mass * b.z};
  store(first, target + 6 * segment + 3);
  __global Lanes* before = (__global Lanes*)third + 6 * segment;
  store(x, before);
  store(zero_vector(), before + 3);
#elif IMPLICIT == 2
  store(a, load + 3);
#elif IMPLICIT == 3
  // The largest eigenvalue: q + 2 p, with q the mean and 6 p^2 = |T - q I|^2.
  const Vector own = loaded(load + 3);
  const Lanes q = (own.x + own.y + own.z) * (1.0f / 3.0f);
  const Vector apart = {own.x - q, own.y - q, own.z - q};
  const Lanes size = dot_of(apart, apart) + 2.0f * dot_of(a, a);
  const Lanes largest = q + 2.0f * sqrt(size * (1.0f / 6.0f));
  const Lanes bound = 1.0f + free * drag + 2.0f * by_mass * largest;
  load[3] = largest > 0.0f ? -bound : bound;
#else
  __global const float* all = (__global const float*)third;
  const Lanes own = load[3];
  const Lanes shared = (Lanes)(all[0]);
  const Lanes bound = own < 0.0f ? shared : own;
  const float momentum = gravity.x;
  const Lanes rate = gravity.y / bound;
  const Lanes size = (gravity.z > 0.0f ? 0.0f : 1.0f) + gravity.z / bound;
  const Lanes past = momentum * ((gravity.w > 0.0f ? 0.0f : 1.0f) + gravity.w / bound);
  const Lanes keep = size * (1.0f + momentum - rate * (1.0f + free * drag));
  const Lanes gain = rate * by_mass;
  const Vector u = loaded(source + 6 * segment + 3);
  const Vector b = loaded(load);
  __global Lanes* own_target = target + 6 * segment + 3;
  const Vector before = loaded(own_target);
  const Vector next = {keep * u.x + gain * (size * a.x + b.x) - past * before.x,
                       keep * u.y + gain * (size * a.y + b.y) - past * before.y,
                       keep * u.z + gain * (size * a.z + b.z) - past * before.z};
  store(next, own_target);
#endif
}
