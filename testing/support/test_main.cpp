#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

// POCL keeps compiled kernels under the home folder unless it is told
// otherwise; tests leave nothing there. A cache given from outside stays.
int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  const palpate::testing::TemporaryFolder cache;
  setenv("POCL_CACHE_DIR", cache.path().c_str(), 0);
  return RUN_ALL_TESTS();
}
