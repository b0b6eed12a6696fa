#pragma once

#include "offscreen.hpp"

#include "palpate/core/mesh.hpp"
#include "palpate/visualization/scene.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace palpate::testing {

/// Pixels of a view as it was drawn, bottom row first, premultiplied.
struct Drawing {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgba;
  const std::uint8_t* at(int x, int y) const {
    return rgba.data() +
           4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
  }
};

inline Drawing draw(vtkRenderer* renderer, int width, int height) {
  visualization::OffscreenCanvas canvas;
  return {width, height, canvas.draw(*renderer, width, height)};
}

/// Centre of gravity of the pixels inside the frame by a weight, in viewport
/// pixels (the middle of the first pixel is 0.5).
inline Eigen::Vector2d center_of(const Drawing& drawing,
                                 const std::function<double(const std::uint8_t*)>& weight) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double total = 0.0;
  constexpr int frame = 4;
  for (int y = frame; y < drawing.height - frame; ++y) {
    for (int x = frame; x < drawing.width - frame; ++x) {
      const double w = weight(drawing.at(x, y));
      sum += w * Eigen::Vector2d(x + 0.5, y + 0.5);
      total += w;
    }
  }
  return total > 0.0 ? Eigen::Vector2d(sum / total) : Eigen::Vector2d(-1, -1);
}

/// An octahedron: symmetric about its middle, so that its picture is, too. It
/// is turned, so that no plane of voxels runs along its edges.
inline std::shared_ptr<core::TriangleMesh> octahedron(const Eigen::Vector3d& middle, double radius) {
  auto mesh = std::make_shared<core::TriangleMesh>();
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.6, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {1.0, -1.0})
      mesh->vertices_mm.emplace_back((middle + sign * radius * turn.col(axis)).cast<float>());
  mesh->triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  mesh->normals = core::vertex_normals(*mesh);
  return mesh;
}

}  // namespace palpate::testing
