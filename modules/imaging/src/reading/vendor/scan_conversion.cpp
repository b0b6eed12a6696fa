#include "scan_conversion.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::imaging::reading {
namespace {

/// Looks angles up in a list that rises or falls, evenly as a rule.
class Angles {
 public:
  explicit Angles(const std::vector<double>& list) : list_(list) {
    const double last = static_cast<double>(list.size() - 1);
    step_ = (list.back() - list.front()) / last;
    for (std::size_t n = 0; n < list.size(); ++n)
      even_ =
          even_ && std::abs(list.front() + step_ * static_cast<double>(n) - list[n]) < 1e-4 * std::abs(step_);
  }
  /// Between 0 and size - 1; negative outside.
  double index_of(double angle) const {
    const double last = static_cast<double>(list_.size() - 1);
    constexpr double rounding = 1e-6;  // of an index: the outermost rays belong to the fan
    if (even_) return inside((angle - list_.front()) / step_, last, rounding);
    const bool rises = step_ > 0.0;
    const auto after = std::upper_bound(list_.begin(), list_.end(), angle,
                                        [rises](double a, double b) { return rises ? a < b : a > b; });
    const auto upper =
        std::clamp<std::ptrdiff_t>(after - list_.begin(), 1, static_cast<std::ptrdiff_t>(last));
    const double low = list_[static_cast<std::size_t>(upper - 1)];
    const double high = list_[static_cast<std::size_t>(upper)];
    return inside(static_cast<double>(upper - 1) + (angle - low) / (high - low), last, rounding);
  }
  static double inside(double index, double last, double rounding) {
    if (!(index >= -rounding) || index > last + rounding) return -1.0;
    return std::clamp(index, 0.0, last);
  }

 private:
  const std::vector<double>& list_;
  double step_ = 1.0;
  bool even_ = true;
};

/// The part of the swept volume on whose side of the axis its voxels are.
double side_of(const SweptFan& fan) {
  const double middle = fan.first_mm + 0.5 * fan.step_mm * (fan.radial - 1);
  return middle >= fan.axis_mm ? 1.0 : -1.0;
}

struct Sample {
  std::size_t at = 0;  ///< of the lower neighbour
  std::size_t up = 0;  ///< 1, or 0 at the last
  float part = 0.0F;
};
Sample sample_at(double index, std::size_t count) {
  Sample sample;
  sample.at = std::min(static_cast<std::size_t>(index), count - 1);
  sample.up = sample.at + 1 < count ? 1 : 0;
  sample.part = sample.up == 0 ? 0.0F : static_cast<float>(index - static_cast<double>(sample.at));
  return sample;
}

float mix(float a, float b, float part) { return a + (b - a) * part; }

}  // namespace

Eigen::Vector3d SweptFan::place(double radius_mm, double fan_angle, double sweep_angle) const {
  const double from_axis = radius_mm * std::cos(fan_angle) - axis_mm;
  return {radius_mm * std::sin(fan_angle), -from_axis * std::sin(sweep_angle),
          axis_mm + from_axis * std::cos(sweep_angle)};
}

Eigen::Vector3d SweptFan::voxel_at(const Eigen::Vector3d& place_mm) const {
  const double side = side_of(*this);
  const double depth = place_mm[2] - axis_mm;
  const double forward = axis_mm + side * std::hypot(place_mm[1], depth);
  const double radius = std::hypot(place_mm[0], forward);
  return {Angles::inside((radius - first_mm) / step_mm, radial - 1, 1e-6),
          Angles(fan).index_of(std::atan2(place_mm[0], forward)),
          Angles(sweep).index_of(std::atan2(-side * place_mm[1], side * depth))};
}

std::array<Eigen::Vector3d, 2> SweptFan::bounds() const {
  // Along a ray a place moves on a straight line, so that the ends of the rays
  // hold all extremes but those between angles, where straight ahead is one.
  std::vector<double> fans = fan;
  std::vector<double> sweeps = sweep;
  for (auto* angles : {&fans, &sweeps})
    if (angles->front() * angles->back() < 0.0) angles->push_back(0.0);
  std::array<Eigen::Vector3d, 2> box{Eigen::Vector3d::Constant(1e300), Eigen::Vector3d::Constant(-1e300)};
  for (const double radius : {first_mm, first_mm + step_mm * (radial - 1)})
    for (const double a : fans)
      for (const double b : sweeps) {
        const Eigen::Vector3d point = place(radius, a, b);
        box[0] = box[0].cwiseMin(point);
        box[1] = box[1].cwiseMax(point);
      }
  return box;
}

core::ImageGeometry cartesian_grid(const SweptFan& fan, double spacing_mm) {
  const auto box = fan.bounds();
  std::array<int, 3> dims{};
  for (int axis = 0; axis < 3; ++axis)
    dims[static_cast<std::size_t>(axis)] =
        1 + static_cast<int>(std::floor((box[1][axis] - box[0][axis]) / spacing_mm + 1e-9));
  // What the last cube leaves over is shared by both ends.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis)
    origin[axis] =
        0.5 * (box[0][axis] + box[1][axis] - spacing_mm * (dims[static_cast<std::size_t>(axis)] - 1));
  return core::ImageGeometry(dims, Eigen::Vector3d::Constant(spacing_mm), origin);
}

void scan_convert(const SweptFan& fan, const std::uint8_t* voxels, const core::ImageGeometry& grid,
                  float* out, const core::Progress& progress) {
  const Angles fan_angles(fan.fan);
  const Angles sweep_angles(fan.sweep);
  const double side = side_of(fan);
  const auto radial = static_cast<std::size_t>(fan.radial);
  const std::size_t ray = radial;
  const std::size_t plane = radial * fan.fan.size();
  const auto& dims = grid.dims();
  const double spacing = grid.spacing_mm()[0];
  const Eigen::Vector3d origin = grid.origin_mm();
  for (int k = 0; k < dims[2]; ++k) {
    progress.report(static_cast<double>(k) / dims[2], "Converting beams to voxels");
    const double depth = origin[2] + spacing * k - fan.axis_mm;
    for (int j = 0; j < dims[1]; ++j) {
      float* row = out + grid.index(0, j, k);
      const double y = origin[1] + spacing * j;
      const double swept = sweep_angles.index_of(std::atan2(-side * y, side * depth));
      std::fill(row, row + dims[0], 0.0F);
      if (swept < 0.0) continue;
      const Sample sweep = sample_at(swept, fan.sweep.size());
      const double forward = fan.axis_mm + side * std::hypot(y, depth);
      for (int i = 0; i < dims[0]; ++i) {
        const double x = origin[0] + spacing * i;
        const double along = Angles::inside(
            (std::sqrt(x * x + forward * forward) - fan.first_mm) / fan.step_mm, fan.radial - 1, 1e-6);
        if (along < 0.0) continue;
        const double across = fan_angles.index_of(std::atan2(x, forward));
        if (across < 0.0) continue;
        const Sample r = sample_at(along, radial);
        const Sample a = sample_at(across, fan.fan.size());
        const std::uint8_t* corner = voxels + sweep.at * plane + a.at * ray + r.at;
        const auto on_ray = [&](const std::uint8_t* from) {
          return mix(static_cast<float>(from[0]), static_cast<float>(from[r.up]), r.part);
        };
        const auto on_plane = [&](const std::uint8_t* from) {
          return mix(on_ray(from), on_ray(from + a.up * ray), a.part);
        };
        row[i] = mix(on_plane(corner), on_plane(corner + sweep.up * plane), sweep.part);
      }
    }
  }
}

}  // namespace palpate::imaging::reading
