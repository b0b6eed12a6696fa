#include "enumerate.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace palpate::compute {

namespace {

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

}  // namespace

std::vector<Found> enumerate() {
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
  return found;
}

Device open_found(const Found& found) {
  auto impl = std::make_shared<Device::Impl>();
  impl->info = found.info;
  impl->device = found.device;
  cl_int code = CL_SUCCESS;
  const cl_context_properties properties[] = {CL_CONTEXT_PLATFORM,
                                              reinterpret_cast<cl_context_properties>(found.platform), 0};
  impl->context = OwnedContext(clCreateContext(properties, 1, &impl->device, nullptr, nullptr, &code));
  check(code, "clCreateContext", impl->info.name);
  impl->queue = OwnedQueue(clCreateCommandQueue(impl->context.get(), impl->device, 0, &code));
  check(code, "clCreateCommandQueue", impl->info.name);
  if (const char* launches = std::getenv("PALPATE_FAIL_AFTER_LAUNCHES"); launches != nullptr)
    impl->launches_left = std::atol(launches);
  return Device(std::move(impl));
}

}  // namespace palpate::compute
