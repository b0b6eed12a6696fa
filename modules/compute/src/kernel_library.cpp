#include "palpate/compute/kernel_library.hpp"

#include "embedded_kernels.hpp"
#include "kernel_cache.hpp"
#include "opencl.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

namespace palpate::compute {

namespace {

std::string options_from(const DeviceInfo& info, const std::vector<std::string>& defines) {
  std::string options = "-cl-std=CL1.2 -D VECTOR_WIDTH=" + std::to_string(info.float_vector_width);
  for (const auto& define : defines) options += (define.rfind('-', 0) == 0 ? " " : " -D ") + define;
  return options;
}

std::string build_log(cl_program program, cl_device_id device) {
  std::size_t size = 0;
  if (clGetProgramBuildInfo(program, device, CL_PROGRAM_BUILD_LOG, 0, nullptr, &size) != CL_SUCCESS ||
      size <= 1)
    return "(the driver gave no log)";
  std::string log(size, '\0');
  clGetProgramBuildInfo(program, device, CL_PROGRAM_BUILD_LOG, size, log.data(), nullptr);
  while (!log.empty() && (log.back() == '\0' || log.back() == '\n')) log.pop_back();
  return log;
}

/// The first line of a log that speaks of an error, else its first line.
std::string first_error(const std::string& log) {
  std::istringstream lines(log);
  std::string first;
  for (std::string line; std::getline(lines, line);) {
    if (line.find("error") != std::string::npos) return line;
    if (first.empty()) first = line;
  }
  return first;
}

}  // namespace

/// A program that was built, by kernels in use. One that came from its source
/// is kept on disk when the last of them is done: drivers compile parts of it
/// at the first run only, and what they have by then is in the binary.
struct BuiltProgram {
  Device device;
  std::string options;
  std::string source;
  OwnedProgram program;
  std::string key_to_store;  ///< empty: it is there already, or not to be kept

  BuiltProgram(Device on, std::string with, std::string text)
      : device(std::move(on)), options(std::move(with)), source(std::move(text)) {}
  BuiltProgram(const BuiltProgram&) = delete;
  BuiltProgram& operator=(const BuiltProgram&) = delete;
  ~BuiltProgram() {
    try {
      store();
    } catch (...) {
      return;  // slower next time, not wrong
    }
  }

 private:
  void store() const {
    if (key_to_store.empty() || program.get() == nullptr) return;
    const auto cache = KernelCache::of_environment();
    std::size_t size = 0;
    if (!cache ||
        clGetProgramInfo(program.get(), CL_PROGRAM_BINARY_SIZES, sizeof(size), &size, nullptr) != 0 ||
        size == 0)
      return;
    std::string binary(size, '\0');
    char* target = binary.data();
    if (clGetProgramInfo(program.get(), CL_PROGRAM_BINARIES, sizeof(target), &target, nullptr) == CL_SUCCESS)
      cache->store(key_to_store, binary);
  }
};

namespace {

/// From the bytes of the disk cache; false where the driver does not take them.
bool take_binary(BuiltProgram& built, const std::string& binary) {
  const Device::Impl& device = built.device.impl();
  const auto* bytes = reinterpret_cast<const unsigned char*>(binary.data());
  const std::size_t size = binary.size();
  cl_int status = CL_SUCCESS;
  cl_int code = CL_SUCCESS;
  OwnedProgram program(
      clCreateProgramWithBinary(device.context.get(), 1, &device.device, &size, &bytes, &status, &code));
  if (code != CL_SUCCESS || status != CL_SUCCESS) return false;
  if (clBuildProgram(program.get(), 1, &device.device, built.options.c_str(), nullptr, nullptr) != CL_SUCCESS)
    return false;
  built.program = std::move(program);
  return true;
}

void compile(BuiltProgram& built, const std::string& file) {
  const Device::Impl& device = built.device.impl();
  const char* data = built.source.c_str();
  const std::size_t size = built.source.size();
  cl_int code = CL_SUCCESS;
  built.program = OwnedProgram(clCreateProgramWithSource(device.context.get(), 1, &data, &size, &code));
  check(code, "clCreateProgramWithSource", file + " (" + std::to_string(size) + " bytes)");
  code = clBuildProgram(built.program.get(), 1, &device.device, built.options.c_str(), nullptr, nullptr);
  if (code == CL_SUCCESS) return;
  const std::string log = build_log(built.program.get(), device.device);
  throw core::Error(core::ErrorKind::device, "kernel-build",
                    "The driver of " + device.info.name + " could not build the kernels of " + file + " (" +
                        code_name(code) + "): " + first_error(log) +
                        " Try another device, or update its driver.",
                    "options: " + built.options + "\n" + log);
}

/// From the disk where it is there and good, else from its source.
std::shared_ptr<BuiltProgram> built_program(const Device& device, const std::string& options,
                                            const std::string& source, const std::string& file,
                                            const std::string& kernel) {
  auto built = std::make_shared<BuiltProgram>(device, options, source);
  const auto cache = KernelCache::of_environment();
  const std::string key = cache ? KernelCache::key(source, options, device.info()) : std::string();
  if (const auto binary = cache ? cache->find(key) : std::nullopt; binary && take_binary(*built, *binary)) {
    // A binary that lost its kernels is as bad as one that is refused.
    cl_int code = CL_SUCCESS;
    const OwnedKernel there(clCreateKernel(built->program.get(), kernel.c_str(), &code));
    if (code == CL_SUCCESS) return built;
  }
  compile(*built, file);
  built->key_to_store = key;
  return built;
}

}  // namespace

struct Kernel::Impl {
  Device device;
  std::shared_ptr<BuiltProgram> program;
  std::string name;
  OwnedKernel kernel;
  std::size_t largest_group = 1;

  void set(unsigned argument, std::size_t size, const void* value) const {
    check(clSetKernelArg(kernel.get(), argument, size, value), "clSetKernelArg",
          "argument " + std::to_string(argument) + " (" + std::to_string(size) + " bytes) of kernel " + name);
  }
};

Kernel::Kernel() = default;
Kernel::Kernel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Kernel::~Kernel() = default;
Kernel::Kernel(Kernel&&) noexcept = default;
Kernel& Kernel::operator=(Kernel&&) noexcept = default;

void Kernel::set(unsigned argument, const Buffer& buffer) {
  cl_mem memory = buffer ? buffer.impl().memory.get() : nullptr;
  impl_->set(argument, sizeof(memory), &memory);
}
void Kernel::set(unsigned argument, float value) { impl_->set(argument, sizeof(value), &value); }
void Kernel::set(unsigned argument, std::int32_t value) { impl_->set(argument, sizeof(value), &value); }
void Kernel::set(unsigned argument, std::uint32_t value) { impl_->set(argument, sizeof(value), &value); }
void Kernel::set(unsigned argument, const std::array<float, 4>& value) {
  impl_->set(argument, sizeof(value), value.data());
}

void Kernel::run(std::size_t work_items, std::size_t work_group) const {
  if (work_items == 0) return;
  const std::size_t group = std::min(std::max<std::size_t>(work_group, 1), impl_->largest_group);
  const std::size_t rounded = (work_items + group - 1) / group * group;
  Device::Impl& device = impl_->device.impl();
  if (device.launches_left >= 0 && device.launches_left-- == 0) device.lost = true;
  check_at_work(clEnqueueNDRangeKernel(device.queue.get(), impl_->kernel.get(), 1, nullptr, &rounded, &group,
                                       0, nullptr, nullptr),
                "clEnqueueNDRangeKernel",
                std::to_string(rounded) + " work-items (groups of " + std::to_string(group) + ") of kernel " +
                    impl_->name,
                impl_->device);
}

namespace {

std::string text_of(const std::string& file) {
  if (const char* folder = std::getenv("PALPATE_KERNEL_DIR"); folder != nullptr && *folder != '\0') {
    const auto path = std::filesystem::path(folder) / file;
    std::ifstream stream(path, std::ios::binary);
    if (stream) return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }
  const std::string_view embedded = embedded_kernel(file);
  if (embedded.empty())
    throw core::Error(core::ErrorKind::internal, "kernel-missing", "There is no kernel file " + file + ".");
  return std::string(embedded);
}

/// Puts the text of `#include "name.cl"` lines in their place, each file once.
std::string resolved(const std::string& file, std::vector<std::string>& done) {
  done.push_back(file);
  const std::string source = text_of(file);
  std::istringstream lines(source);
  const std::string mark = "#include \"";
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(mark, 0) != 0) {
      text += line + "\n";
      continue;
    }
    const std::string name = line.substr(mark.size(), line.find('"', mark.size()) - mark.size());
    if (std::find(done.begin(), done.end(), name) == done.end()) text += resolved(name, done);
  }
  if (!text.empty() && !source.empty() && source.back() != '\n') text.pop_back();
  return text;
}

}  // namespace

std::string KernelLibrary::source(const std::string& file) {
  std::vector<std::string> done;
  return resolved(file, done);
}

Kernel KernelLibrary::build(const std::string& file, const std::string& kernel,
                            const std::vector<std::string>& defines) {
  const std::string text = source(file);
  const std::string options = options_from(device_.info(), defines);
  const Device::Impl& device = device_.impl();
  auto found = std::find_if(programs_.begin(), programs_.end(), [&](const auto& program) {
    return program->options == options && program->source == text;
  });
  if (found == programs_.end()) {
    programs_.push_back(built_program(device_, options, text, file, kernel));
    found = std::prev(programs_.end());
  }
  cl_int code = CL_SUCCESS;
  auto impl = std::make_unique<Kernel::Impl>(Kernel::Impl{device_, *found, kernel, OwnedKernel(), 1});
  impl->kernel = OwnedKernel(clCreateKernel((*found)->program.get(), kernel.c_str(), &code));
  check(code, "clCreateKernel", "kernel " + kernel + " of " + file);
  check(clGetKernelWorkGroupInfo(impl->kernel.get(), device.device, CL_KERNEL_WORK_GROUP_SIZE,
                                 sizeof(impl->largest_group), &impl->largest_group, nullptr),
        "clGetKernelWorkGroupInfo", "kernel " + kernel);
  return Kernel(std::move(impl));
}

}  // namespace palpate::compute
