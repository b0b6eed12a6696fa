#pragma once

#include "palpate/compute/device.hpp"

#include <cstddef>
#include <functional>
#include <memory>

namespace palpate::compute {

/// Memory of a device. Movable, not copyable. All calls throw Error(device)
/// and name the OpenCL call that failed and the size.
class Buffer {
 public:
  struct Impl;

  Buffer();
  ~Buffer();
  Buffer(Buffer&&) noexcept;
  Buffer& operator=(Buffer&&) noexcept;

  /// Uninitialised device memory.
  static Buffer allocate(const Device& device, std::size_t bytes);
  /// Device memory with a copy of `bytes` at `source`.
  static Buffer copy_of(const Device& device, const void* source, std::size_t bytes);
  /// Wraps host memory that lives longer than the buffer (CL_MEM_USE_HOST_PTR):
  /// on a CPU device kernels write straight into it. Align it to 64 bytes.
  /// Call sync_to_host() after the kernels that wrote it and before reading.
  static Buffer over_host_memory(const Device& device, void* memory, std::size_t bytes);

  explicit operator bool() const noexcept { return impl_ != nullptr; }
  std::size_t bytes() const noexcept;
  void write(const void* source, std::size_t bytes, std::size_t offset_bytes = 0);  ///< blocking
  void read(void* target, std::size_t bytes, std::size_t offset_bytes = 0) const;   ///< blocking
  void copy_from(const Buffer& source, std::size_t bytes);                          ///< queued
  void fill_zero();                                                                 ///< queued
  /// Shows the contents to `reader` without a copy where device memory is the
  /// host's (blocking map, then unmap). The pointer is valid in the call only.
  void visit(const std::function<void(const void*)>& reader) const;
  void sync_to_host() const;  ///< blocking map and unmap; only for over_host_memory
  Impl& impl() const noexcept { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::compute
