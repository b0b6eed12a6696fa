#pragma once

#define CL_TARGET_OPENCL_VERSION 120
#include "palpate/compute/buffer.hpp"
#include "palpate/compute/device.hpp"
#include "palpate/compute/kernel_library.hpp"

#include <CL/cl.h>

#include <string>
#include <utility>

namespace palpate::compute {

/// "CL_OUT_OF_RESOURCES" for CL_OUT_OF_RESOURCES; the number where it is unknown.
std::string code_name(cl_int code);

/// Throws Error(device, "opencl") unless `code` is CL_SUCCESS. `call` is the
/// OpenCL function, `what` says on what, with sizes.
void check(cl_int code, const char* call, const std::string& what);

/// The same for a call to a device that is at work: a code that means that the
/// device is gone becomes Error(device, "device-lost"), which a run may outlive.
void check_at_work(cl_int code, const char* call, const std::string& what, const Device& device);

/// Owns one reference of an OpenCL object.
template <typename Handle, cl_int (*release)(Handle)>
class Owned {
 public:
  Owned() noexcept = default;
  explicit Owned(Handle handle) noexcept : handle_(handle) {}
  ~Owned() { reset(); }
  Owned(Owned&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Owned& operator=(Owned&& other) noexcept {
    if (this != &other) {
      reset();
      handle_ = std::exchange(other.handle_, nullptr);
    }
    return *this;
  }
  Owned(const Owned&) = delete;
  Owned& operator=(const Owned&) = delete;
  Handle get() const noexcept { return handle_; }

 private:
  void reset() noexcept {
    if (handle_ != nullptr) release(handle_);
    handle_ = nullptr;
  }
  Handle handle_ = nullptr;
};

using OwnedContext = Owned<cl_context, clReleaseContext>;
using OwnedQueue = Owned<cl_command_queue, clReleaseCommandQueue>;
using OwnedMemory = Owned<cl_mem, clReleaseMemObject>;
using OwnedProgram = Owned<cl_program, clReleaseProgram>;
using OwnedKernel = Owned<cl_kernel, clReleaseKernel>;

/// Buffers and kernels keep their Device, so this outlives them all and the
/// order in which a process takes its objects down does not matter.
struct Device::Impl {
  DeviceInfo info;
  cl_device_id device = nullptr;
  OwnedContext context;
  OwnedQueue queue;  ///< after the context: released before it
  /// For tests (PALPATE_FAIL_AFTER_LAUNCHES): kernels that still run before the
  /// device is lost; below zero: it is not going to be.
  long launches_left = -1;
  bool lost = false;  ///< by that wish
};

struct Buffer::Impl {
  Device device;
  std::size_t bytes = 0;
  bool over_host_memory = false;
  OwnedMemory memory;
};

}  // namespace palpate::compute
