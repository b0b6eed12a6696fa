#include "voxel_type.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace palpate::imaging::reading {
namespace {

/// Calls `use` with a value of the type.
template <typename Use>
auto with_type(VoxelType type, const Use& use) {
  switch (type) {
    case VoxelType::uint8:
      return use(std::uint8_t{});
    case VoxelType::int8:
      return use(std::int8_t{});
    case VoxelType::uint16:
      return use(std::uint16_t{});
    case VoxelType::int16:
      return use(std::int16_t{});
    case VoxelType::uint32:
      return use(std::uint32_t{});
    case VoxelType::int32:
      return use(std::int32_t{});
    case VoxelType::uint64:
      return use(std::uint64_t{});
    case VoxelType::int64:
      return use(std::int64_t{});
    case VoxelType::float32:
      return use(float{});
    case VoxelType::float64:
      break;
  }
  return use(double{});
}

float narrowed(double value) {
  constexpr double largest = std::numeric_limits<float>::max();
  if (std::abs(value) > largest)
    return std::copysign(std::numeric_limits<float>::infinity(), value > 0.0 ? 1.0F : -1.0F);
  return static_cast<float>(value);
}

template <typename T>
float one_number(T value) {
  if constexpr (std::is_same_v<T, double>)
    return narrowed(value);
  else
    return static_cast<float>(value);
}

template <typename T>
T loaded(const char* raw, std::size_t index) {
  T value;
  std::memcpy(&value, raw + index * sizeof(T), sizeof(T));
  return value;
}

template <typename T>
float grey_of(GreyRule rule, const char* raw, std::size_t at, std::size_t step) {
  const auto number = [&](std::size_t n) { return static_cast<double>(loaded<T>(raw, at + n * step)); };
  switch (rule) {
    case GreyRule::luma:
      return narrowed(0.299 * number(0) + 0.587 * number(1) + 0.114 * number(2));
    case GreyRule::magnitude:
      return narrowed(std::hypot(number(0), number(1)));
    case GreyRule::only:
      break;
  }
  return one_number(loaded<T>(raw, at));
}

}  // namespace

std::string name_of(VoxelType type) {
  return with_type(type, [](auto example) {
    using T = decltype(example);
    const char* kind = std::is_floating_point_v<T> ? "float" : std::is_unsigned_v<T> ? "uint" : "int";
    return kind + std::to_string(8 * sizeof(T));
  });
}

std::size_t bytes_of(VoxelType type) {
  return with_type(type, [](auto example) { return sizeof(example); });
}

bool is_whole(VoxelType type) { return type != VoxelType::float32 && type != VoxelType::float64; }

bool holds(VoxelType type, double value) {
  if (!is_whole(type)) return true;
  return with_type(type, [&](auto example) {
    using T = decltype(example);
    return value >= static_cast<double>(std::numeric_limits<T>::lowest()) &&
           value <= static_cast<double>(std::numeric_limits<T>::max()) && value == std::floor(value);
  });
}

void swap_bytes(VoxelType type, char* raw, std::size_t count) {
  with_type(type, [&](auto example) {
    constexpr std::size_t size = sizeof(example);
    if constexpr (size > 1)
      for (std::size_t n = 0; n < count; ++n) std::reverse(raw + n * size, raw + (n + 1) * size);
    return 0;
  });
}

void to_grey(VoxelType type, GreyRule rule, const char* raw, std::size_t components, std::size_t count,
             float* grey) {
  with_type(type, [&](auto example) {
    using T = decltype(example);
    if (rule == GreyRule::only && components == 1)
      for (std::size_t n = 0; n < count; ++n) grey[n] = one_number(loaded<T>(raw, n));
    else
      for (std::size_t n = 0; n < count; ++n) grey[n] = grey_of<T>(rule, raw, n * components, 1);
    return 0;
  });
}

void to_grey(VoxelType type, GreyRule rule, const char* raw, const Strides& strides,
             const std::array<int, 3>& dims, float* grey) {
  with_type(type, [&](auto example) {
    using T = decltype(example);
    for (std::size_t k = 0; k < static_cast<std::size_t>(dims[2]); ++k)
      for (std::size_t j = 0; j < static_cast<std::size_t>(dims[1]); ++j) {
        const std::size_t row = k * strides.axis[2] + j * strides.axis[1];
        for (std::size_t i = 0; i < static_cast<std::size_t>(dims[0]); ++i)
          *grey++ = grey_of<T>(rule, raw, row + i * strides.axis[0], strides.component);
      }
    return 0;
  });
}

}  // namespace palpate::imaging::reading
