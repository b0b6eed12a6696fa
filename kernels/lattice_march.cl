// Many stages over a lattice in one launch, for a processor's cores.
//
// Equation: lattice.cl's, stage by stage as `passes` says.
// A launch of a stage costs a core's sleep and waking each time, as much as
// some hundred segments. Here every core takes tasks, a chunk of a pass each,
// until none are left.
// Order: a turn is PASSES_AT_ONCE passes over a band of rows, slab b of the nth
// on diagonal b + n, so that a slab is still in the cache when its next pass
// comes; then the next band, then the next passes. Turns go to the queues one
// after the other, and a core keeps to one queue: it has a turn to itself, and
// the next turn follows a few slabs behind on another core.
// A task is taken when what it needs is done: the pass before in the slab above,
// and so below that; this pass in the slab below, whose forces are `waiting`, and
// one slab further in the band before, whose forces are too. The band after must
// have ended the turn before. Needs come earlier in the order and nobody waits
// with a task in hand: so somebody always goes on, also where only one group runs
// at a time.
//
// Symbols     arguments                    units
//   y S2 S3 S4                             as lattice.cl's source and target
//   passes    three float4 a pass: (source, base, target as 0 .. 3, mode; bits of uint),
//             (h, k q, k o, beat's scale) and gravity; pass n is entry n + first_pass, mod `period`
//   chunks    of [nth pass of a turn][band][slab]; where there is one band, of [slab]
//   progress  zero before and after, 16 numbers each: groups that came and left;
//             tasks taken of each queue; passes done of each [band][slab]
//   the others as in lattice.cl
// Work-item: alone in its group, takes tasks. Preconditions: as in lattice.cl; bands
// as march_schedule_of makes them; a trash segment for each work-item.
// CPU twin: simulation::make_reference_solver.
#define MARCH
#include "lattice.cl"

#define PASSES_AT_ONCE 2u
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
                    volatile __global uint* progress, __global const float4* restrict passes,
                    const uint slab_count, const uint band_count, const uint queues, const uint pass_count,
                    const uint first_pass, const uint period, const uint first_trash, const uint all_free,
                    const float stiffness, const float damping, const float drag, const float over_mass,
                    const float4 step_x, const float4 step_y, const float4 step_z) {
  const uint trash = first_trash + get_global_id(0);
  const uint turns = (pass_count + PASSES_AT_ONCE - 1) / PASSES_AT_ONCE * band_count;
  const uint in_turn = (slab_count + PASSES_AT_ONCE - 1) * PASSES_AT_ONCE;
  volatile __global uint* taken = progress + APART;
  volatile __global uint* done = taken + APART * queues;
  const uint home = atomic_inc(progress) % queues;
  uint queue = home;
  uint looks = 0;
  for (uint ended = 0; ended < queues;) {
    const uint task = taken[APART * queue];
    const uint turn = task / in_turn * queues + queue;
    if (turn >= turns) {
      ++ended;
      queue = (queue + 1) % queues;
      continue;
    }
    ended = 0;
    const uint which = task % PASSES_AT_ONCE;
    const uint slab = task % in_turn / PASSES_AT_ONCE - which;
    const uint band = turn % band_count;
    const uint pass = turn / band_count * PASSES_AT_ONCE + which;
    const bool is_one = slab < slab_count && pass < pass_count;
    volatile __global uint* own = done + APART * (band * slab_count + slab);
    if (is_one) {
      const uint above = slab + 1 < slab_count ? APART : 0;
      const uint beside = APART * slab_count;
      const bool is_ready = own[above] >= pass && (slab == 0 || own[-(int)APART] > pass) &&
                            (band == 0 || (own - beside)[above] > pass) &&
                            (which != 0 || band + 1 == band_count || (own + beside)[above] >= pass);
      if (!is_ready) {  // another queue's may be: its core is slow then, or not there
        if (queue == home && ++looks <= PATIENCE) continue;
        looks = 0;
        queue = (queue + 1) % queues;  // all of them in turn: any may have what the others wait for
        continue;
      }
    }
    if (atomic_cmpxchg(taken + APART * queue, task, task + 1) != task || !is_one) continue;
    looks = 0;
    const uint chunk = (band_count == 1 ? 0 : which * band_count + band) * slab_count + slab;
    SEE_OTHERS();
    __global const float4* numbered = passes + 3 * ((pass + first_pass) % period);
    const uint4 names = as_uint4(numbered[0]);
    const float4 numbers = numbered[1];
    walk(state_named(names.x, y, s2, s3, s4), state_named(names.y, y, s2, s3, s4), second, third,
         state_named(names.z, y, s2, s3, s4), waiting, rest, rows, entries, chunks[chunk], chunks[chunk + 1],
         overflow_begins, overflow, freedom, factors, trash, all_free, names.w, numbers.x, stiffness, numbers.y,
         numbers.z, damping, numbers.w, drag, numbered[2], over_mass, step_x, step_y, step_z);
    SHOW_OTHERS();
    atomic_inc(own);
  }
  if (atomic_inc(progress + 1) + 1 == get_global_size(0)) {
    progress[0] = 0;
    progress[1] = 0;
    for (uint n = 0; n < queues + band_count * slab_count; ++n) taken[APART * n] = 0;
  }
}
