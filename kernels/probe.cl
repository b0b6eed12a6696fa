// A device is tried with this before it is trusted.
//
// Equation: y_i = 2 i + 1
// Symbols   arguments   units
//   y       values      none
// Work-item: a value. Preconditions: room for `count` values.
// CPU twin: the check in palpate-probe (modules/compute/src/probe.cpp).
__kernel void probe(__global uint* restrict values, const uint count) {
  const uint i = get_global_id(0);
  if (i < count) values[i] = 2 * i + 1;
}
