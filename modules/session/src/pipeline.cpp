#include "palpate/session/pipeline.hpp"

#include "palpate/core/error.hpp"
#include "palpate/model/mask.hpp"

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

namespace {

using core::Error;
using core::ErrorKind;

/// A label image for a scan of this geometry, at the scan's frame; < 0: at the first, saying so.
core::Volume read_labels(const std::filesystem::path& path, const core::ImageGeometry& scan, int frame,
                         std::vector<core::Warning>& warnings, const core::Progress& progress) {
  imaging::ReadOptions options;
  options.frame = 0;
  auto sequence = imaging::read(path, options, progress.part(0.0, 0.5));
  if (frame > 0 && frame < sequence.info.frames) {
    options.frame = frame;
    sequence = imaging::read(path, options, progress.part(0.5, 1.0));
  }
  if (sequence.frames.empty())
    throw Error(ErrorKind::input, "no-image", path.string() + " holds no label image.");
  if (frame < 0 && sequence.info.frames > 1)
    warnings.push_back({"labels-first-time", path.string() + " has labels for " +
                                                 std::to_string(sequence.info.frames) +
                                                 " times. Those of the first say what is anchored."});
  core::Volume labels = sequence.frames.front();
  // Labels without a spacing of their own belong to the voxels of the scan.
  if (sequence.info.spacing_is_assumed() && labels.dims() == scan.dims() && !(labels.geometry() == scan)) {
    warnings.push_back({"labels-placed", path.string() +
                                             " does not say how large its voxels are. It has as many as "
                                             "the scan and was laid over it."});
    return {scan, labels.shared_voxels()};
  }
  return labels;
}

/// Otsu's where neither a threshold nor a mask says what tissue is; reads the mask.
model::TissueParameters tissue_parameters(const core::Volume& filtered, const Recipe& recipe,
                                          std::vector<core::Warning>& warnings,
                                          const core::Progress& progress) {
  model::TissueParameters parameters = recipe.tissue;
  if (recipe.mask.path && !parameters.mask) {
    parameters.mask = std::make_shared<const core::Volume>(
        read_labels(*recipe.mask.path, filtered.geometry(), recipe.input.frame, warnings, progress));
    parameters.mask_label = recipe.mask.label;
  }
  if (!parameters.threshold_low && !parameters.mask)
    parameters.threshold_low = model::otsu_threshold(filtered, parameters.crop);
  return parameters;
}

double lowest_of(const model::TissueParameters& parameters, const model::Tissue& tissue) {
  if (parameters.threshold_low) return *parameters.threshold_low;
  const auto& intensities = tissue.points.intensities;
  return static_cast<double>(*std::min_element(intensities.begin(), intensities.end()));
}

std::vector<float> factors_of(const std::vector<float>& intensities) {
  if (intensities.empty()) return {};
  const auto [low, high] = std::minmax_element(intensities.begin(), intensities.end());
  std::vector<float> factors(intensities.size(), 1.0F);
  if (*low == *high) return factors;
  const double least = static_cast<double>(*low);
  const double range = static_cast<double>(*high) - least;
  std::transform(intensities.begin(), intensities.end(), factors.begin(), [&](float intensity) {
    return static_cast<float>(0.5 + (static_cast<double>(intensity) - least) / range);
  });
  return factors;
}

std::vector<std::uint32_t> border_points(const model::Tissue& tissue) {
  const auto on_border = [&](const std::array<std::int32_t, 3>& voxel) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int first = tissue.first_voxel[axis];
      const int last = tissue.last_voxel[axis];
      if ((last - first) / tissue.stride < 2) continue;
      // Without a lattice a plane is as thick as the points are apart.
      const int thickness = tissue.on_lattice ? 1 : tissue.stride;
      if (voxel[axis] < first + thickness || voxel[axis] > last - thickness) return true;
    }
    return false;
  };
  std::vector<std::uint32_t> points;
  for (std::uint32_t point = 0; point < tissue.points.size(); ++point)
    if (on_border(tissue.points.voxels[point])) points.push_back(point);
  return points;
}

std::vector<std::uint32_t> labelled_points(const model::Tissue& tissue, const std::filesystem::path& file,
                                           std::vector<core::Warning>& warnings,
                                           const core::Progress& progress) {
  const core::Volume labels = read_labels(file, tissue.geometry, -1, warnings, progress);
  const model::MaskLookup lookup(labels, std::nullopt, tissue.geometry);
  std::vector<std::uint32_t> points;
  for (std::uint32_t point = 0; point < tissue.points.size(); ++point)
    if (lookup.holds(tissue.points.voxels[point])) points.push_back(point);
  if (points.empty())
    throw Error(ErrorKind::input, "anchors-outside",
                "None of the labels in " + file.string() +
                    " meets tissue, so it anchors nothing. Paint labels where the tissue is, in an image "
                    "of this scan.");
  return points;
}

simulation::Material material_with(const model::Tissue& tissue, const SimulationSettings& settings,
                                   std::vector<core::Warning>& warnings, const core::Progress& progress) {
  simulation::Material material;
  const IntensityScaling& scaling = settings.scaling;
  material.scales_stiffness = scaling.stiffness;
  material.scales_damping = scaling.damping;
  material.scales_drag = scaling.drag;
  material.scales_mass = scaling.mass;
  if (scaling.stiffness || scaling.damping || scaling.drag || scaling.mass)
    material.factors = factors_of(tissue.points.intensities);
  progress.cancel().check();
  const AnchorSettings& anchors = settings.anchors;
  if (anchors.rule == AnchorSettings::Rule::border)
    material.anchors = border_points(tissue);
  else if (anchors.rule == AnchorSettings::Rule::file)
    material.anchors = labelled_points(tissue, anchors.file, warnings, progress);
  if (!anchors.painted.empty())
    material.anchors = paint_anchors(material.anchors, tissue.points, anchors.painted);
  if (material.anchors.empty() && anchors.rule == AnchorSettings::Rule::border)
    warnings.push_back(
        {"no-anchors", "No tissue touches the border of the image or the crop box, so nothing is anchored."});
  else if (!material.anchors.empty() && material.anchors.size() == tissue.points.size())
    warnings.push_back({"all-anchored", "Every point of the tissue is anchored; nothing can move."});
  return material;
}

/// What the surface of masked tissue is taken from, and at which value.
struct Field {
  core::Volume volume;
  double iso_value = 0.0;
};
Field masked_field(const core::Volume& filtered, const core::Volume& mask, const Recipe& recipe) {
  const model::MaskLookup lookup(mask, recipe.mask.label ? recipe.mask.label : recipe.tissue.mask_label,
                                 filtered.geometry());
  const auto& low = recipe.tissue.threshold_low;
  // As far below the threshold as the brightest voxel lies above it, halved:
  // the surface then runs about midway to the voxels that the mask leaves out.
  const double below =
      low ? *low - 0.5 * std::max(1e-6, static_cast<double>(filtered.range().max) - *low) : 0.0;
  std::vector<float> values(filtered.size());
  const auto& dims = filtered.dims();
  std::size_t next = 0;
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j)
      for (int i = 0; i < dims[0]; ++i, ++next) {
        const float value = filtered.data()[next];
        const bool held = lookup.holds({i, j, k});
        if (low)
          values[next] = held ? value : std::min(value, static_cast<float>(below));
        else
          values[next] = held ? 1.0F : 0.0F;
      }
  return {core::Volume(filtered.geometry(), std::move(values)), low ? *low : 0.5};
}

}  // namespace

Estimate estimate_tissue(const core::Volume& filtered, const Recipe& recipe, const core::Progress& progress) {
  Estimate estimate;
  const auto parameters = tissue_parameters(filtered, recipe, estimate.warnings, progress.part(0.0, 0.1));
  estimate.tissue = model::estimate(filtered, parameters, progress.part(0.1, 0.9));
  estimate.threshold_low = lowest_of(parameters, estimate.tissue.sample);
  progress.report(0.9, "Largest stable step");
  SimulationSettings settings = recipe.simulation;
  settings.anchors = {};  // they only make a step longer
  const auto material = material_of(estimate.tissue.sample, settings);
  estimate.stable_step =
      simulation::stable_step(estimate.tissue.sample, settings.parameters, {nullptr, nullptr, &material});
  return estimate;
}

BuiltTissue build_tissue(const core::Volume& filtered, const Recipe& recipe, const core::Progress& progress) {
  simulation::check(recipe.simulation.parameters);
  BuiltTissue built;
  const auto parameters = tissue_parameters(filtered, recipe, built.warnings, progress.part(0.0, 0.1));
  const auto start = std::chrono::steady_clock::now();
  built.tissue =
      std::make_shared<const model::Tissue>(model::generate(filtered, parameters, progress.part(0.1, 0.8)));
  built.build_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  built.threshold_low = lowest_of(parameters, *built.tissue);
  built.mask = parameters.mask;
  progress.report(0.8, "Counting the tissue");
  built.statistics = model::statistics_of(*built.tissue);
  built.material = material_with(*built.tissue, recipe.simulation, built.warnings, progress.part(0.85, 0.9));
  progress.report(0.9, "Largest stable step");
  built.stable_step = simulation::stable_step(*built.tissue, recipe.simulation.parameters,
                                              {nullptr, nullptr, &built.material});
  progress.report(1.0, "Tissue built");
  return built;
}

simulation::Material material_of(const model::Tissue& tissue, const SimulationSettings& settings,
                                 const core::Progress& progress) {
  std::vector<core::Warning> unused;
  return material_with(tissue, settings, unused, progress);
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
    std::optional<Field> masked;
    if (tissue.mask) {
      masked = masked_field(filtered, *tissue.mask, recipe);
      parameters.iso_value = masked->iso_value;
    }
    parameters.face_budget = recipe.surface.face_budget;
    parameters.crop = recipe.tissue.crop;
    parameters.min_component = recipe.tissue.min_component;
    mesh = surface::extract(masked ? masked->volume : filtered, parameters, progress.part(0.0, 0.7));
    if (masked && !mesh.intensities.empty())
      std::transform(mesh.vertices_mm.begin(), mesh.vertices_mm.end(), mesh.intensities.begin(),
                     [&](const Eigen::Vector3f& vertex) {
                       return filtered.sample(filtered.geometry().to_ijk(vertex.cast<double>()));
                     });
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
