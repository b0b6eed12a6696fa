#pragma once

#include "palpate/core/mesh.hpp"
#include "palpate/core/volume.hpp"
#include "palpate/interaction/ray.hpp"
#include "palpate/model/tissue.hpp"
#include "palpate/surface/binding.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate::visualization {

enum class SlicePlane { axial, coronal, sagittal };
enum class Show { surface, points, links };
enum class ColorBy { intensity };

/// The grab as it is drawn: a translucent sphere in 3-D, a circle on slices.
struct GrabMarker {
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  double radius_mm = 5.0;
};

/// A point that the views point out, by a ring with words in all of them.
struct PointMark {
  std::uint32_t point = 0;
  std::string text;
};

/// What is drawn. A value; big things are shared and never written after they
/// were handed over. Anything may be absent.
struct SceneContent {
  core::Volume volume;
  bool spacing_assumed = false;                    ///< lengths are then in voxels
  std::string spacing_badge;                       ///< "stated", "assumed", ...
  std::string frame_text;                          ///< "frame 3 of 8 · 0.40 s"; empty for one frame
  bool orientation_known = false;                  ///< letters R L A P S I only then
  std::shared_ptr<const core::TriangleMesh> mesh;  ///< at rest, with topology
  std::shared_ptr<const surface::DeformedSurface> deformed;  ///< null: at rest
  std::shared_ptr<const model::Tissue> tissue;
  std::shared_ptr<const std::vector<Eigen::Vector3f>> positions_mm;  ///< relative to centre; null: at rest
  std::vector<std::uint32_t> held_points;                            ///< drawn red
  std::optional<GrabMarker> grab;
  std::shared_ptr<const std::vector<std::uint32_t>>
      anchors;  ///< points that never move: squares; may be null
  std::optional<PointMark> mark;
};
/// Where a point of the content's tissue lies now, in LPS; none where it has no such point.
std::optional<Eigen::Vector3d> place_of(const SceneContent& content, std::uint32_t point);

/// How it is drawn.
struct ViewSettings {
  Eigen::Vector3d crosshair_mm = Eigen::Vector3d::Zero();  ///< LPS; decides the slices
  bool show_crosshair = true;
  double window = 255.0;
  double level = 127.5;
  Show show = Show::surface;
  ColorBy color_by = ColorBy::intensity;
  std::optional<interaction::Camera> camera;  ///< of the 3-D view; fitted where absent
  bool annotations = true;                    ///< corner text, scale bar, orientation cube
  std::array<float, 3> background{0.0F, 0.0F, 0.0F};
  bool use_gradient = true;  ///< the 3-D view's own ground
  bool transparent = false;  ///< pictures only
};
/// Crosshair at the volume's centre, window and level from the 0.5 % and
/// 99.5 % quantiles.
ViewSettings standard_settings(const core::Volume& volume);

}  // namespace palpate::visualization
