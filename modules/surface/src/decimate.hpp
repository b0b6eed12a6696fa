#pragma once

#include "palpate/core/progress.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::surface {

/// Vertices in mm and triangles while a surface is being made.
struct RawSurface {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Collapses edges in the order of their quadric error (Garland and Heckbert)
/// until at most `face_budget` faces are left or none may be collapsed. A
/// closed manifold stays one: an edge is only collapsed when the link
/// condition holds and no face turns over. Deterministic.
RawSurface decimate(RawSurface surface, std::size_t face_budget, const core::Progress& progress);

/// Leaves out vertices that no triangle uses.
void drop_unused_vertices(RawSurface& surface);

}  // namespace palpate::surface
