/*
 * Deforms a detailed surface by the points it is bound to, by the
 * constant triangle basis (mapping paper 3.3.1, equations 4 to 7 and 9):
 *
 *   T  = norm(p2 - p1)        Bt = norm(p3 - p1)
 *   N  = norm(T x Bt)         B  = N x T
 *   v  = c + sum_i w_i p_i + o.x T + o.y N + o.z B      w_1 = 1 - w_2 - w_3
 *   n  = m.x T + m.y N + m.z B
 *
 * symbol  argument                            unit
 * p_i     positions, x y z and one unused     mm, relative to c
 * i       points, p1 p2 p3 and one unused     index into positions
 * w_2 w_3 bound[2 v].xy                       1, none negative, sum at most 1
 * o       bound[2 v].zw, bound[2 v + 1].x     mm, along T, N, B
 * m       bound[2 v + 1].yzw                  unit vector, along T, N, B
 * c       center_x, center_y, center_z        mm, LPS
 * v       vertices, x y z without a gap       mm, LPS
 * n       normals, x y z without a gap        unit vector, LPS
 *
 * Work-item: one vertex. Nothing is shared, nothing is atomic.
 * Preconditions: indices lie within positions; vertices and normals hold
 * 3 vertex_count floats. Degenerate triangles give the basis described in
 * modules/surface/src/triangle_basis.cpp, never NaN.
 * Source: equations 6, 7 and 9 of the mapping paper; each vector of the basis
 * is normalised here, which the paper's lines leave out.
 * CPU twin: palpate::surface::deform_reference.
 */

#define SHORT_EDGE_MM 1e-6f /* below the rounding of positions */
#define THIN_SINE 1e-3f     /* of the angle at p1 */

/* norm(edge), bent towards `instead` as the edge vanishes. */
float3 direction_of(float3 edge, float3 instead) {
  const float edge_length = sqrt(dot(edge, edge));
  if (edge_length > SHORT_EDGE_MM) return edge / edge_length;
  const float3 bent = edge + (SHORT_EDGE_MM - edge_length) * instead;
  const float bent_length = sqrt(dot(bent, bent));
  return bent_length > 0.1f * SHORT_EDGE_MM ? bent / bent_length : instead;
}

/* A unit vector across t: of the axis that t leans on least. */
float3 across(float3 t) {
  const float3 size = fabs(t);
  float3 axis = (float3)(1.0f, 0.0f, 0.0f);
  if (size.y < size.x && size.y <= size.z) axis = (float3)(0.0f, 1.0f, 0.0f);
  if (size.z < size.x && size.z < size.y) axis = (float3)(0.0f, 0.0f, 1.0f);
  const float3 rest = axis - dot(axis, t) * t;
  return rest / sqrt(dot(rest, rest));
}

float3 normal_of(float3 t, float3 b_t) {
  const float3 n = cross(t, b_t);
  const float sine = sqrt(dot(n, n));
  if (sine > THIN_SINE) return n / sine;
  const float3 filler = across(t);
  const float3 filled = n + (THIN_SINE - sine) * filler;
  const float filled_length = sqrt(dot(filled, filled));
  return filled_length > 0.1f * THIN_SINE ? filled / filled_length : filler;
}

__kernel void map_surface(__global const float4* positions, __global const uint4* points,
                          __global const float4* bound, float center_x, float center_y, float center_z,
                          uint vertex_count, __global float* vertices, __global float* normals) {
  const size_t vertex_index = get_global_id(0);
  if (vertex_index >= vertex_count) return;
  const uint4 corner = points[vertex_index];
  const float4 first = bound[2 * vertex_index];
  const float4 second = bound[2 * vertex_index + 1];
  const float3 p1 = positions[corner.x].xyz;
  const float3 edge2 = positions[corner.y].xyz - p1;
  const float3 edge3 = positions[corner.z].xyz - p1;

  const float3 t = direction_of(edge2, (float3)(1.0f, 0.0f, 0.0f));
  const float3 b_t = direction_of(edge3, (float3)(0.0f, 1.0f, 0.0f));
  const float3 n = normal_of(t, b_t);
  const float3 b = cross(n, t);

  const float3 from_p1 = first.x * edge2 + first.y * edge3 + first.z * t + first.w * n + second.x * b;
  const float3 center = (float3)(center_x, center_y, center_z);
  vstore3(center + (p1 + from_p1), vertex_index, vertices);
  vstore3(second.y * t + second.z * n + second.w * b, vertex_index, normals);
}
