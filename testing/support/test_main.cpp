#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

// POCL keeps compiled kernels under the home folder unless it is told
// otherwise, and so do we; tests leave nothing there. Caches given from outside
// stay. Drivers are not tried again for each test, and nothing that was
// measured on the machine may change a result.
int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  const palpate::testing::TemporaryFolder cache;
  setenv("POCL_CACHE_DIR", cache.path().c_str(), 0);
  setenv("PALPATE_CACHE_DIR", (cache / "palpate").c_str(), 0);
  setenv("PALPATE_PROBE", "off", 0);
  setenv("PALPATE_KERNEL_CACHE", "off", 0);
  setenv("PALPATE_TUNING", "off", 0);
  return RUN_ALL_TESTS();
}
