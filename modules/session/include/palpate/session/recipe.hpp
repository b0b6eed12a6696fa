#pragma once

#include "palpate/imaging/filters.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/session/anchors.hpp"
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
  std::string sha256;        ///< of the file or folder; empty until known
};
/// Which points never move.
struct AnchorSettings {
  enum class Rule { none, border, file } rule = Rule::none;
  std::filesystem::path file;      ///< a label image: where it is not 0
  std::string sha256;              ///< of the file or folder; empty until known
  std::vector<AnchorDab> painted;  ///< by hand, over what the rule gives
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
/// Relative paths are beside the file; so is a mask or an anchors' file that is
/// gone from where it was.
Recipe load_recipe(const std::filesystem::path& path);
void save_recipe(const std::filesystem::path& path, const Recipe& recipe);
/// The same for recipes in other files: an existing `given`, else a file of its
/// name in `folder` where there is one, else `given`.
std::filesystem::path found_beside(const std::filesystem::path& given, const std::filesystem::path& folder);
/// SHA-256 of to_json() without the paths of the input, the mask and the anchors, in hex.
std::string recipe_sha256(const Recipe& recipe);
/// Notes the checksums of the mask and of the anchors' file, where there are
/// any. Warnings "mask-changed" and "anchors-changed" where another was noted.
/// Throws Error(input) for what cannot be read.
std::vector<core::Warning> note_label_checksums(Recipe& recipe, const core::Progress& progress = {});
/// SHA-256 of a file, or of a folder's sorted names and contents but its session files.
std::string file_sha256(const std::filesystem::path& path, const core::Progress& progress = {});

}  // namespace palpate::session
