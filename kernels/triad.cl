// The STREAM triad: what the device's memory gives, for figures to be held against.
//
// Equation, for every n:  a[n] = b[n] + s c[n]
// Symbols   arguments   units
//   a, b, c  a, b, c     pure numbers; moves 12 bytes a float
//   s        s           pure number
// Work-item: 16 consecutive floats. Preconditions: count is a multiple of 16.
// CPU twin: none; the measure itself is of the host where there is no device.
__kernel void triad(__global float* restrict a, __global const float* restrict b,
                    __global const float* restrict c, const float s, const uint count) {
  const uint item = get_global_id(0);
  if (item * 16u >= count) return;
  vstore16(vload16(item, b) + s * vload16(item, c), item, a);
}
