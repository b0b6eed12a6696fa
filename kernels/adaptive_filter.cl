// The adaptive filter of Granlund and Knutsson, one block of a volume.
//
// Equation, hp_ij = u_i u_j H(rho) applied to the voxels x, H = 1 - lowpass:
//   q_k = lognormal(rho) (u.n_k)^2 on the half space u.n_k > 0, k = 1..6
//   T   = smoothed sum_k |q_k| (5/4 n_k n_kT - 1/4 I) = sum_n l_n e_n e_nT
//   b   = contrast (|lowpass| + floor)
//   g_1 = y^2/(y^2 + 1), y = l_1/b;  g_n = g_n-1 mu(l_n/l_n-1);
//   mu(r) = r^2/(r^2 + (1 - r)^2);   C = sum_n g_n e_n e_nT
//   result = x + sum_ij (C_ij - delta_ij) hp_ij, within low .. high
// The six products u_i u_j span the same highpass filters as the six
// (u.n_k)^2; with them <C, M_k> need not be formed.
//
// Symbols     arguments               units
//   x, T, hp  voxels, tensor, highpass  grey; xx yy zz xy xz yz, a field each
//   floor     floor_grey              grey
//   low, high  low, high              grey, the range of the scan
//   contrast  contrast                grey of T per grey
//   the rest  weights                 pure numbers, see each kernel
// Fields are padded blocks, i fastest. A region of one is told by
//   first       place of its first voxel in the field
//   row, plane  floats from one row, one plane, to the next
//   groups, rows, planes   its size; groups of LANES voxels along i
// Work-item: LANES consecutive voxels of a row, a lane each: on a CPU the
// compiler does not vectorise over work-items (1 on a GPU).
// Defines: LANES = 1, 4, 8 or 16.
// Preconditions: rows have LANES floats to spare after the region, which are
// written with what nobody reads; every tap lies inside the field's buffer.
// CPU twin: modules/imaging/src/adaptive/reference_engine.cpp.

#if LANES == 1
typedef float Lanes;
#define LOAD(from) (*(from))
#define STORE(lanes, to) (*(to) = (lanes))
#elif LANES == 4
typedef float4 Lanes;
#define LOAD(from) vload4(0, from)
#define STORE(lanes, to) vstore4(lanes, 0, to)
#elif LANES == 8
typedef float8 Lanes;
#define LOAD(from) vload8(0, from)
#define STORE(lanes, to) vstore8(lanes, 0, to)
#elif LANES == 16
typedef float16 Lanes;
#define LOAD(from) vload16(0, from)
#define STORE(lanes, to) vstore16(lanes, 0, to)
#endif

#define REGION const int first, const int row, const int plane, const int groups, const int rows, const int planes
/// Where the work-item's voxels begin; it ends here where there are none.
#define PLACE(place)                                                                           \
  const int item_ = (int)get_global_id(0);                                                     \
  if (item_ >= groups * rows * planes) return;                                                 \
  const int place = first + item_ / (groups * rows) * plane + item_ / groups % rows * row + \
                    item_ % groups * LANES;
#define EACH_OF_SIX(use) use(0) use(1) use(2) use(3) use(4) use(5)

// One axis of a blur: weights [0 .. radius] of the symmetric kernel's centre
// and the taps after it; stride: floats between neighbours along the axis.
// source_shift: where source's field begins in its buffer, against target's.
__kernel void blur(REGION, __global const float* restrict source, const int source_shift,
                   __global float* restrict target, const int target_shift,
                   __constant float* restrict weights, const int radius, const int stride) {
  PLACE(place)
  __global const float* restrict centre = source + source_shift + place;
  Lanes sum = weights[0] * LOAD(centre);
  for (int n = 1; n <= radius; ++n) sum += weights[n] * (LOAD(centre + n * stride) + LOAD(centre - n * stride));
  STORE(sum, target + target_shift + place);
}

// T before it is smoothed. offsets [tap_count]: places of half the taps
// against the centre; weights: six of the even centre, then for each tap six
// even and six odd; duals [6][6]: the tensor M_k of each direction.
// field: floats from one component of tensor to the next.
__kernel void structure(REGION, __global const float* restrict blurred, __global float* restrict tensor,
                        const int field, __constant int* restrict offsets,
                        __constant float* restrict weights, __constant float* restrict duals,
                        const int tap_count) {
  PLACE(place)
  __global const float* restrict centre = blurred + place;
  const Lanes middle = LOAD(centre);
#define BEGIN(k)                        \
  Lanes even##k = weights[k] * middle; \
  Lanes odd##k = (Lanes)(0.0f);
  EACH_OF_SIX(BEGIN)
#undef BEGIN
  __constant float* restrict tap = weights + 6;
  for (int n = 0; n < tap_count; ++n, tap += 12) {
    const Lanes after = LOAD(centre + offsets[n]);
    const Lanes before = LOAD(centre - offsets[n]);
    const Lanes sum = after + before;
    const Lanes difference = after - before;
#define ADD(k)             \
  even##k += tap[k] * sum; \
  odd##k += tap[6 + k] * difference;
    EACH_OF_SIX(ADD)
#undef ADD
  }
#define MAGNITUDE(k) even##k = sqrt(even##k * even##k + odd##k * odd##k);
  EACH_OF_SIX(MAGNITUDE)
#undef MAGNITUDE
#define COMPONENT(c)                                                                              \
  STORE(even0 * duals[c] + even1 * duals[6 + c] + even2 * duals[12 + c] + even3 * duals[18 + c] + \
            even4 * duals[24 + c] + even5 * duals[30 + c],                                        \
        tensor + c * field + place);
  EACH_OF_SIX(COMPONENT)
#undef COMPONENT
}

// What one level of the network adds to the highpass responses. offsets
// [tap_count]; weights: six of the centre, then six for each tap. fresh: 1
// where nothing was added before.
__kernel void add_highpass(REGION, __global const float* restrict level, __global float* restrict highpass,
                           const int field, __constant int* restrict offsets,
                           __constant float* restrict weights, const int tap_count, const int fresh) {
  PLACE(place)
  __global const float* restrict centre = level + place;
  const Lanes middle = LOAD(centre);
#define BEGIN(c) Lanes response##c = weights[c] * middle;
  EACH_OF_SIX(BEGIN)
#undef BEGIN
  __constant float* restrict tap = weights + 6;
  for (int n = 0; n < tap_count; ++n, tap += 6) {
    const Lanes sum = LOAD(centre + offsets[n]) + LOAD(centre - offsets[n]);
#define ADD(c) response##c += tap[c] * sum;
    EACH_OF_SIX(ADD)
#undef ADD
  }
#define FINISH(c)                                                 \
  {                                                               \
    __global float* restrict to = highpass + c * field + place;   \
    if (!fresh) response##c += LOAD(to);                          \
    STORE(response##c, to);                                       \
  }
  EACH_OF_SIX(FINISH)
#undef FINISH
}

#define TINY 1e-30f

/// Turns rows and columns p and q of the symmetric matrix (r is the third)
/// so that pq becomes zero, and the vectors with them (Jacobi).
#define TURN(pp, qq, pq, pr, qr, p, q)                                                       \
  {                                                                                          \
    const Lanes apart = qq - pp;                                                             \
    const Lanes tangent = 2.0f * pq * copysign((Lanes)(1.0f), apart) /                       \
                          (fabs(apart) + sqrt(apart * apart + 4.0f * pq * pq) + TINY);       \
    const Lanes cosine = 1.0f / sqrt(tangent * tangent + 1.0f);                              \
    const Lanes sine = tangent * cosine;                                                     \
    pp -= tangent * pq;                                                                      \
    qq += tangent * pq;                                                                      \
    pq = (Lanes)(0.0f);                                                                      \
    Lanes old = pr;                                                                          \
    pr = cosine * old - sine * qr;                                                           \
    qr = sine * old + cosine * qr;                                                           \
    old = p##x, p##x = cosine * old - sine * q##x, q##x = sine * old + cosine * q##x;        \
    old = p##y, p##y = cosine * old - sine * q##y, q##y = sine * old + cosine * q##y;        \
    old = p##z, p##z = cosine * old - sine * q##z, q##z = sine * old + cosine * q##z;        \
  }
/// Swaps two eigenvalues and their vectors where the first is the smaller.
#define EXCHANGE(a, b)            \
  {                               \
    const Lanes old = a;          \
    a = select(a, b, smaller);    \
    b = select(b, old, smaller);  \
  }
#define ORDER(pp, qq, p, q)                \
  {                                        \
    const Choice smaller = isless(pp, qq); \
    EXCHANGE(pp, qq)                       \
    EXCHANGE(p##x, q##x)                   \
    EXCHANGE(p##y, q##y)                   \
    EXCHANGE(p##z, q##z)                   \
  }
#if LANES == 1
typedef int Choice;
#elif LANES == 4
typedef int4 Choice;
#elif LANES == 8
typedef int8 Choice;
#elif LANES == 16
typedef int16 Choice;
#endif

Lanes mu(const Lanes smaller, const Lanes larger) {
  const Lanes r = smaller / (larger + TINY);
  return r * r / (r * r + (1.0f - r) * (1.0f - r));
}

// The control tensor of each voxel and the result. lowpass: the last level.
__kernel void combine(REGION, __global const float* restrict voxels, __global const float* restrict lowpass,
                      __global const float* restrict tensor, __global const float* restrict highpass,
                      const int field, __global float* restrict result, const float contrast,
                      const float floor_grey, const float low, const float high) {
  PLACE(place)
  Lanes xx = LOAD(tensor + place);
  Lanes yy = LOAD(tensor + field + place);
  Lanes zz = LOAD(tensor + 2 * field + place);
  const Lanes size = fabs(xx) + fabs(yy) + fabs(zz) + TINY;
  xx /= size;
  yy /= size;
  zz /= size;
  Lanes xy = LOAD(tensor + 3 * field + place) / size;
  Lanes xz = LOAD(tensor + 4 * field + place) / size;
  Lanes yz = LOAD(tensor + 5 * field + place) / size;
  const Lanes zero = (Lanes)(0.0f);
  const Lanes one = (Lanes)(1.0f);
  Lanes ax = one, ay = zero, az = zero, bx = zero, by = one, bz = zero, cx = zero, cy = zero, cz = one;
  for (int sweep = 0; sweep < 4; ++sweep) {
    TURN(xx, yy, xy, xz, yz, a, b)
    TURN(xx, zz, xz, xy, yz, a, c)
    TURN(yy, zz, yz, xy, xz, b, c)
  }
  ORDER(xx, yy, a, b)
  ORDER(xx, zz, a, c)
  ORDER(yy, zz, b, c)
  const Lanes first_value = fmax(xx, 0.0f);
  const Lanes second_value = fmax(yy, 0.0f);
  const Lanes third_value = fmax(zz, 0.0f);
  const Lanes ratio =
      first_value * size / (contrast * (fabs(LOAD(lowpass + place)) + floor_grey) + TINY);
  // 1/(1 + 1/y^2) does not overflow where y^2 would.
  const Lanes inverse = 1.0f / fmax(ratio, 1e-15f);
  const Lanes ga = 1.0f / (1.0f + inverse * inverse);
  const Lanes gb = ga * mu(second_value, first_value);
  const Lanes gc = gb * mu(third_value, second_value);
#define CONTROL(i, j) (ga * a##i * a##j + gb * b##i * b##j + gc * c##i * c##j)
  Lanes sum = LOAD(voxels + place);
  sum += (CONTROL(x, x) - 1.0f) * LOAD(highpass + place);
  sum += (CONTROL(y, y) - 1.0f) * LOAD(highpass + field + place);
  sum += (CONTROL(z, z) - 1.0f) * LOAD(highpass + 2 * field + place);
  sum += 2.0f * CONTROL(x, y) * LOAD(highpass + 3 * field + place);
  sum += 2.0f * CONTROL(x, z) * LOAD(highpass + 4 * field + place);
  sum += 2.0f * CONTROL(y, z) * LOAD(highpass + 5 * field + place);
  STORE(clamp(sum, low, high), result + place);
}
