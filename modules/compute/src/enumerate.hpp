#pragma once

#include "opencl.hpp"

#include <vector>

namespace palpate::compute {

/// A device of this process' OpenCL.
struct Found {
  DeviceInfo info;
  cl_platform_id platform = nullptr;
  cl_device_id device = nullptr;
};

/// All of them, in the loader's order, without a default. Loads every driver
/// that the loader is told of, whatever that driver does.
std::vector<Found> enumerate();

/// Opens one of them. Throws Error(device).
Device open_found(const Found& found);

}  // namespace palpate::compute
