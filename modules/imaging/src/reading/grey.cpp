#include "grey.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::imaging::reading {
namespace {

template <typename T>
void convert(const T* raw, std::size_t components, Mix mix, std::size_t pick, std::size_t count,
             float* grey) {
  for (std::size_t n = 0; n < count; ++n) {
    const T* voxel = raw + n * components;
    switch (mix) {
      case Mix::grey:
        grey[n] = static_cast<float>(*voxel);
        break;
      case Mix::colour:
        grey[n] =
            static_cast<float>(0.299 * static_cast<double>(voxel[0]) + 0.587 * static_cast<double>(voxel[1]) +
                               0.114 * static_cast<double>(voxel[2]));
        break;
      case Mix::magnitude:
        grey[n] =
            static_cast<float>(std::hypot(static_cast<double>(voxel[0]), static_cast<double>(voxel[1])));
        break;
      case Mix::pick:
        grey[n] = static_cast<float>(voxel[pick]);
        break;
    }
  }
}

/// Calls `use` with a null pointer of the component's type.
template <typename Use>
void with_type(itk::IOComponentEnum type, const Use& use) {
  using Type = itk::IOComponentEnum;
  switch (type) {
    case Type::UCHAR:
      return use(static_cast<const unsigned char*>(nullptr));
    case Type::CHAR:
      return use(static_cast<const signed char*>(nullptr));
    case Type::USHORT:
      return use(static_cast<const unsigned short*>(nullptr));
    case Type::SHORT:
      return use(static_cast<const short*>(nullptr));
    case Type::UINT:
      return use(static_cast<const unsigned int*>(nullptr));
    case Type::INT:
      return use(static_cast<const int*>(nullptr));
    case Type::ULONG:
      return use(static_cast<const unsigned long*>(nullptr));
    case Type::LONG:
      return use(static_cast<const long*>(nullptr));
    case Type::ULONGLONG:
      return use(static_cast<const unsigned long long*>(nullptr));
    case Type::LONGLONG:
      return use(static_cast<const long long*>(nullptr));
    case Type::FLOAT:
      return use(static_cast<const float*>(nullptr));
    case Type::DOUBLE:
      return use(static_cast<const double*>(nullptr));
    default:
      return;
  }
}

}  // namespace

std::string pixel_type_name(itk::IOComponentEnum type) {
  std::string name;
  with_type(type, [&](auto* example) {
    using T = std::remove_const_t<std::remove_pointer_t<decltype(example)>>;
    const char* kind = std::is_floating_point_v<T> ? "float" : std::is_unsigned_v<T> ? "uint" : "int";
    name = kind + std::to_string(8 * sizeof(T));
  });
  return name;
}

std::size_t component_bytes(itk::IOComponentEnum type) {
  std::size_t bytes = 0;
  with_type(type, [&](auto* example) { bytes = sizeof(*example); });
  return bytes;
}

void to_grey(const void* raw, itk::IOComponentEnum type, std::size_t components, Mix mix, std::size_t pick,
             std::size_t count, float* grey) {
  with_type(type, [&](auto* example) {
    convert(static_cast<decltype(example)>(raw), components, mix, pick, count, grey);
  });
}

}  // namespace palpate::imaging::reading
