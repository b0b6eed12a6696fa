// The published layout, written anew: what this program's speed is measured
// against. An array of point structs with their links inside, one work-item a
// point, four launches of `evaluate` and one of `integrate` a step.
//
// Equation (thesis 3.2.1, equations 3 and 4), unit mass:
//   k_1 = f(y), k_2 = f(y + h/2 k_1), k_3 = f(y + h/2 k_2), k_4 = f(y + h k_3)
//   y'  = y + h/6 (k_1 + 2 k_2 + 2 k_3 + k_4)
//   f   = (v, sum n [ k (l - L0) + c n.(v_j - v_i) ] - D v), scaled by (1 - alpha)
// Symbols     arguments                    units
//   y         points[].state               mm, mm/s (xyz; w is zero)
//   k_i       derivatives                  mm/s, mm/s^2
//   j, L0     points[].links               index or NO_POINT, mm
//   alpha     points[].selectance          0 .. 1
//   k, c, D   stiffness, damping, drag     1/s^2, 1/s, 1/s
//   h         h: as said at each kernel    s
// Work-item: a point. Defines: LINKS_PER_POINT >= 1; PADDING, the bytes that
// fill the struct (40 + 8 LINKS_PER_POINT) up to a multiple of 16.
// Preconditions: one buffer of derivatives a stage; no two points coincide.
// CPU twin: simulation::make_reference_solver.
#define NO_POINT 0xffffffffu

typedef struct {
  float4 position;
  float4 velocity;
} Motion;

typedef struct {
  uint partner;
  float rest_length;
} Link;

typedef struct {
  Motion state;
  float intensity;
  float selectance;
  Link links[LINKS_PER_POINT];
#if PADDING > 0
  char padding[PADDING];
#endif
} Point;

/// The state of point `id`, `h` further along `derivatives`, where there are any.
Motion moved(__global const Point* points, __global const Motion* derivatives, const uint id, const float h) {
  Motion state = points[id].state;
  if (derivatives != 0) {
    state.position += h * derivatives[id].position;
    state.velocity += h * derivatives[id].velocity;
  }
  return state;
}

float4 link_force(const Motion here, const Motion there, const float rest_length, const float stiffness,
                  const float damping) {
  const float4 direction = normalize(there.position - here.position);
  const float extension = distance(there.position, here.position) - rest_length;
  const float parting = dot(direction, there.velocity) - dot(direction, here.velocity);
  return direction * (stiffness * extension + damping * parting);
}

// derivatives_out = f(y + h derivatives_in); no derivatives_in: f(y).
__kernel void evaluate(__global const Point* points, __global const Motion* derivatives_in,
                       __global Motion* derivatives_out, const uint point_count, const float stiffness,
                       const float damping, const float drag, const float h) {
  const uint id = get_global_id(0);
  if (id >= point_count) return;
  const Motion here = moved(points, derivatives_in, id, h);
  float4 force = -drag * here.velocity;
  for (uint slot = 0; slot < LINKS_PER_POINT; ++slot) {
    const Link link = points[id].links[slot];
    if (link.partner == NO_POINT) continue;
    force += link_force(here, moved(points, derivatives_in, link.partner, h), link.rest_length, stiffness, damping);
  }
  const float freedom = 1.0f - points[id].selectance;
  Motion derivative;
  derivative.position = freedom * here.velocity;
  derivative.velocity = freedom * force;
  derivatives_out[id] = derivative;
}

// y += h (k1 + 2 k2 + 2 k3 + k4); h is a sixth of a step.
__kernel void integrate(__global Point* points, __global const Motion* k1, __global const Motion* k2,
                        __global const Motion* k3, __global const Motion* k4, const uint point_count,
                        const float h) {
  const uint id = get_global_id(0);
  if (id >= point_count) return;
  Motion state = points[id].state;
  state.position += h * (k1[id].position + 2.0f * (k2[id].position + k3[id].position) + k4[id].position);
  state.velocity += h * (k1[id].velocity + 2.0f * (k2[id].velocity + k3[id].velocity) + k4[id].velocity);
  points[id].state = state;
}
