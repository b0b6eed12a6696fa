#pragma once

#include "palpate/imaging/filters.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/simulation/parameters.hpp"
#include "palpate/simulation/solver.hpp"
#include "palpate/surface/extract.hpp"

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::session {

struct InputSettings {
  std::filesystem::path path;
  std::string sha256;  ///< of the file (of the sorted files of a folder); empty until known
  std::string series_uid;
  int frame = 0;
  std::optional<std::array<double, 3>> spacing_mm;
  std::string orientation;                ///< as imaging::ReadOptions has it; empty: the file's
  std::optional<double> grid_spacing_mm;  ///< of a scan-converted volume
  bool allow_truncated = false;
};
struct SurfaceSettings {
  bool mapped = true;                         ///< --surface-mapping triangle, or none
  std::optional<std::filesystem::path> mesh;  ///< instead of the isosurface
  surface::MeshSpace mesh_space = surface::MeshSpace::automatic;
  int face_budget = 50000;
};
/// Tissue from a label image instead of, or within, a threshold.
struct MaskSettings {
  std::optional<std::filesystem::path> path;
  std::optional<int> label;  ///< any but 0 where absent
};
/// Which points never move.
struct AnchorSettings {
  enum class Rule { none, border, file } rule = Rule::none;
  std::filesystem::path file;  ///< a label image: where it is not 0
};
/// What is scaled by the intensity of a point's voxel.
struct IntensityScaling {
  bool stiffness = false, damping = false, drag = false, mass = false;
};
struct SimulationSettings {
  simulation::Parameters parameters;
  std::optional<double> step_s;  ///< automatic where absent
  simulation::LayoutChoice layout = simulation::LayoutChoice::automatic;
  AnchorSettings anchors;
  IntensityScaling scaling;
};

/// Every parameter that decides a result, and the input's checksum.
struct Recipe {
  int version = 1;
  InputSettings input;
  std::vector<imaging::FilterStep> filters;
  model::TissueParameters tissue;  ///< its mask is read from `mask` by build_tissue()
  MaskSettings mask;
  SurfaceSettings surface;
  SimulationSettings simulation;
};

/// JSON with sorted keys; what stands at its default is written too.
std::string to_json(const Recipe& recipe);
/// Throws Error(usage) with the place of what does not fit, also for unknown keys.
Recipe parse_recipe(const std::string& json_text);
Recipe load_recipe(const std::filesystem::path& path);  ///< relative paths are beside the file
void save_recipe(const std::filesystem::path& path, const Recipe& recipe);
/// SHA-256 of to_json() without the input's path, in hex.
std::string recipe_sha256(const Recipe& recipe);
/// SHA-256 of a file, or of a folder's sorted names and contents but its session files.
std::string file_sha256(const std::filesystem::path& path, const core::Progress& progress = {});

}  // namespace palpate::session
