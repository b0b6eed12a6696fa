#pragma once

#include "palpate/compute/buffer.hpp"
#include "palpate/compute/device.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace palpate::compute {

/// One kernel with its arguments. Movable.
class Kernel {
 public:
  struct Impl;

  Kernel();
  explicit Kernel(std::unique_ptr<Impl> impl);
  ~Kernel();
  Kernel(Kernel&&) noexcept;
  Kernel& operator=(Kernel&&) noexcept;

  void set(unsigned argument, const Buffer& buffer);
  void set(unsigned argument, float value);
  void set(unsigned argument, std::int32_t value);
  void set(unsigned argument, std::uint32_t value);
  void set(unsigned argument, const std::array<float, 4>& value);  ///< a float4
  /// Sets arguments 0, 1, 2, ... in order.
  template <typename... Values>
  void set_all(const Values&... values) {
    unsigned argument = 0;
    (set(argument++, values), ...);
  }
  /// Queues the kernel over `work_items`, rounded up to the work-group size:
  /// every kernel guards its own range. A device that allows only smaller
  /// groups gets its largest. The buffers that were set must live until the
  /// queue is done with them. Does not wait. Throws Error(device).
  void run(std::size_t work_items, std::size_t work_group = 64) const;

 private:
  std::unique_ptr<Impl> impl_;
};

/// A program of a device; only src/ of this module sees inside.
struct BuiltProgram;

/// Builds the .cl files of kernels/. They are embedded in the program; a
/// folder in PALPATE_KERNEL_DIR takes precedence, file by file (development).
class KernelLibrary {
 public:
  explicit KernelLibrary(Device device) : device_(std::move(device)) {}

  /// file: "explicit.cl" and so on. defines: {"LINKS_PER_POINT=12", ...};
  /// an entry that begins with '-' goes to the compiler as it is
  /// ("-cl-fast-relaxed-math"). VECTOR_WIDTH is always defined: the device's
  /// float_vector_width. What was built is kept on disk (cache_folder()) when
  /// the last of its kernels goes, and taken from there the next time; a
  /// damaged or refused file is built anew. PALPATE_KERNEL_CACHE=off: neither.
  /// Throws Error(device, "kernel-build") with the compiler's log in details()
  /// and its first error in the text.
  Kernel build(const std::string& file, const std::string& kernel,
               const std::vector<std::string>& defines = {});

  const Device& device() const noexcept { return device_; }
  /// The source that build() would compile: a line `#include "name.cl"` stands
  /// for that kernel file, once. Throws Error(internal) if there is none.
  static std::string source(const std::string& file);

 private:
  Device device_;
  std::vector<std::shared_ptr<BuiltProgram>> programs_;  ///< one per file and defines
};

}  // namespace palpate::compute
