#include "palpate/compute/kernel_library.hpp"
#include "palpate/core/error.hpp"
#include "palpate/surface/binding.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <limits>
#include <new>
#include <utility>

namespace palpate::surface {
namespace {

constexpr std::size_t alignment = 64;  // what CL_MEM_USE_HOST_PTR takes without a copy

std::size_t padded_bytes(std::size_t vertices) {
  const std::size_t bytes = std::max<std::size_t>(1, 3 * vertices * sizeof(float));
  return (bytes + alignment - 1) / alignment * alignment;
}

float* aligned_floats(std::size_t bytes) {
  auto* memory = static_cast<float*>(::operator new (bytes, std::align_val_t{alignment}));
  std::memset(memory, 0, bytes);
  return memory;
}

/// As the kernel reads it: two float4 a vertex.
struct PackedVertex {
  std::array<float, 4> weights_offset;  ///< w2, w3, offset along T and N
  std::array<float, 4> offset_normal;   ///< offset along B, normal along T, N and B
};
static_assert(sizeof(PackedVertex) == 32);

std::uint64_t next_serial() {
  static std::atomic<std::uint64_t> counter{0};
  return ++counter;
}

}  // namespace

struct DeformedSurface::DeviceView {
  std::uint64_t deformer = 0;  ///< whose device the buffers belong to
  compute::Buffer vertices;
  compute::Buffer normals;
};

DeformedSurface::DeformedSurface(std::size_t vertex_count)
    : vertex_count_(vertex_count),
      vertices_(aligned_floats(padded_bytes(vertex_count))),
      normals_(aligned_floats(padded_bytes(vertex_count))) {}

DeformedSurface::~DeformedSurface() {
  view_.reset();
  ::operator delete (vertices_, std::align_val_t{alignment});
  ::operator delete (normals_, std::align_val_t{alignment});
}

struct Deformer::Impl {
  compute::Device device;
  compute::Kernel kernel;
  compute::Buffer points;
  compute::Buffer vertices;
  Eigen::Vector3f center_mm;
  std::size_t count = 0;
  std::size_t points_needed = 0;  ///< one more than the largest index
  std::uint64_t serial = next_serial();
};

Deformer::Deformer(const compute::Device& device, const SurfaceBinding& binding,
                   const Eigen::Vector3d& center_mm)
    : impl_(new Impl{device, {}, {}, {}, center_mm.cast<float>(), binding.size()}) {
  if (impl_->count > std::numeric_limits<std::uint32_t>::max() / 3)
    throw core::Error(core::ErrorKind::device, "surface-size",
                      "The surface has too many vertices for the device.");
  compute::KernelLibrary library(device);
  impl_->kernel = library.build("surface_mapping.cl", "map_surface");
  if (impl_->count == 0) return;
  std::vector<std::array<std::uint32_t, 4>> points(impl_->count);
  std::vector<PackedVertex> vertices(impl_->count);
  for (std::size_t n = 0; n < impl_->count; ++n) {
    const auto& corners = binding.points[n];
    points[n] = {corners[0], corners[1], corners[2], 0};
    for (const auto corner : corners)
      impl_->points_needed = std::max(impl_->points_needed, std::size_t{corner} + 1);
    const Eigen::Vector3f& offset = binding.offsets_tnb_mm[n];
    const Eigen::Vector3f& normal = binding.normals_tnb[n];
    vertices[n] = {{binding.weights[n][1], binding.weights[n][2], offset[0], offset[1]},
                   {offset[2], normal[0], normal[1], normal[2]}};
  }
  impl_->points = compute::Buffer::copy_of(device, points.data(), points.size() * sizeof(points[0]));
  impl_->vertices = compute::Buffer::copy_of(device, vertices.data(), vertices.size() * sizeof(vertices[0]));
}

Deformer::~Deformer() = default;

void Deformer::deform(const compute::Buffer& positions, DeformedSurface& out) {
  if (out.vertex_count() != impl_->count || positions.bytes() < 4 * sizeof(float) * impl_->points_needed)
    throw core::Error(core::ErrorKind::internal, "binding-size",
                      "The surface was bound to other points than it is to follow.");
  if (impl_->count == 0) return;
  // The buffers stay with the surface: wrapping costs more than the kernel on some drivers.
  if (!out.view_ || out.view_->deformer != impl_->serial) {
    out.view_.reset();
    auto view = std::make_unique<DeformedSurface::DeviceView>();
    view->deformer = impl_->serial;
    const std::size_t bytes = padded_bytes(impl_->count);
    view->vertices = compute::Buffer::over_host_memory(impl_->device, out.vertices(), bytes);
    view->normals = compute::Buffer::over_host_memory(impl_->device, out.normals(), bytes);
    out.view_ = std::move(view);
  }
  impl_->kernel.set_all(positions, impl_->points, impl_->vertices, impl_->center_mm[0], impl_->center_mm[1],
                        impl_->center_mm[2], static_cast<std::uint32_t>(impl_->count), out.view_->vertices,
                        out.view_->normals);
  impl_->kernel.run(impl_->count);
  out.view_->vertices.sync_to_host();
  out.view_->normals.sync_to_host();
}

}  // namespace palpate::surface
