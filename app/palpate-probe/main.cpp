// Loads the OpenCL drivers in a process of its own, which they may end (docs/house.md).
#include "palpate/compute/probe.hpp"

int main(int argc, char** argv) { return palpate::compute::probe_main(argc, argv); }
