#include "palpate/compute/buffer.hpp"

#include "opencl.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>

namespace palpate::compute {

namespace {

std::string of_size(std::size_t bytes, const Device& device) {
  return std::to_string(bytes) + " bytes of " + device.info().name;
}

/// OpenCL has no empty buffers; an empty one of ours has room that nobody uses.
std::size_t room(std::size_t bytes) { return std::max<std::size_t>(bytes, 16); }

void check_range(std::size_t bytes, std::size_t offset, std::size_t size, const char* what) {
  if (offset > size || bytes > size - offset)
    throw core::Error(core::ErrorKind::internal, "buffer-range",
                      std::string(what) + " of " + std::to_string(bytes) + " bytes at " +
                          std::to_string(offset) + " leaves a device buffer of " + std::to_string(size) +
                          " bytes.");
}

OwnedMemory create(const Device& device, cl_mem_flags flags, std::size_t bytes, void* host) {
  cl_int code = CL_SUCCESS;
  OwnedMemory memory(clCreateBuffer(device.impl().context.get(), flags, bytes, host, &code));
  check(code, "clCreateBuffer", of_size(bytes, device));
  return memory;
}

}  // namespace

Buffer::Buffer() = default;
Buffer::Buffer(Buffer&&) noexcept = default;

Buffer& Buffer::operator=(Buffer&& other) noexcept {
  Buffer taken(std::move(other));
  std::swap(impl_, taken.impl_);
  return *this;
}

Buffer::~Buffer() {
  // The owner may free wrapped memory next; nothing queued may still write there.
  if (impl_ && impl_->over_host_memory) clFinish(impl_->device.impl().queue.get());
}

Buffer Buffer::allocate(const Device& device, std::size_t bytes) {
  Buffer buffer;
  buffer.impl_.reset(new Impl{device, bytes, false, create(device, CL_MEM_READ_WRITE, room(bytes), nullptr)});
  return buffer;
}

Buffer Buffer::copy_of(const Device& device, const void* source, std::size_t bytes) {
  Buffer buffer = allocate(device, bytes);
  buffer.write(source, bytes);
  return buffer;
}

Buffer Buffer::over_host_memory(const Device& device, void* memory, std::size_t bytes) {
  if (memory == nullptr || bytes == 0)
    throw core::Error(core::ErrorKind::internal, "buffer-host", "No host memory to wrap as a device buffer.");
  Buffer buffer;
  buffer.impl_.reset(
      new Impl{device, bytes, true, create(device, CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, bytes, memory)});
  return buffer;
}

std::size_t Buffer::bytes() const noexcept { return impl_ ? impl_->bytes : 0; }

void Buffer::write(const void* source, std::size_t bytes, std::size_t offset_bytes) {
  check_range(bytes, offset_bytes, this->bytes(), "A write");
  if (bytes == 0) return;
  check_at_work(clEnqueueWriteBuffer(impl_->device.impl().queue.get(), impl_->memory.get(), CL_TRUE,
                                     offset_bytes, bytes, source, 0, nullptr, nullptr),
                "clEnqueueWriteBuffer", of_size(bytes, impl_->device), impl_->device);
}

void Buffer::read(void* target, std::size_t bytes, std::size_t offset_bytes) const {
  check_range(bytes, offset_bytes, this->bytes(), "A read");
  if (bytes == 0) return;
  check_at_work(clEnqueueReadBuffer(impl_->device.impl().queue.get(), impl_->memory.get(), CL_TRUE,
                                    offset_bytes, bytes, target, 0, nullptr, nullptr),
                "clEnqueueReadBuffer", of_size(bytes, impl_->device), impl_->device);
}

void Buffer::copy_from(const Buffer& source, std::size_t bytes) {
  check_range(bytes, 0, this->bytes(), "A copy");
  check_range(bytes, 0, source.bytes(), "A copy");
  if (bytes == 0) return;
  check_at_work(clEnqueueCopyBuffer(impl_->device.impl().queue.get(), source.impl_->memory.get(),
                                    impl_->memory.get(), 0, 0, bytes, 0, nullptr, nullptr),
                "clEnqueueCopyBuffer", of_size(bytes, impl_->device), impl_->device);
}

void Buffer::fill_zero() {
  if (bytes() == 0) return;
  const cl_uchar zero = 0;
  check_at_work(clEnqueueFillBuffer(impl_->device.impl().queue.get(), impl_->memory.get(), &zero,
                                    sizeof(zero), 0, bytes(), 0, nullptr, nullptr),
                "clEnqueueFillBuffer", of_size(bytes(), impl_->device), impl_->device);
}

void Buffer::sync_to_host() const {
  visit([](const void*) {});
}

void Buffer::visit(const std::function<void(const void*)>& reader) const {
  if (bytes() == 0) return;
  cl_command_queue queue = impl_->device.impl().queue.get();
  cl_int code = CL_SUCCESS;
  void* mapped = clEnqueueMapBuffer(queue, impl_->memory.get(), CL_TRUE, CL_MAP_READ, 0, bytes(), 0, nullptr,
                                    nullptr, &code);
  check_at_work(code, "clEnqueueMapBuffer", of_size(bytes(), impl_->device), impl_->device);
  const auto unmap = [&] {
    return clEnqueueUnmapMemObject(queue, impl_->memory.get(), mapped, 0, nullptr, nullptr);
  };
  try {
    reader(mapped);
  } catch (...) {
    unmap();
    throw;
  }
  check_at_work(unmap(), "clEnqueueUnmapMemObject", of_size(bytes(), impl_->device), impl_->device);
  // Wrapped memory is the host's own: it must be unmapped before the host writes there.
  if (impl_->over_host_memory) impl_->device.finish();
}

}  // namespace palpate::compute
