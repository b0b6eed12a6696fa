// Vectors of LANES numbers: what the lattice kernels take at a time.
//
// Symbols: Lanes, LANES floats; Vector, x y z of LANES points; Place, where
//   LANES points are and how fast they move.
// LANES is 1, 4, 8 or 16 (a processor's width; 1 on a graphics card).
// Work-item: none; included by other kernels.
// CPU twin: none; plain arithmetic.
#if LANES == 1
typedef float Lanes;
typedef uint Whole;
typedef int Truth;
typedef ushort Stored;
#define TO_LANES convert_float
#define TO_WHOLE convert_uint
#define NEXT_LANES(own, next) (next)
#define PREVIOUS_LANES(own, previous) (previous)
#elif LANES == 4
typedef float4 Lanes;
typedef uint4 Whole;
typedef int4 Truth;
typedef ushort4 Stored;
#define TO_LANES convert_float4
#define TO_WHOLE convert_uint4
#define NEXT_LANES(own, next) ((float4)((own).s123, (next).s0))
#define PREVIOUS_LANES(own, previous) ((float4)((previous).s3, (own).s012))
#elif LANES == 8
typedef float8 Lanes;
typedef uint8 Whole;
typedef int8 Truth;
typedef ushort8 Stored;
#define TO_LANES convert_float8
#define TO_WHOLE convert_uint8
#define NEXT_LANES(own, next) ((float8)((own).s1234, (own).s567, (next).s0))
#define PREVIOUS_LANES(own, previous) ((float8)((previous).s7, (own).s012, (own).s3456))
#else
typedef float16 Lanes;
typedef uint16 Whole;
typedef int16 Truth;
typedef ushort16 Stored;
#define TO_LANES convert_float16
#define TO_WHOLE convert_uint16
#define NEXT_LANES(own, next) ((float16)((own).s12345678, (own).s9abc, (own).sdef, (next).s0))
#define PREVIOUS_LANES(own, previous) ((float16)((previous).sf, (own).s012, (own).s3456, (own).s789abcde))
#endif
// The same in one instruction: Clang's own word takes no detour over parts.
#ifdef __has_builtin
#if __has_builtin(__builtin_shufflevector)
#if LANES == 8
#undef NEXT_LANES
#undef PREVIOUS_LANES
#define NEXT_LANES(own, next) __builtin_shufflevector(own, next, 1, 2, 3, 4, 5, 6, 7, 8)
#define PREVIOUS_LANES(own, previous) __builtin_shufflevector(previous, own, 7, 8, 9, 10, 11, 12, 13, 14)
#elif LANES == 16
#undef NEXT_LANES
#undef PREVIOUS_LANES
#if defined(__x86_64__) && defined(__AVX512F__)
// LLVM takes a permutation instead, which wants a table in a register or from memory: 5 % slower.
float16 aligned_by_1(const float16 low, const float16 high) {
  float16 result;
  __asm__("valignd $1, %1, %2, %0" : "=v"(result) : "v"(low), "v"(high));
  return result;
}
float16 aligned_by_15(const float16 low, const float16 high) {
  float16 result;
  __asm__("valignd $15, %1, %2, %0" : "=v"(result) : "v"(low), "v"(high));
  return result;
}
#define NEXT_LANES(own, next) aligned_by_1(own, next)
#define PREVIOUS_LANES(own, previous) aligned_by_15(previous, own)
#else
#define NEXT_LANES(own, next) \
  __builtin_shufflevector(own, next, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16)
#define PREVIOUS_LANES(own, previous) \
  __builtin_shufflevector(previous, own, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30)
#endif
#endif
#endif
#endif

// About 1/sqrt(x), good to 1e-4 or better, where the processor has such an
// instruction; exact elsewhere.
#if LANES == 16 && defined(__AVX512F__)
#define ROUGH_RSQRT(x) __builtin_ia32_rsqrt14ps512_mask(x, x, (ushort)0xFFFF)
#elif LANES == 8 && defined(__AVX512VL__)
#define ROUGH_RSQRT(x) __builtin_ia32_rsqrt14ps256_mask(x, x, (uchar)0xFF)
#elif LANES == 8 && defined(__AVX__)
#define ROUGH_RSQRT(x) __builtin_ia32_rsqrtps256(x)
#elif LANES == 4 && defined(__SSE__)
#define ROUGH_RSQRT(x) __builtin_ia32_rsqrtps(x)
#else
#define RSQRT_IS_EXACT
#endif

typedef struct {
  Lanes x, y, z;
} Vector;

typedef struct {
  Vector x, v;
} Place;

Vector sum(const Vector a, const Vector b) {
  const Vector result = {a.x + b.x, a.y + b.y, a.z + b.z};
  return result;
}
Vector difference(const Vector a, const Vector b) {
  const Vector result = {a.x - b.x, a.y - b.y, a.z - b.z};
  return result;
}
Vector moved(const Vector a, const float4 by) {
  const Vector result = {a.x + by.x, a.y + by.y, a.z + by.z};
  return result;
}
/// a + h b
Vector step_along(const Vector a, const Lanes h, const Vector b) {
  const Vector result = {a.x + h * b.x, a.y + h * b.y, a.z + h * b.z};
  return result;
}
Lanes dot_of(const Vector a, const Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vector zero_vector() {
  const Vector result = {(Lanes)(0.0f), (Lanes)(0.0f), (Lanes)(0.0f)};
  return result;
}
/// Of each lane what the lane before it has.
Vector pushed(const Vector own, const Vector previous) {
  const Vector result = {PREVIOUS_LANES(own.x, previous.x), PREVIOUS_LANES(own.y, previous.y),
                         PREVIOUS_LANES(own.z, previous.z)};
  return result;
}
/// Of each lane what the lane after it has.
Vector pulled(const Vector own, const Vector next) {
  const Vector result = {NEXT_LANES(own.x, next.x), NEXT_LANES(own.y, next.y), NEXT_LANES(own.z, next.z)};
  return result;
}
Vector loaded(__global const Lanes* restrict from) {
  const Vector result = {from[0], from[1], from[2]};
  return result;
}
void store(const Vector value, __global Lanes* restrict to) {
  to[0] = value.x;
  to[1] = value.y;
  to[2] = value.z;
}
