#include "palpate/compute/device.hpp"

#include "opencl.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <optional>

namespace palpate::compute {

namespace {

struct Found {
  DeviceInfo info;
  cl_platform_id platform = nullptr;
  cl_device_id device = nullptr;
};

std::string trimmed(std::string text) {
  while (!text.empty() && (text.back() == '\0' || std::isspace(static_cast<unsigned char>(text.back())) != 0))
    text.pop_back();
  const auto first =
      std::find_if(text.begin(), text.end(), [](unsigned char c) { return std::isspace(c) == 0; });
  return {first, text.end()};
}

std::string platform_text(cl_platform_id platform, cl_platform_info name) {
  std::size_t size = 0;
  if (clGetPlatformInfo(platform, name, 0, nullptr, &size) != CL_SUCCESS || size == 0) return {};
  std::string text(size, '\0');
  if (clGetPlatformInfo(platform, name, size, text.data(), nullptr) != CL_SUCCESS) return {};
  return trimmed(text);
}

std::string device_text(cl_device_id device, cl_device_info name) {
  std::size_t size = 0;
  if (clGetDeviceInfo(device, name, 0, nullptr, &size) != CL_SUCCESS || size == 0) return {};
  std::string text(size, '\0');
  if (clGetDeviceInfo(device, name, size, text.data(), nullptr) != CL_SUCCESS) return {};
  return trimmed(text);
}

template <typename Value>
Value device_value(cl_device_id device, cl_device_info name, Value otherwise) {
  Value value{};
  return clGetDeviceInfo(device, name, sizeof(value), &value, nullptr) == CL_SUCCESS ? value : otherwise;
}

DeviceType type_of(cl_device_type type) {
  if ((type & CL_DEVICE_TYPE_GPU) != 0) return DeviceType::gpu;
  if ((type & CL_DEVICE_TYPE_CPU) != 0) return DeviceType::cpu;
  if ((type & CL_DEVICE_TYPE_ACCELERATOR) != 0) return DeviceType::accelerator;
  return DeviceType::other;
}

/// Empty when the device can be used.
std::string what_is_missing(cl_device_id device) {
  if (device_value<cl_bool>(device, CL_DEVICE_AVAILABLE, CL_FALSE) == CL_FALSE)
    return "the driver says that it is not available";
  if (device_value<cl_bool>(device, CL_DEVICE_COMPILER_AVAILABLE, CL_FALSE) == CL_FALSE)
    return "its driver has no compiler";
  if (device_value<cl_bool>(device, CL_DEVICE_ENDIAN_LITTLE, CL_FALSE) == CL_FALSE) return "it is big-endian";
  const std::string version = device_text(device, CL_DEVICE_VERSION);  // "OpenCL <major>.<minor> ..."
  if (version.rfind("OpenCL 1.0", 0) == 0 || version.rfind("OpenCL 1.1", 0) == 0)
    return "OpenCL 1.2 is needed and it has " + version;
  return {};
}

DeviceInfo describe(cl_platform_id platform, cl_device_id device, int index) {
  DeviceInfo info;
  info.index = index;
  info.name = device_text(device, CL_DEVICE_NAME);
  info.platform = platform_text(platform, CL_PLATFORM_NAME);
  info.driver = device_text(device, CL_DRIVER_VERSION) + ", " + device_text(device, CL_DEVICE_VERSION);
  info.type = type_of(device_value<cl_device_type>(device, CL_DEVICE_TYPE, 0));
  info.memory_bytes = device_value<cl_ulong>(device, CL_DEVICE_GLOBAL_MEM_SIZE, 0);
  info.largest_buffer_bytes = device_value<cl_ulong>(device, CL_DEVICE_MAX_MEM_ALLOC_SIZE, 0);
  info.compute_units = device_value<cl_uint>(device, CL_DEVICE_MAX_COMPUTE_UNITS, 1);
  if (info.type == DeviceType::cpu)
    info.float_vector_width =
        std::clamp(device_value<cl_uint>(device, CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT, 1), 1U, 16U);
  info.reason = what_is_missing(device);
  info.usable = info.reason.empty();
  return info;
}

int rank(DeviceType type) {
  switch (type) {
    case DeviceType::gpu:
      return 0;
    case DeviceType::cpu:
      return 1;
    default:
      return 2;
  }
}

bool is_better(const DeviceInfo& a, const DeviceInfo& b) {
  if (rank(a.type) != rank(b.type)) return rank(a.type) < rank(b.type);
  return a.memory_bytes > b.memory_bytes;  // on a tie the first stays
}

void choose_default(std::vector<Found>& found) {
  Found* best = nullptr;
  std::size_t usable = 0;
  for (auto& candidate : found) {
    if (!candidate.info.usable) continue;
    ++usable;
    if (best == nullptr || is_better(candidate.info, best->info)) best = &candidate;
  }
  if (best == nullptr) return;
  best->info.is_default = true;
  best->info.reason =
      usable == 1 ? "the only usable device" : "first of GPU, CPU, others; then the most memory";
  for (auto& other : found) {
    if (!other.info.usable || other.info.is_default) continue;
    const bool by_type = rank(other.info.type) != rank(best->info.type);
    other.info.reason =
        "device " + std::to_string(best->info.index) + " comes before it: " +
        (by_type ? "it is a " + to_string(best->info.type) : "it has at least as much memory");
  }
}

std::vector<Found> find_devices() {
  std::vector<Found> found;
  cl_uint platform_count = 0;
  if (clGetPlatformIDs(0, nullptr, &platform_count) != CL_SUCCESS || platform_count == 0) return found;
  std::vector<cl_platform_id> platforms(platform_count);
  if (clGetPlatformIDs(platform_count, platforms.data(), nullptr) != CL_SUCCESS) return found;
  for (cl_platform_id platform : platforms) {
    cl_uint count = 0;
    if (clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 0, nullptr, &count) != CL_SUCCESS || count == 0)
      continue;
    std::vector<cl_device_id> devices(count);
    if (clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, count, devices.data(), nullptr) != CL_SUCCESS) continue;
    for (cl_device_id device : devices)
      found.push_back({describe(platform, device, static_cast<int>(found.size())), platform, device});
  }
  choose_default(found);
  return found;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

/// The environment's choice where the caller has none.
std::string effective(const std::string& selector) {
  if (!selector.empty()) return selector;
  const char* from_environment = std::getenv("PALPATE_DEVICE");
  return from_environment == nullptr ? std::string() : std::string(from_environment);
}

bool matches(const DeviceInfo& info, const std::string& wanted) {
  if (wanted.empty()) return info.is_default;
  if (std::all_of(wanted.begin(), wanted.end(), [](unsigned char c) { return std::isdigit(c) != 0; }))
    return std::to_string(info.index) == wanted;
  return lower(info.name + " " + info.platform).find(lower(wanted)) != std::string::npos;
}

/// A part of a name may fit several devices: a usable one comes first, the
/// default before others.
const Found* select(const std::vector<Found>& found, const std::string& wanted) {
  const auto merit = [](const Found& f) { return (f.info.usable ? 2 : 0) + (f.info.is_default ? 1 : 0); };
  const Found* chosen = nullptr;
  for (const auto& candidate : found)
    if (matches(candidate.info, wanted) && (chosen == nullptr || merit(candidate) > merit(*chosen)))
      chosen = &candidate;
  return chosen;
}

[[noreturn]] void throw_no_device(const std::string& text) {
  throw core::Error(core::ErrorKind::device, "no-device", text);
}

std::string names_of(const std::vector<Found>& found) {
  std::string names;
  for (const auto& entry : found)
    names += (names.empty() ? "" : "; ") + std::to_string(entry.info.index) + ": " + entry.info.name + " (" +
             entry.info.platform + ")";
  return names;
}

}  // namespace

std::string to_string(DeviceType type) {
  switch (type) {
    case DeviceType::cpu:
      return "cpu";
    case DeviceType::gpu:
      return "gpu";
    case DeviceType::accelerator:
      return "accelerator";
    default:
      return "other";
  }
}

std::vector<DeviceInfo> list_devices() {
  std::vector<DeviceInfo> infos;
  for (auto& entry : find_devices()) infos.push_back(std::move(entry.info));
  return infos;
}

const DeviceInfo& Device::info() const noexcept { return impl_->info; }

void Device::finish() const { check(clFinish(impl_->queue.get()), "clFinish", impl_->info.name); }

void Device::flush() const { check(clFlush(impl_->queue.get()), "clFlush", impl_->info.name); }

Device open_device(const std::string& selector) {
  const auto found = find_devices();
  if (found.empty())
    throw_no_device(
        "No OpenCL device was found. Install a driver (on Debian: apt install pocl-opencl-icd runs on any "
        "processor), or choose the device \"reference\", which needs none and is slow.");
  const std::string wanted = effective(selector);
  const Found* chosen = select(found, wanted);
  if (chosen == nullptr && wanted.empty())
    throw_no_device("No usable OpenCL device: " + names_of(found) + ". " + found.front().info.name + ": " +
                    found.front().info.reason + ".");
  if (chosen == nullptr)
    throw_no_device("No OpenCL device is called \"" + wanted +
                    "\". The devices by index: " + names_of(found) + ".");
  if (!chosen->info.usable)
    throw_no_device(chosen->info.name + " cannot be used: " + chosen->info.reason +
                    ". The devices by index: " + names_of(found) + ".");

  auto impl = std::make_shared<Device::Impl>();
  impl->info = chosen->info;
  impl->device = chosen->device;
  cl_int code = CL_SUCCESS;
  const cl_context_properties properties[] = {CL_CONTEXT_PLATFORM,
                                              reinterpret_cast<cl_context_properties>(chosen->platform), 0};
  impl->context = OwnedContext(clCreateContext(properties, 1, &impl->device, nullptr, nullptr, &code));
  check(code, "clCreateContext", impl->info.name);
  impl->queue = OwnedQueue(clCreateCommandQueue(impl->context.get(), impl->device, 0, &code));
  check(code, "clCreateCommandQueue", impl->info.name);
  return Device(std::move(impl));
}

bool is_reference_selector(const std::string& selector) { return lower(effective(selector)) == "reference"; }

}  // namespace palpate::compute
