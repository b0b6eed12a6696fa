#include "palpate/session/pipeline.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace palpate::session {

core::VolumeSequence read_input(const InputSettings& input, const core::Progress& progress) {
  imaging::ReadOptions options;
  options.series_uid = input.series_uid;
  options.frame = input.frame;
  options.spacing_mm = input.spacing_mm;
  options.orientation = input.orientation;
  options.grid_spacing_mm = input.grid_spacing_mm;
  options.allow_truncated = input.allow_truncated;
  auto sequence = imaging::read(input.path, options, progress);
  if (sequence.frames.empty())
    throw core::Error(core::ErrorKind::input, "no-image",
                      input.path.string() + " holds no frame " + std::to_string(input.frame) + ".");
  return sequence;
}

imaging::FilteredVolume filter_volume(const core::Volume& volume,
                                      const std::vector<imaging::FilterStep>& chain,
                                      const imaging::FilterOptions& options, const core::Progress& progress) {
  return imaging::apply_filters(volume, chain, options, progress);
}

Estimate estimate_tissue(const core::Volume& filtered, const Recipe& recipe, const core::Progress& progress) {
  Estimate estimate;
  model::TissueParameters parameters = recipe.tissue;
  if (!parameters.threshold_low) parameters.threshold_low = model::otsu_threshold(filtered, parameters.crop);
  estimate.threshold_low = *parameters.threshold_low;
  estimate.tissue = model::estimate(filtered, parameters, progress.part(0.0, 0.9));
  progress.report(0.9, "Largest stable step");
  estimate.stable_step = simulation::stable_step(estimate.tissue.sample, recipe.simulation.parameters);
  return estimate;
}

BuiltTissue build_tissue(const core::Volume& filtered, const Recipe& recipe, const core::Progress& progress) {
  simulation::check(recipe.simulation.parameters);
  BuiltTissue built;
  model::TissueParameters parameters = recipe.tissue;
  if (!parameters.threshold_low) parameters.threshold_low = model::otsu_threshold(filtered, parameters.crop);
  built.threshold_low = *parameters.threshold_low;
  const auto start = std::chrono::steady_clock::now();
  built.tissue =
      std::make_shared<const model::Tissue>(model::generate(filtered, parameters, progress.part(0.0, 0.8)));
  built.build_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  progress.report(0.8, "Counting the tissue");
  built.statistics = model::statistics_of(*built.tissue);
  progress.report(0.9, "Largest stable step");
  built.stable_step = simulation::stable_step(*built.tissue, recipe.simulation.parameters);
  progress.report(1.0, "Tissue built");
  return built;
}

simulation::Material material_of(const model::Tissue&, const SimulationSettings&, const core::Progress&) {
  return {};
}

BoundSurface build_surface(const core::Volume& filtered, const BuiltTissue& tissue, const Recipe& recipe,
                           const core::Progress& progress) {
  BoundSurface bound;
  if (!recipe.surface.mapped) return bound;
  core::TriangleMesh mesh;
  if (recipe.surface.mesh) {
    auto loaded = surface::load_mesh(*recipe.surface.mesh, recipe.surface.mesh_space);
    mesh = std::move(loaded.mesh);
    bound.space_reason = (loaded.space == surface::MeshSpace::ras ? "RAS, " : "LPS, ") + loaded.space_reason;
  } else {
    surface::ExtractParameters parameters;
    parameters.iso_value = tissue.threshold_low;
    parameters.face_budget = recipe.surface.face_budget;
    parameters.crop = recipe.tissue.crop;
    parameters.min_component = recipe.tissue.min_component;
    mesh = surface::extract(filtered, parameters, progress.part(0.0, 0.7));
    // The border of a point's cell is half a spacing away; noise and smoothing
    // move it by less than another, along a diagonal at most.
    const double reach_mm = 2.0 * tissue.tissue->spacing_mm.norm();
    mesh = surface::keep_near(mesh, tissue.tissue->points, reach_mm);
    if (mesh.empty())
      throw core::Error(
          core::ErrorKind::input, "no-surface",
          "No part of the surface lies near the tissue. Try another threshold or a larger crop box.");
  }
  progress.report(0.7, "Binding the surface");
  auto binding = surface::bind(mesh, *tissue.tissue, progress.part(0.7, 1.0));
  bound.mesh = std::make_shared<const core::TriangleMesh>(std::move(mesh));
  bound.binding = std::make_shared<const surface::SurfaceBinding>(std::move(binding));
  return bound;
}

}  // namespace palpate::session
