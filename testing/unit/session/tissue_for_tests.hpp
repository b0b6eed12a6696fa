#pragma once

#include "palpate/core/volume.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/session/run.hpp"

#include <memory>
#include <vector>

namespace palpate::testing {

/// A full cube of `side` points at a spacing of 1 mm, centred at (0, 0, 0).
inline session::BuiltTissue cube_tissue(int side, const simulation::Parameters& parameters = {}) {
  const double corner = -0.5 * (side - 1);
  const core::ImageGeometry geometry({side, side, side}, Eigen::Vector3d::Ones(), {corner, corner, corner});
  const core::Volume volume(geometry, std::vector<float>(geometry.voxel_count(), 100.0F));
  model::TissueParameters tissue;
  tissue.threshold_low = 50.0;
  session::BuiltTissue built;
  built.tissue = std::make_shared<const model::Tissue>(model::generate(volume, tissue));
  built.statistics = model::statistics_of(*built.tissue);
  built.stable_step = simulation::stable_step(*built.tissue, parameters);
  built.threshold_low = 50.0;
  return built;
}

/// A surface of one vertex per point of a face of the cube, bound to the tissue.
inline session::BoundSurface face_surface(const session::BuiltTissue& built, int side) {
  core::TriangleMesh mesh;
  const float corner = -0.5F * static_cast<float>(side - 1);
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i)
      mesh.vertices_mm.emplace_back(corner + static_cast<float>(i), corner + static_cast<float>(j),
                                    -corner + 0.5F);
  for (int j = 0; j + 1 < side; ++j)
    for (int i = 0; i + 1 < side; ++i) {
      const auto first = static_cast<std::uint32_t>(j * side + i);
      const auto row = static_cast<std::uint32_t>(side);
      mesh.triangles.push_back({first, first + 1, first + row + 1});
      mesh.triangles.push_back({first, first + row + 1, first + row});
    }
  mesh.normals = core::vertex_normals(mesh);
  session::BoundSurface bound;
  bound.binding = std::make_shared<const surface::SurfaceBinding>(surface::bind(mesh, *built.tissue));
  bound.mesh = std::make_shared<const core::TriangleMesh>(std::move(mesh));
  return bound;
}

/// A ray along -z from above the cube, at x = x_mm.
inline interaction::Ray ray_from_above(double x_mm) { return {{x_mm, 0.0, 100.0}, {0.0, 0.0, -1.0}}; }

/// Takes the cube's top at x = 0 and pulls it by `drag_mm` along x in `seconds`.
inline interaction::Gesture pull(double drag_mm, double seconds, double radius_mm) {
  interaction::GestureStep step;
  step.radius_mm = radius_mm;
  step.camera = interaction::Camera{};
  step.camera->position_mm = {0.0, 0.0, 100.0};
  step.camera->parallel = true;
  step.path = {{0.0, ray_from_above(0.0)}, {seconds, ray_from_above(drag_mm)}};
  interaction::Gesture gesture;
  gesture.steps = {step};
  return gesture;
}

}  // namespace palpate::testing
