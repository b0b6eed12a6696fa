#pragma once

#include "palpate/core/mesh.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"
#include "palpate/model/generate.hpp"

#include <filesystem>
#include <optional>
#include <string>

namespace palpate::surface {

struct ExtractParameters {
  double iso_value = 0.0;
  int face_budget = 50000;
  int smoothing_passes = 20;  ///< windowed sinc; 0 for none
  std::optional<model::CropBox> crop;
  std::size_t min_component = 1;  ///< pieces whose tissue has fewer points are left out, see keep
};

/// Isosurface of the volume (flying edges, smoothed, decimated to the budget,
/// pieces cut off by the image border are closed), in LPS by the volume's
/// IJK-to-LPS matrix, wound outwards (normals point to lower values), with
/// normals and intensities. Throws Error(input, "no-surface"), Error(cancelled).
core::TriangleMesh extract(const core::Volume& volume, const ExtractParameters& parameters,
                           const core::Progress& progress = {});

/// Keeps the faces that lie within `reach_mm` of some tissue point, so that
/// what the tissue step dropped is not drawn.
core::TriangleMesh keep_near(const core::TriangleMesh& mesh, const model::PointCloud& points,
                             double reach_mm);

enum class MeshSpace { automatic, lps, ras };
struct LoadedMesh {
  core::TriangleMesh mesh;  ///< in LPS
  MeshSpace space = MeshSpace::lps;
  std::string space_reason;  ///< "stated by SPACE=RAS in the file", "assumed"
};
/// .stl, .ply, .obj, .vtp, .vtk. `automatic` honours SPACE=RAS or SPACE=LPS in
/// the header and else assumes LPS. Throws Error(input) naming what was found:
/// no polygons, another format, a damaged file.
LoadedMesh load_mesh(const std::filesystem::path& path, MeshSpace space = MeshSpace::automatic);
/// By the ending: .vtp, .stl, .ply, .obj; written beside and renamed.
/// Throws Error(output), Error(usage) for another ending.
void save_mesh(const std::filesystem::path& path, const core::TriangleMesh& mesh);
/// Points and links with displacement_mm and intensity as .vtp.
void save_points(const std::filesystem::path& path, const model::Tissue& tissue,
                 const std::vector<Eigen::Vector3f>& positions_mm);

}  // namespace palpate::surface
