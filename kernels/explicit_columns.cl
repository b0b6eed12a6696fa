// Where the ends of a point's links lie, in `partners` and `rest_lengths`:
//   [block of points][slot][point in the block]
// so that a work-item's ends are near each other (two streams of memory, not
// two for every slot), and those of neighbouring work-items side by side.
// Defines: COLUMN_BLOCK, a multiple of POINTS_PER_ITEM; LINKS_PER_POINT.
// CPU twin: simulation::column_place.
#define COLUMN(slot, point)                                                                           \
  ((point) / COLUMN_BLOCK * (COLUMN_BLOCK * LINKS_PER_POINT) + (slot) * COLUMN_BLOCK + (point) % COLUMN_BLOCK)
