#include "device_test.hpp"

#include "palpate/surface/binding.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3f;
using palpate::compute::Buffer;
using palpate::surface::DeformedSurface;
using palpate::surface::Deformer;
using palpate::surface::SurfaceBinding;

namespace {

const Vector3d center_mm(12.5, -140.25, 61.0);

/// A sheet of points 0.5 mm apart, off its lattice by up to 0.05 mm.
std::vector<Vector3f> sheet(int side) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> noise(-0.05F, 0.05F);
  std::vector<Vector3f> points;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i)
      points.emplace_back(0.5F * static_cast<float>(i - side / 2) + noise(random),
                          0.5F * static_cast<float>(j - side / 2) + noise(random), noise(random));
  return points;
}

/// Vertices on random triangles of neighbours, up to 0.7 mm off them.
SurfaceBinding random_binding(int side, std::size_t vertices) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  SurfaceBinding binding;
  for (std::size_t n = 0; n < vertices; ++n) {
    const auto i = static_cast<std::uint32_t>(random() % static_cast<unsigned>(side - 1));
    const auto j = static_cast<std::uint32_t>(random() % static_cast<unsigned>(side - 1));
    const auto at = [&](std::uint32_t di, std::uint32_t dj) {
      return (j + dj) * static_cast<std::uint32_t>(side) + i + di;
    };
    binding.points.push_back({at(0, 0), at(1, 0), at(0, 1)});
    Vector3f weights(unit(random), unit(random), unit(random));
    weights /= weights.sum();
    weights[0] = 1.0F - weights[1] - weights[2];
    binding.weights.push_back(weights.cwiseMax(0.0F));
    binding.offsets_tnb_mm.push_back(0.4F * Vector3f(unit(random), unit(random), unit(random)));
    binding.normals_tnb.push_back(Vector3f(unit(random), 1.0F, unit(random)).normalized());
  }
  return binding;
}

std::vector<float> as_float4(const std::vector<Vector3f>& positions) {
  std::vector<float> packed;
  for (const auto& position : positions)
    packed.insert(packed.end(), {position.x(), position.y(), position.z(), -1.0F});
  return packed;
}

Buffer on_device(const palpate::compute::Device& device, const std::vector<Vector3f>& positions) {
  const std::vector<float> packed = as_float4(positions);
  return Buffer::copy_of(device, packed.data(), packed.size() * sizeof(float));
}

struct Difference {
  double vertices_mm = 0.0;
  double normals = 0.0;
};
Difference difference(const SurfaceBinding& binding, const std::vector<Vector3f>& positions,
                      const DeformedSurface& out) {
  std::vector<float> vertices;
  std::vector<float> normals;
  palpate::surface::deform_reference(binding, center_mm, positions, vertices, normals);
  Difference worst;
  for (std::size_t n = 0; n < vertices.size(); ++n) {
    // std::max would pass over a NaN.
    if (!std::isfinite(out.vertices()[n]) || !std::isfinite(out.normals()[n])) return {INFINITY, INFINITY};
    worst.vertices_mm =
        std::max(worst.vertices_mm, std::abs(double{vertices[n]} - double{out.vertices()[n]}));
    worst.normals = std::max(worst.normals, std::abs(double{normals[n]} - double{out.normals()[n]}));
  }
  return worst;
}

class SurfaceMapping : public palpate::testing::DeviceTest {};

}  // namespace

TEST_F(SurfaceMapping, AgreesWithTheReferenceOnADeformedSheet) {
  constexpr int side = 120;
  const SurfaceBinding binding = random_binding(side, 5000);
  auto positions = sheet(side);
  for (auto& point : positions) {
    point.z() += 3.0F * std::sin(0.3F * point.x()) * std::cos(0.2F * point.y());
    point.x() += 0.2F * std::sin(point.y());
  }
  Deformer deformer(device(), binding, center_mm);
  DeformedSurface out(binding.size());
  const float* const vertices = out.vertices();
  const float* const normals = out.normals();
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(vertices) % 64, 0U);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(normals) % 64, 0U);
  deformer.deform(on_device(device(), positions), out);
  // It is the memory given that was written: the arrays are where they were.
  EXPECT_EQ(out.vertices(), vertices);
  EXPECT_EQ(out.normals(), normals);
  const Difference worst = difference(binding, positions, out);
  // Coordinates reach 170 mm, a float's spacing there is 1.5e-5: the reference
  // rounds once, the kernel thrice (centre, sum with the point, sum with the
  // centre), half a spacing each. Basis vectors are good to a few 1e-7.
  EXPECT_LT(worst.vertices_mm, 3.1e-5);
  EXPECT_LT(worst.normals, 2e-6);
}

TEST_F(SurfaceMapping, ARigidMotionStaysRigidInFloat) {
  constexpr int side = 60;
  const SurfaceBinding binding = random_binding(side, 3000);
  const auto rest = sheet(side);
  const Matrix3d rotation =
      (Eigen::AngleAxisd(1.1, Vector3d::UnitX()) * Eigen::AngleAxisd(2.3, Vector3d::UnitZ()))
          .toRotationMatrix();
  const Vector3d shift(4, -9, 7);
  auto moved = rest;
  for (auto& point : moved) point = (rotation * point.cast<double>() + shift).cast<float>();
  Deformer deformer(device(), binding, center_mm);
  DeformedSurface before(binding.size());
  DeformedSurface after(binding.size());
  deformer.deform(on_device(device(), rest), before);
  deformer.deform(on_device(device(), moved), after);
  double worst = 0.0;
  double worst_normal = 0.0;
  for (std::size_t n = 0; n < binding.size(); ++n) {
    const Vector3d v0 = Eigen::Map<const Vector3f>(before.vertices() + 3 * n).cast<double>() - center_mm;
    const Vector3d v1 = Eigen::Map<const Vector3f>(after.vertices() + 3 * n).cast<double>() - center_mm;
    worst = std::max(worst, (v1 - rotation * v0 - shift).norm());
    const Vector3d n0 = Eigen::Map<const Vector3f>(before.normals() + 3 * n).cast<double>();
    const Vector3d n1 = Eigen::Map<const Vector3f>(after.normals() + 3 * n).cast<double>();
    worst_normal = std::max(worst_normal, (n1 - rotation * n0).norm());
  }
  // Points moved to within 20 mm round by 1e-6, which turns an edge of 0.5 mm
  // by 5e-6 at most; vertices up to 170 mm round by 8e-6 an axis, thrice.
  EXPECT_LT(worst, 4e-5);
  EXPECT_LT(worst_normal, 2e-5);
}

TEST_F(SurfaceMapping, DegenerateTrianglesAgreeWithTheReference) {
  constexpr int side = 20;
  const SurfaceBinding binding = random_binding(side, 800);
  Deformer deformer(device(), binding, center_mm);
  DeformedSurface out(binding.size());
  const auto rest = sheet(side);
  const std::vector<Vector3f> together(rest.size(), Vector3f(1, 2, 3));
  std::vector<Vector3f> in_line = rest;
  for (auto& point : in_line) point = Vector3f(point.x() + 2.0F * point.y(), 0, 0);
  auto thin = rest;  // nearly in line: both branches of the blend
  for (auto& point : thin) point.y() *= 1e-3F;
  for (const auto& positions : {together, in_line}) {
    deformer.deform(on_device(device(), positions), out);
    const Difference worst = difference(binding, positions, out);
    EXPECT_LT(worst.vertices_mm, 3.1e-5);
    EXPECT_LT(worst.normals, 2e-6);
  }
  deformer.deform(on_device(device(), thin), out);
  // At a sine of 1e-3 a rounding of 6e-8 turns the normal by 6e-5 and, where
  // the blend starts from a short sum, ten times that.
  const Difference worst = difference(binding, thin, out);
  EXPECT_LT(worst.vertices_mm, 6e-4);
  EXPECT_LT(worst.normals, 6e-4);
}

TEST_F(SurfaceMapping, OneSurfaceServesSeveralDeformersAndIsReused) {
  constexpr int side = 20;
  const SurfaceBinding binding = random_binding(side, 100);
  const auto positions = sheet(side);
  const Buffer buffer = on_device(device(), positions);
  DeformedSurface out(binding.size());
  for (int round = 0; round < 3; ++round) {
    Deformer deformer(device(), binding, center_mm);
    for (int frame = 0; frame < 3; ++frame) {
      std::fill_n(out.vertices(), 3 * binding.size(), 0.0F);
      deformer.deform(buffer, out);
      EXPECT_LT(difference(binding, positions, out).vertices_mm, 3.1e-5);
    }
  }
  DeformedSurface other(binding.size() + 1);
  Deformer deformer(device(), binding, center_mm);
  EXPECT_THROW(deformer.deform(buffer, other), palpate::core::Error);
  EXPECT_THROW(deformer.deform(on_device(device(), {Vector3f::Zero()}), out), palpate::core::Error);
  DeformedSurface none(0);
  Deformer(device(), SurfaceBinding{}, center_mm).deform(buffer, none);
  EXPECT_EQ(none.vertex_count(), 0U);
}

TEST_F(SurfaceMapping, TwentyFiveThousandVerticesTakeAFractionOfAFrame) {
  constexpr int side = 800;  // 640 thousand points
  const SurfaceBinding binding = random_binding(side, 25000);
  const Buffer buffer = on_device(device(), sheet(side));
  Deformer deformer(device(), binding, center_mm);
  DeformedSurface out(binding.size());
  deformer.deform(buffer, out);  // builds the kernel
  std::vector<double> times_ms;
  for (int run = 0; run < 21; ++run) {
    const auto start = std::chrono::steady_clock::now();
    deformer.deform(buffer, out);
    times_ms.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  std::nth_element(times_ms.begin(), times_ms.begin() + 10, times_ms.end());
  std::printf("[measured] %s: 25000 vertices over %d points in %.3f ms (median of 21)\n",
              device().info().name.c_str(), side * side, times_ms[10]);
  EXPECT_LT(times_ms[10], 100.0);  // some 0.5 ms by itself; the rest is for a busy machine
}
