#pragma once

#include "palpate/compute/device.hpp"

#include <string>
#include <vector>

namespace palpate::compute {

/// One driver that the ICD loader is told to load.
struct DriverFile {
  std::string label;    ///< the .icd file, or the library where it is named directly
  std::string library;  ///< what the loader hands to dlopen
};

/// Found as the loader finds them (OCL_ICD_VENDORS, OPENCL_VENDOR_PATH,
/// OCL_ICD_FILENAMES, /etc/OpenCL/vendors), without loading any. Sorted by name.
std::vector<DriverFile> driver_files();

/// What can be seen of the drivers without loading them, a fact a line: the
/// files, their libraries' sizes and times, the linker's cache, and the
/// variables that drivers and loader listen to.
std::string driver_fingerprint(const std::vector<DriverFile>& files);

/// The variables that change what a driver makes of a kernel, a line each.
std::string driver_environment();

/// A driver that is left out, and why.
struct BadDriver {
  DriverFile file;
  std::string reason;
};

/// A device whose driver loads but that cannot run a trivial kernel.
struct FailingDevice {
  std::string platform;
  std::string name;
  std::string driver;
  int twin = 0;  ///< how many devices of the same three come before it
  std::string reason;
};

struct Screening {
  std::vector<BadDriver> drivers;
  std::vector<FailingDevice> devices;
};

/// Tries the drivers in child processes, or remembers how that went, and loads
/// the good ones into this process; once a process, as the ICD loader does.
/// Where the probe program is missing or PALPATE_PROBE is "off", none is tried.
const Screening& screened_drivers();

}  // namespace palpate::compute
