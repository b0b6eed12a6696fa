#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace palpate::compute {

enum class DeviceType { cpu, gpu, accelerator, other };
std::string to_string(DeviceType type);

/// What is known of a device without opening it.
struct DeviceInfo {
  int index = 0;  ///< over all platforms, in the order of the ICD loader
  std::string name;
  std::string platform;
  std::string driver;  ///< driver version and OpenCL version
  DeviceType type = DeviceType::other;
  std::uint64_t memory_bytes = 0;
  std::uint64_t largest_buffer_bytes = 0;
  unsigned compute_units = 0;
  unsigned float_vector_width = 1;  ///< 1 on a GPU; the native width on a CPU
  bool usable = true;
  std::string reason;       ///< why it is (not) the default, or why it is not usable
  bool is_default = false;  ///< what open_device("") takes
};

/// All devices; empty where there is no driver. Never throws for a missing or
/// broken driver. Exactly one usable device is the default: a GPU before a
/// CPU before others, then the most memory.
std::vector<DeviceInfo> list_devices();

/// An opened device: a context and one in-order queue. A cheap handle; copies
/// share it. Use it from one thread at a time.
class Device {
 public:
  /// What of OpenCL is behind it; only src/ of this module sees inside.
  struct Impl;

  explicit Device(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
  const DeviceInfo& info() const noexcept;
  /// Waits until all that was queued is done. Throws Error(device).
  void finish() const;
  /// Hands what was queued to the device without waiting. Throws Error(device).
  void flush() const;
  Impl& impl() const noexcept { return *impl_; }

 private:
  std::shared_ptr<Impl> impl_;
};

/// selector: "" = the environment's PALPATE_DEVICE if set, else the default; a number = that index; else
/// a case-insensitive part of "name platform". Throws Error(device) naming
/// the devices that there are, or how to install one where there is none.
Device open_device(const std::string& selector);

/// True for the selector "reference" (or PALPATE_DEVICE=reference with an
/// empty selector): the CPU reference solver is asked for instead.
bool is_reference_selector(const std::string& selector);

}  // namespace palpate::compute
