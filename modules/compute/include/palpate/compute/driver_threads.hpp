#pragma once

namespace palpate::compute {

/// Asks PoCL to keep each of its threads on a processor of its own. Left to the
/// scheduler, two of them that wake together may share a processor for tenths of
/// a second, and a lattice's cores wait for one another (docs/adr/0014).
/// To be called before the first other thread and the first look for devices,
/// since it sets an environment variable, POCL_AFFINITY. Does nothing where that
/// is set already, or where the process may not run on every processor: PoCL ends
/// a program that may not bind its nth thread to processor n.
void bind_driver_threads();

}  // namespace palpate::compute
