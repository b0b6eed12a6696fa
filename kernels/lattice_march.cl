// Many stages over a lattice in one launch, for a processor's cores.
//
// Equation: lattice.cl's, stage by stage as `passes` says.
// A launch of a stage costs a core's sleep and waking each time, as much as
// some hundred segments. Here every core takes tasks, a chunk of a pass each,
// until none are left.
// Order: passes go in fours, a slab each on a diagonal: slab b of pass p on
// diagonal b + 2 p, so that those of a diagonal do not need each other and a
// slab is still in the cache when the next pass comes. The next four follow
// `stride` diagonals later. With two queues, the first and the last two passes
// each, a core keeps to one, since what it wrote is in its own cache.
// A task is taken when what it needs is done: its chunk and those beside it have
// had the pass before, those of the slab below this pass too, since their forces
// are `waiting`. Needs come earlier in the order and nobody waits with a task in
// hand: so somebody always goes on, also where only one group runs at a time.
//
// Symbols     arguments                    units
//   y S2 S3 S4                             as lattice.cl's source and target
//   passes    three float4 a pass: (source, base, target as 0 .. 3, mode; bits of uint),
//             (h, k q, k o, beat's scale) and gravity; pass n is entry n + first_pass, mod `period`
//   slabs     first chunk, chunks
//   needs     chunks, from needs_begins of a chunk; the top bit: this pass too
//   progress  zero before and after, 16 numbers each: groups that came and left;
//             tasks taken of each queue; passes done of each chunk
//   the others as in lattice.cl
// Work-item: alone in its group, takes tasks. Preconditions: as in lattice.cl;
//   stride >= slab_count and >= 8; one queue or two; a trash segment for each work-item.
// CPU twin: simulation::make_reference_solver.
#define MARCH
#include "lattice.cl"

#define PASSES_AT_ONCE 4u
// OpenCL 1.2 orders nothing between groups; Clang's own words do, also for its optimiser.
#ifdef __has_builtin
#if __has_builtin(__c11_atomic_thread_fence)
#define SEE_OTHERS() __c11_atomic_thread_fence(__ATOMIC_ACQUIRE)
#define SHOW_OTHERS() __c11_atomic_thread_fence(__ATOMIC_RELEASE)
#endif
#endif
#ifndef SEE_OTHERS
#define SEE_OTHERS() mem_fence(CLK_GLOBAL_MEM_FENCE)
#define SHOW_OTHERS() mem_fence(CLK_GLOBAL_MEM_FENCE)
#endif
#define PATIENCE 500u  // looks at the own queue before the other's
#define APART 16u  // counters of two chunks are not on one cache line

__global Lanes* state_named(const uint name, __global Lanes* y, __global Lanes* s2, __global Lanes* s3,
                            __global Lanes* s4) {
  return name == 0 ? y : name == 1 ? s2 : name == 2 ? s3 : s4;
}

__kernel void march(__global Lanes* y, __global Lanes* s2, __global Lanes* s3, __global Lanes* s4,
                    __global const Lanes* second, __global const Lanes* third, __global Lanes* waiting,
                    __global const Stored* restrict rest, __global const uint4* restrict rows,
                    __global const uint2* restrict entries, __global const uint* restrict chunks,
                    __global const uint* restrict overflow_begins, __global const uint4* restrict overflow,
                    __global const Lanes* restrict freedom, __global const Lanes* restrict factors,
                    __global const uint2* restrict slabs,
                    __global const uint* restrict needs_begins, __global const uint* restrict needs,
                    volatile __global uint* progress, __global const float4* restrict passes,
                    const uint slab_count, const uint chunk_count, const uint chunks_in_slab, const uint queues,
                    const uint stride, const uint pass_count, const uint first_pass, const uint period,
                    const uint first_trash, const uint all_free, const float stiffness, const float damping,
                    const float drag, const float over_mass, const float4 step_x, const float4 step_y,
                    const float4 step_z) {
  const uint trash = first_trash + get_global_id(0);
  const uint each = PASSES_AT_ONCE / queues;  // passes of a diagonal in a queue
  const uint fours = (pass_count + PASSES_AT_ONCE - 1) / PASSES_AT_ONCE;
  const uint tasks = ((fours - 1) * stride + slab_count + 2 * (PASSES_AT_ONCE - 1)) * each * chunks_in_slab;
  volatile __global uint* taken = progress + APART;
  volatile __global uint* done = taken + APART * queues;
  const uint home = atomic_inc(progress) % queues;
  uint queue = home;
  uint looks = 0;
  for (uint ended = 0; ended < queues;) {
    const uint task = taken[APART * queue];
    if (task >= tasks) {
      ++ended;
      queue = (queue + 1) % queues;
      continue;
    }
    ended = 0;
    const uint diagonal = task / (each * chunks_in_slab);
    const uint which = task / chunks_in_slab % each + each * queue;
    const uint part = task % chunks_in_slab;
    const uint along = diagonal - 2 * which;
    const uint slab = along % stride;
    const uint pass = PASSES_AT_ONCE * (along / stride) + which;
    const bool is_one =
        diagonal >= 2 * which && pass < pass_count && slab < slab_count && part < slabs[slab].y;
    const uint chunk = is_one ? slabs[slab].x + part : 0;
    bool is_ready = true;
    if (is_one)
      for (uint n = needs_begins[chunk]; is_ready && n < needs_begins[chunk + 1]; ++n)
        is_ready = done[APART * (needs[n] & 0x7fffffffu)] >= pass + (needs[n] >> 31);
    if (!is_ready) {  // the other queue's may be: its core is slow then, or not there
      if (++looks > PATIENCE) queue = (queue + 1) % queues;
      continue;
    }
    if (atomic_cmpxchg(taken + APART * queue, task, task + 1) != task || !is_one) continue;
    looks = 0;
    SEE_OTHERS();
    __global const float4* numbered = passes + 3 * ((pass + first_pass) % period);
    const uint4 names = as_uint4(numbered[0]);
    const float4 numbers = numbered[1];
    walk(state_named(names.x, y, s2, s3, s4), state_named(names.y, y, s2, s3, s4), second, third,
         state_named(names.z, y, s2, s3, s4), waiting, rest, rows, entries, chunks[chunk], chunks[chunk + 1],
         overflow_begins, overflow, freedom, factors, trash, all_free, names.w, numbers.x, stiffness, numbers.y,
         numbers.z, damping, numbers.w, drag, numbered[2], over_mass, step_x, step_y, step_z);
    SHOW_OTHERS();
    atomic_inc(done + APART * chunk);
    queue = home;
  }
  if (atomic_inc(progress + 1) + 1 == get_global_size(0)) {
    progress[0] = 0;
    progress[1] = 0;
    for (uint n = 0; n < queues + chunk_count; ++n) taken[APART * n] = 0;
  }
}
