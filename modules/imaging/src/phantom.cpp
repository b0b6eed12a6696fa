#include "palpate/imaging/phantom.hpp"

#include "phantom_shape.hpp"
#include "phantom_speckle.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace palpate::imaging {
namespace {

// The picture's box in the heart's coordinates (phantom_shape.hpp), mm.
constexpr double depth_mm = 120.0;
constexpr double width_mm = 100.0;
constexpr double height_mm = 88.0;
constexpr double above_apex_mm = 14.0;
/// From the heart's coordinates to LPS: the box is centred on the origin.
constexpr double depth_shift_mm = above_apex_mm - depth_mm / 2.0;

// What the probe sees: a pyramid from a point just above the box's top.
constexpr double probe_y_mm = -15.0;
constexpr double half_opening_tangent = 0.92;
constexpr double nearest_mm = 4.0;
constexpr double furthest_mm = 120.0;

// Grey values before speckle, gain and shadow, which keep the mean.
constexpr double wall_grey = 157.0;
constexpr double blood_grey = 19.0;
constexpr double surroundings_grey = 35.0;
constexpr double valve_grey = 125.0;
constexpr double far_wall_grey = 62.0;  ///< right ventricle and left atrium: hints, below any threshold

core::ImageGeometry geometry_of(int size) {
  const double spacing = depth_mm / size;
  const auto along = [&](double extent) { return static_cast<int>(extent / spacing + 0.5); };
  const std::array<int, 3> dims{along(width_mm), size, along(height_mm)};
  const Eigen::Vector3d last(dims[0] - 1, dims[1] - 1, dims[2] - 1);
  return {dims, Eigen::Vector3d::Constant(spacing), -0.5 * spacing * last};
}

/// 1 inside, 0 outside, a ramp of `width` between: a voxel's share of a body.
double share_inside(double distance, double width) { return std::clamp(0.5 - distance / width, 0.0, 1.0); }

/// A thin shell of half thickness `half` around a surface.
double shell(double distance, double half, double width) {
  return share_inside(std::abs(distance) - half, width);
}

/// Brightness along and across the beams: less with depth, a focal zone, a
/// rib's partial shadow from under the skin down.
double beam_gain(const Eigen::Vector3d& from_probe, double range_mm) {
  const double across = from_probe.x() / from_probe.y();
  const double elevation = from_probe.z() / from_probe.y();
  const double focal = (range_mm - 62.0) / 45.0;
  const double depth = 1.08 - 0.24 * range_mm / furthest_mm + 0.10 * std::max(0.0, 1.0 - focal * focal);
  const double edge = 1.0 - 0.25 * smooth_step(0.35, 0.9, std::sqrt(across * across + elevation * elevation));
  const double from_rib = std::abs(across - 0.30 - 0.30 * elevation);
  const double shadow =
      1.0 - 0.45 * (1.0 - smooth_step(0.025, 0.065, from_rib)) * smooth_step(8.0, 14.0, range_mm);
  return depth * edge * shadow;
}

class Scene {
 public:
  Scene(double phase, double spacing_mm)
      : shape_(contraction_at(phase)),
        opening_(valve_opening_at(phase)),
        edge_mm_(std::max(spacing_mm, 1.0)),
        leaflet_half_mm_(0.5 * std::max(2.6, 1.1 * spacing_mm)),
        moved_(contraction_at(phase) > 0.0) {}

  PhantomLabel label(const Eigen::Vector3d& place) const {
    const auto d = shape_.distances(place);
    if (d.wall <= 0.0) return PhantomLabel::wall;
    if (valve_distance(place, d) <= 0.0) return PhantomLabel::valve;
    return d.inner < 0.0 && place.y() < valve_depth(place) ? PhantomLabel::cavity : PhantomLabel::background;
  }

  /// The grey value at a place, without the beam's part.
  double grey(const Eigen::Vector3d& place, const Eigen::Vector3d& from_probe, double range_mm,
              const Speckle& speckle, std::uint64_t frame) const {
    const auto d = shape_.distances(place);
    const double wall = share_inside(d.wall, edge_mm_);
    const double valve = (1.0 - wall) * share_inside(valve_distance(place, d), edge_mm_);
    const double blood = (1.0 - wall - valve) * blood_share(place, d);
    const double rest = 1.0 - wall - valve - blood;
    const Eigen::Vector3d probe = place - from_probe;
    const double tissue =
        moved_ ? speckle.at(shape_.rest_place(place) - probe, 0) : speckle.at(from_probe, 0);
    double value =
        (wall * wall_grey * wall_texture(d) + valve * valve_grey + rest * around(place, range_mm, d)) *
        tissue;
    // Blood's own echo changes from frame to frame.
    if (blood > 0.0) value += blood * blood_grey * speckle.at(from_probe, 1 + frame);
    return value;
  }

 private:
  double valve_depth(const Eigen::Vector3d& place) const {
    return shape_.valve_depth_mm(place.x() * place.x() + place.z() * place.z(), opening_);
  }
  double valve_distance(const Eigen::Vector3d& place, const HeartShape::Distances& d) const {
    const double leaf = std::abs(place.y() - valve_depth(place)) - leaflet_half_mm_;
    const double gap = opening_ > 0.0 ? 9.0 * opening_ - std::abs(place.x()) : -1.0;
    return std::max(std::max(leaf, gap), d.inner);
  }
  double atrium_distance(const Eigen::Vector3d& place) const {
    return (place - Eigen::Vector3d(0.0, shape_.base_mm() + 12.0, 0.0)).norm() - 25.0;
  }
  /// To the right ventricle's inner wall: a crescent on the septum's other side.
  double right_distance(const Eigen::Vector3d& place) const {
    const double x = (place.x() + 17.0) / 27.0;
    const double y = (place.y() - 84.0) / 56.0;
    const double z = (place.z() - 2.0) / 30.0;
    return (std::sqrt(x * x + y * y + z * z) - 1.0) * 28.0;
  }
  double blood_share(const Eigen::Vector3d& place, const HeartShape::Distances& d) const {
    const double left = std::min(1.0, share_inside(d.inner, edge_mm_));
    const double atrium = place.y() > shape_.base_mm() ? share_inside(atrium_distance(place), edge_mm_) : 0.0;
    const double right = share_inside(std::max(right_distance(place), -d.outer), edge_mm_);
    return std::max(std::max(place.y() <= shape_.base_mm() ? left : 0.0, atrium), right);
  }
  /// The lining of the cavity shines a little more than the middle of the wall.
  static double wall_texture(const HeartShape::Distances& d) {
    return 0.95 + 0.22 * (1.0 - smooth_step(0.5, 3.0, std::abs(d.inner)));
  }
  double around(const Eigen::Vector3d& place, double range_mm, const HeartShape::Distances& d) const {
    const double skin = 30.0 * (1.0 - smooth_step(5.0, 14.0, range_mm));
    const double atrium =
        place.y() > shape_.base_mm() ? shell(atrium_distance(place) - 1.5, 1.4, edge_mm_) : 0.0;
    const double right = d.outer > 0.0 ? shell(right_distance(place) - 1.8, 1.8, edge_mm_) : 0.0;
    return surroundings_grey + skin + (far_wall_grey - surroundings_grey) * std::max(atrium, right);
  }

  HeartShape shape_;
  double opening_;
  double edge_mm_;
  double leaflet_half_mm_;
  bool moved_;
};

/// From LPS mm to the heart's coordinates.
Eigen::Vector3d heart_place(const core::ImageGeometry& geometry, int i, int j, int k) {
  Eigen::Vector3d place = geometry.to_lps_mm(Eigen::Vector3d(i, j, k));
  place.y() -= depth_shift_mm;
  return place;
}

template <typename Value>
core::Volume volume_of(const core::ImageGeometry& geometry, const core::Progress& progress,
                       const std::string& what, const Value& value) {
  std::vector<float> voxels;
  voxels.reserve(geometry.voxel_count());
  for (int k = 0; k < geometry.dims()[2]; ++k) {
    progress.report(static_cast<double>(k) / geometry.dims()[2], what);
    for (int j = 0; j < geometry.dims()[1]; ++j)
      for (int i = 0; i < geometry.dims()[0]; ++i) voxels.push_back(value(heart_place(geometry, i, j, k)));
  }
  return {geometry, std::move(voxels)};
}

void check(const PhantomParameters& parameters) {
  const auto refuse = [](const std::string& text) { core::throw_usage("The phantom's " + text + "."); };
  if (parameters.size < 16 || parameters.size > 512)
    refuse("size is " + std::to_string(parameters.size) + "; it must be from 16 to 512 voxels");
  if (parameters.frames < 1 || parameters.frames > 64)
    refuse("number of frames is " + std::to_string(parameters.frames) + "; it must be from 1 to 64");
  if (!std::isfinite(parameters.period_s) || parameters.period_s <= 0.0)
    refuse("period must be more than 0 s");
  const double bytes = 0.62 * parameters.size * parameters.size * parameters.size * 4.0 * parameters.frames;
  if (bytes > 8e9)
    refuse("frames would take more than 8 GB of memory together; ask for a smaller size or fewer frames");
}

}  // namespace

Phantom make_phantom(const PhantomParameters& parameters, const core::Progress& progress) {
  check(parameters);
  const auto geometry = geometry_of(parameters.size);
  const double spacing_mm = geometry.spacing_mm().x();
  const Speckle speckle(parameters.seed);
  const double parts = parameters.frames + 0.5;
  Phantom phantom;
  for (int frame = 0; frame < parameters.frames; ++frame) {
    const Scene scene(static_cast<double>(frame) / parameters.frames, spacing_mm);
    const auto grey = [&](const Eigen::Vector3d& place) {
      const Eigen::Vector3d from_probe = place - Eigen::Vector3d(0.0, probe_y_mm, 0.0);
      const double range_mm = from_probe.norm();
      const double reach = half_opening_tangent * from_probe.y();
      if (range_mm < nearest_mm || range_mm > furthest_mm || std::abs(from_probe.x()) > reach ||
          std::abs(from_probe.z()) > reach)
        return 0.0F;
      const double value =
          scene.grey(place, from_probe, range_mm, speckle, static_cast<std::uint64_t>(frame)) *
          beam_gain(from_probe, range_mm);
      return static_cast<float>(std::clamp(std::floor(value + 0.5), 0.0, 255.0));
    };
    phantom.frames.push_back(
        volume_of(geometry, progress.part(frame / parts, (frame + 1) / parts), "Making the phantom", grey));
  }
  const Scene first(0.0, spacing_mm);
  phantom.labels =
      volume_of(geometry, progress.part(parameters.frames / parts, 1.0), "Labelling the phantom",
                [&](const Eigen::Vector3d& place) { return static_cast<float>(first.label(place)); });
  phantom.surface = HeartShape(0.0).wall_surface(64, 96);
  for (auto& vertex : phantom.surface.vertices_mm) vertex.y() += static_cast<float>(depth_shift_mm);
  progress.report(1.0, "Making the phantom");
  return phantom;
}

}  // namespace palpate::imaging
