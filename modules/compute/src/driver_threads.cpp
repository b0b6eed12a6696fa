#include "palpate/compute/driver_threads.hpp"

#include <cstdlib>

#ifdef __linux__
#include <sched.h>
#include <unistd.h>
#endif

namespace palpate::compute {

void bind_driver_threads() {
#ifdef __linux__
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
  const long processors = sysconf(_SC_NPROCESSORS_CONF);
  if (processors < 1 || CPU_COUNT(&allowed) != processors) return;
  for (int n = 0; n < processors; ++n)
    if (!CPU_ISSET(n, &allowed)) return;
  setenv("POCL_AFFINITY", "1", 0);
#endif
}

}  // namespace palpate::compute
