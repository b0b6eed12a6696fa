// Points of a work-item as vector lanes, and where the ends of their links lie.
// On a CPU the compiler does not vectorise over work-items, so the lanes say it.
//
// Ends, in `partners` and `rest_lengths`:
//   [block of points][slot][point in the block]
// so that a work-item's ends are near each other (two streams of memory, not
// two for every slot), and those of neighbouring work-items side by side.
// Defines: POINTS_PER_ITEM = 1, 4, 8 or 16; LINKS_PER_POINT >= 1; COLUMN_BLOCK,
// a multiple of POINTS_PER_ITEM; SCALED_STIFFNESS, SCALED_DAMPING, SCALED_DRAG,
// SCALED_MASS where positions.w holds factors for these.
// CPU twin: simulation::column_place.
#define COLUMN(slot, point)                                                                           \
  ((point) / COLUMN_BLOCK * (COLUMN_BLOCK * LINKS_PER_POINT) + (slot) * COLUMN_BLOCK + (point) % COLUMN_BLOCK)

#if defined(SCALED_STIFFNESS) || defined(SCALED_DAMPING) || defined(SCALED_DRAG) || defined(SCALED_MASS)
#define SCALED
#endif

#if POINTS_PER_ITEM == 1
typedef float Lanes;
typedef uint Indices;
#define LOAD(from) (*(from))
#define LANE(lanes, n) (lanes)
#define EACH_LANE(use) use(0)
#define JOINED(component) (p0.component)
#elif POINTS_PER_ITEM == 4
typedef float4 Lanes;
typedef uint4 Indices;
#define LOAD(from) vload4(0, from)
#define LANE(lanes, n) (lanes).s##n
#define EACH_LANE(use) use(0) use(1) use(2) use(3)
#define JOINED(component) (float4)(p0.component, p1.component, p2.component, p3.component)
#elif POINTS_PER_ITEM == 8
typedef float8 Lanes;
typedef uint8 Indices;
#define LOAD(from) vload8(0, from)
#define LANE(lanes, n) (lanes).s##n
#define EACH_LANE(use) use(0) use(1) use(2) use(3) use(4) use(5) use(6) use(7)
#define JOINED(component)                                                                                    \
  (float8)(p0.component, p1.component, p2.component, p3.component, p4.component, p5.component, p6.component, \
           p7.component)
#elif POINTS_PER_ITEM == 16
typedef float16 Lanes;
typedef uint16 Indices;
#define LOAD(from) vload16(0, from)
#define LANE(lanes, n) (lanes).s##n
#define EACH_LANE(use)                                                                                      \
  use(0) use(1) use(2) use(3) use(4) use(5) use(6) use(7) use(8) use(9) use(a) use(b) use(c) use(d) use(e) \
      use(f)
#define JOINED(component)                                                                                      \
  (float16)(p0.component, p1.component, p2.component, p3.component, p4.component, p5.component, p6.component, \
            p7.component, p8.component, p9.component, pa.component, pb.component, pc.component, pd.component, \
            pe.component, pf.component)
#endif

/// Vectors of all lanes; w holds factors, where there are some.
typedef struct {
  Lanes x, y, z;
#ifdef SCALED
  Lanes w;
#endif
} Vectors;

/// The vectors at scattered places.
Vectors gathered(__global const float4* restrict from, const Indices at) {
#define READ(n) const float4 p##n = from[LANE(at, n)];
  EACH_LANE(READ)
#undef READ
  Vectors result;
  result.x = JOINED(x);
  result.y = JOINED(y);
  result.z = JOINED(z);
#ifdef SCALED
  result.w = JOINED(w);
#endif
  return result;
}

/// The vectors at consecutive places.
Vectors loaded(__global const float4* restrict from) {
#define READ(n) const float4 p##n = from[0x##n];
  EACH_LANE(READ)
#undef READ
  Vectors result;
  result.x = JOINED(x);
  result.y = JOINED(y);
  result.z = JOINED(z);
#ifdef SCALED
  result.w = JOINED(w);
#endif
  return result;
}
