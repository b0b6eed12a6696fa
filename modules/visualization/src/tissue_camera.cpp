// The camera of the 3-D view, and what is drawn over the view.
#include "slice_geometry.hpp"
#include "tissue_scene.hpp"

#include <Eigen/Geometry>
#include <vtkCamera.h>
#include <vtkProperty.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::visualization {
namespace {

constexpr double pi = 3.14159265358979323846;
constexpr double radians(double degrees) { return degrees * pi / 180.0; }

/// The camera's own axes: right, up, and towards the viewer.
Eigen::Matrix3d axes_of(const interaction::Camera& camera) {
  Eigen::Matrix3d axes;
  Eigen::Vector3d toward = camera.position_mm - camera.focal_point_mm;
  if (!(toward.norm() > 0.0)) toward = Eigen::Vector3d::UnitZ();
  toward.normalize();
  Eigen::Vector3d right = camera.view_up.cross(toward);
  if (!(right.norm() > 1e-9)) right = toward.unitOrthogonal();
  axes.col(0) = right.normalized();
  axes.col(1) = toward.cross(axes.col(0));
  axes.col(2) = toward;
  return axes;
}

Rgba shaded(Rgba color, double factor) {
  const auto part = [&](std::uint8_t c) {
    return static_cast<std::uint8_t>(std::clamp(c * factor, 0.0, 255.0));
  };
  return {part(color.r), part(color.g), part(color.b), color.a};
}

}  // namespace

Sphere sphere_around(const SceneContent& content) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  double margin = 1.10;
  const auto each = [&](const auto& add) {
    if (content.mesh && !content.mesh->empty()) {
      for (const Eigen::Vector3f& vertex : content.mesh->vertices_mm) add(vertex.cast<double>());
    } else if (content.tissue && content.tissue->points.size() > 0) {
      for (std::size_t p = 0; p < content.tissue->points.size(); ++p) add(content.tissue->points.lps_mm(p));
    } else if (!content.volume.empty()) {
      const auto& dims = content.volume.dims();
      for (unsigned corner = 0; corner < 8; ++corner) {
        Eigen::Vector3d ijk;
        for (unsigned axis = 0; axis < 3; ++axis)
          ijk[axis] = ((corner >> axis) & 1U) != 0 ? dims[axis] - 0.5 : -0.5;
        add(content.volume.geometry().to_lps_mm(ijk));
      }
      margin = 0.98;
    }
  };
  each([&](const Eigen::Vector3d& place) {
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
  });
  Sphere sphere;
  if (!(low.array() <= high.array()).all()) return sphere;
  sphere.middle = 0.5 * (low + high);
  sphere.radius = 0.0;
  each([&](const Eigen::Vector3d& place) {
    sphere.radius = std::max(sphere.radius, (place - sphere.middle).norm());
  });
  sphere.radius = std::max(1e-3, sphere.radius * margin);
  return sphere;
}

Tile TissueScene::viewport_tile() const {
  if (tile_fixed_ || renderer_->GetVTKWindow() == nullptr) return tile_;  // as it was last drawn
  const int* size = renderer_->GetSize();
  if (size[0] <= 0 || size[1] <= 0) return tile_;
  return {0, 0, size[0], size[1], size[0], size[1]};
}

void TissueScene::set_tile(const Tile& tile) {
  tile_fixed_ = true;
  tile_ = tile;
}

interaction::Camera TissueScene::fitted_camera(const Tile& tile) const {
  interaction::Camera camera;
  const double aspect = static_cast<double>(tile.view_width) / tile.view_height;
  const double half_angle = std::atan(std::tan(radians(0.5 * camera.view_angle_deg)) * std::min(1.0, aspect));
  const double distance = extent_.radius / std::sin(half_angle);
  // From the front, somewhat from the patient's left and from above.
  const Eigen::Vector3d toward = Eigen::Vector3d(0.52, -0.80, 0.34).normalized();
  camera.focal_point_mm = extent_.middle;
  camera.position_mm = extent_.middle + toward * distance;
  camera.view_up = Eigen::Vector3d::UnitZ();
  camera.parallel_scale_mm = extent_.radius / std::min(1.0, aspect);
  return camera;
}

interaction::Camera TissueScene::camera() const { return fitted_ ? fitted_camera(viewport_tile()) : camera_; }

void TissueScene::take_over(interaction::Camera camera) {
  camera_ = std::move(camera);
  fitted_ = false;
}

void TissueScene::set_camera(const interaction::Camera& camera) { take_over(camera); }

void TissueScene::rotate(double dx_px, double dy_px) {
  interaction::Camera now = camera();
  const Eigen::Matrix3d axes = axes_of(now);
  // A drag across the whole height turns by half a turn.
  const double per_px = pi / std::max(1, viewport_tile().view_height);
  const Eigen::Vector3d pole = Eigen::Vector3d::UnitZ();
  const double tilt = std::acos(std::clamp(axes.col(2).dot(pole), -1.0, 1.0));
  // One degree is kept from the poles, where left and right would swap.
  const double limit = radians(1.0);
  const bool upright = axes.col(1).dot(pole) > 0.0;
  double turn = -dy_px * per_px;
  if (upright)
    turn = std::clamp(tilt + dy_px * per_px, std::min(tilt, limit), std::max(tilt, pi - limit)) - tilt;
  const Eigen::Matrix3d about_right = Eigen::AngleAxisd(turn, axes.col(0)).toRotationMatrix();
  const Eigen::Matrix3d about_pole = Eigen::AngleAxisd(-dx_px * per_px, pole).toRotationMatrix();
  const Eigen::Matrix3d rotation = about_pole * about_right;
  now.position_mm = now.focal_point_mm + rotation * (now.position_mm - now.focal_point_mm);
  now.view_up = rotation * axes.col(1);
  take_over(now);
}

void TissueScene::zoom(double factor) {
  if (!(factor > 0.0) || !std::isfinite(factor)) return;
  interaction::Camera now = camera();
  now.position_mm = now.focal_point_mm + (now.position_mm - now.focal_point_mm) / factor;
  now.parallel_scale_mm /= factor;
  take_over(now);
}

double TissueScene::mm_per_px(const Tile& tile) const {
  const interaction::Camera now = camera();
  const double half_height = now.parallel ? now.parallel_scale_mm
                                          : (now.position_mm - now.focal_point_mm).norm() *
                                                std::tan(radians(0.5 * now.view_angle_deg));
  return 2.0 * half_height / tile.view_height;
}

void TissueScene::pan(double dx_px, double dy_px) {
  interaction::Camera now = camera();
  const Eigen::Matrix3d axes = axes_of(now);
  const Eigen::Vector3d shift = (axes.col(0) * dx_px + axes.col(1) * dy_px) * mm_per_px(viewport_tile());
  now.position_mm -= shift;
  now.focal_point_mm -= shift;
  take_over(now);
}

interaction::Ray TissueScene::ray_at(double x_px, double y_px) const {
  const Tile tile = viewport_tile();
  return interaction::ray_through(camera(), 2.0 * x_px / tile.view_width - 1.0,
                                  2.0 * y_px / tile.view_height - 1.0,
                                  static_cast<double>(tile.view_width) / tile.view_height);
}

interaction::PickReach TissueScene::reach(double reach_px) const {
  return interaction::pick_reach(camera(), reach_px, viewport_tile().view_height);
}

void TissueScene::aim_camera(const Tile& tile) {
  const interaction::Camera now = camera();
  const double share = static_cast<double>(tile.height) / tile.view_height;
  vtkCamera* camera = renderer_->GetActiveCamera();
  camera->SetFocalPoint(now.focal_point_mm.data());
  camera->SetPosition(now.position_mm.data());
  camera->SetViewUp(now.view_up.data());
  camera->SetParallelProjection(now.parallel ? 1 : 0);
  camera->SetParallelScale(now.parallel_scale_mm * share);
  camera->SetViewAngle(2.0 * std::atan(std::tan(radians(0.5 * now.view_angle_deg)) * share) * 180.0 / pi);
  camera->SetWindowCenter((2.0 * tile.x + tile.width - tile.view_width) / tile.width,
                          (2.0 * tile.y + tile.height - tile.view_height) / tile.height);
  renderer_->ResetCameraClippingRange();
}

void TissueScene::paint_ground(const Tile& tile) {
  const bool gradient = settings_.use_gradient && !settings_.transparent;
  const auto at = [&](double height) {
    const Eigen::Vector3d low(0.075, 0.086, 0.100);
    const Eigen::Vector3d high(0.185, 0.208, 0.235);
    return Eigen::Vector3d(low + (high - low) * height / tile.view_height);
  };
  const Eigen::Vector3d bottom = at(tile.y);
  const Eigen::Vector3d top = at(tile.y + tile.height);
  renderer_->SetGradientBackground(gradient);
  if (gradient) {
    renderer_->SetBackground(bottom.x(), bottom.y(), bottom.z());
    renderer_->SetBackground2(top.x(), top.y(), top.z());
  } else if (settings_.transparent) {
    renderer_->SetBackground(0.0, 0.0, 0.0);
  } else {
    renderer_->SetBackground(settings_.background[0], settings_.background[1], settings_.background[2]);
  }
  renderer_->SetBackgroundAlpha(settings_.transparent ? 0.0 : 1.0);
}

void TissueScene::lay_out() {
  const Tile tile = viewport_tile();
  tile_ = tile;
  aim_camera(tile);
  paint_ground(tile);
  const double spacing = content_.tissue ? content_.tissue->spacing_mm.mean() : 1.0;
  const double size = std::clamp(0.85 * spacing / mm_per_px(tile), 2.0 * text_scale_, 40.0 * text_scale_);
  points_.actor->GetProperty()->SetPointSize(static_cast<float>(size));
  held_.actor->GetProperty()->SetPointSize(static_cast<float>(1.25 * size + 1.0));
  links_.actor->GetProperty()->SetLineWidth(static_cast<float>(std::max(1.0, std::floor(text_scale_))));
  box_.actor->GetProperty()->SetLineWidth(static_cast<float>(std::max(1.0, std::round(text_scale_))));
  place_anchors(tile);
  overlay_.begin(tile);
  draw_point_mark(tile);
  if (settings_.annotations && !content_.volume.empty()) {
    draw_corner_text(tile);
    if (content_.orientation_known)
      draw_cube(tile);
    else
      draw_axes(tile);
  }
  overlay_.end();
}

// Anchors lie half a voxel inside the surface; drawn nearer to the eye by that
// much they are seen from their own side and stay hidden from the other.
void TissueScene::place_anchors(const Tile& tile) {
  if (!content_.tissue || anchor_places_.empty()) return;
  const double spacing_mm = content_.tissue->spacing_mm.maxCoeff();
  const Eigen::Vector3d toward = axes_of(camera()).col(2);
  const double size = std::clamp(0.55 * spacing_mm / mm_per_px(tile), 3.0 * text_scale_, 10.0 * text_scale_);
  const auto put = [&](SharedGeometry& part, double nearer_mm, double size_px) {
    const Eigen::Vector3d at = content_.tissue->points.center_mm + toward * nearer_mm;
    part.actor->SetPosition(at.x(), at.y(), at.z());
    part.actor->GetProperty()->SetPointSize(static_cast<float>(size_px));
  };
  put(anchor_rims_, 1.0 * spacing_mm, size + 2.0 * std::max(1.0, text_scale_));
  put(anchors_, 1.1 * spacing_mm, size);
}

void TissueScene::draw_point_mark(const Tile& tile) {
  if (!content_.mark) return;
  const auto place = place_of(content_, content_.mark->point);
  if (!place) return;
  const interaction::Camera now = camera();
  const Eigen::Matrix3d axes = axes_of(now);
  const Eigen::Vector3d offset = *place - now.position_mm;
  const double depth = -offset.dot(axes.col(2));
  if (!now.parallel && !(depth > 0.0)) return;  // behind the eye
  const double half_height =
      now.parallel ? now.parallel_scale_mm : depth * std::tan(radians(0.5 * now.view_angle_deg));
  const double px_per_mm = 0.5 * tile.view_height / half_height;
  const Eigen::Vector2d middle(0.5 * tile.view_width, 0.5 * tile.view_height);
  draw_mark(overlay_, middle + px_per_mm * Eigen::Vector2d(offset.dot(axes.col(0)), offset.dot(axes.col(1))),
            content_.mark->text, text_scale_, tile);
}

void TissueScene::draw_corner_text(const Tile& tile) {
  Overlay::TextStyle style;
  style.size_px = legible_px(13.0, text_scale_, tile);
  if (style.size_px == 0) return;
  const double inset = std::round(11.0 * text_scale_);
  style.vertical = Align::end;
  style.bold = true;
  const Eigen::Vector2d size = overlay_.text("3-D", {inset, tile.view_height - inset}, style);
  style.bold = false;
  const bool surface = content_.mesh && !content_.mesh->empty();
  std::string what = "slices";
  if (shown() == Show::points) what = std::to_string(content_.tissue->points.size()) + " points";
  if (shown() == Show::links) what = std::to_string(content_.tissue->links.size()) + " links";
  if (shown() == Show::surface && surface)
    what = is_deformed(content_) ? "deformed surface" : "surface at rest";
  const double line = std::round(std::max(size.y(), 1.15 * style.size_px));
  overlay_.text(what, {inset, tile.view_height - inset - line}, style);
  style.vertical = Align::start;
  style.color = quiet_text_color;
  const auto& dims = content_.volume.dims();
  const Eigen::Vector3d voxels(dims[0], dims[1], dims[2]);
  const Eigen::Vector3d length =
      content_.spacing_assumed ? voxels : content_.volume.geometry().spacing_mm().cwiseProduct(voxels);
  std::string box = "scan ";
  for (int axis = 0; axis < 3; ++axis)
    box += (axis > 0 ? " × " : "") + (content_.spacing_assumed ? short_number(length[axis])
                                                               : std::to_string(std::lround(length[axis])));
  overlay_.text(box + (content_.spacing_assumed ? " voxels" : " mm"), {inset, inset}, style);
}

void TissueScene::draw_cube(const Tile& tile) {
  const double half = 19.0 * text_scale_;
  if (half < 8.0) return;
  const double reach = 1.85 * half;
  const Eigen::Vector2d middle(tile.view_width - reach - 6.0 * text_scale_, reach + 4.0 * text_scale_);
  const Eigen::Matrix3d axes = axes_of(camera());
  const auto flat = [&](const Eigen::Vector3d& lps) {
    return Eigen::Vector2d(lps.dot(axes.col(0)), lps.dot(axes.col(1)));
  };
  // Each face: outward, and how its letter stands. Heads are up on the four sides.
  struct Face {
    Eigen::Vector3d outward, across, upward;
    const char* letter;
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const Face faces[] = {{x, y, z, "L"},  {-x, -y, z, "R"}, {y, -x, z, "P"},
                        {-y, x, z, "A"}, {z, x, y, "S"},   {-z, x, -y, "I"}};
  Overlay::TextStyle style;
  style.size_px = static_cast<int>(std::lround(20.0 * text_scale_));
  style.bold = true;
  style.halo = false;
  for (const Face& face : faces) {
    const double facing = face.outward.dot(axes.col(2));
    if (facing <= 0.02) continue;
    const Eigen::Vector2d at = middle + half * flat(face.outward);
    const Eigen::Vector2d u = half * flat(face.across);
    const Eigen::Vector2d v = half * flat(face.upward);
    const std::vector<Eigen::Vector2d> corners{at - u - v, at + u - v, at + u + v, at - u + v};
    overlay_.polygon(corners, with_alpha(shaded({92, 103, 116, 255}, 0.55 + 0.5 * facing), 235));
    for (std::size_t n = 0; n < 4; ++n)
      overlay_.line(corners[n], corners[(n + 1) % 4], std::max(1.0, text_scale_), {170, 180, 190, 255});
    style.color = with_alpha(text_color, static_cast<std::uint8_t>(255.0 * std::min(1.0, 2.2 * facing)));
    overlay_.text_on_face(face.letter, at, u / half, v / half, style);
  }
}

void TissueScene::draw_axes(const Tile& tile) {
  const double length = 30.0 * text_scale_;
  if (length < 10.0) return;
  const Eigen::Vector2d middle(tile.view_width - 1.75 * length, 1.55 * length);
  const Eigen::Matrix3d view = axes_of(camera());
  const Rgba colors[] = {{214, 112, 100, 255}, {124, 184, 106, 255}, {110, 152, 214, 255}};
  const char* names[] = {"i", "j", "k"};
  Overlay::TextStyle style;
  style.size_px = legible_px(13.0, text_scale_, tile);
  style.horizontal = style.vertical = Align::middle;
  style.bold = true;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d along =
        content_.volume.geometry().ijk_to_lps_mm().block<3, 1>(0, axis).normalized();
    const Eigen::Vector2d end(along.dot(view.col(0)), along.dot(view.col(1)));
    overlay_.line(middle, middle + length * end, std::max(1.5, 2.0 * text_scale_), colors[axis]);
    style.color = colors[axis];
    if (style.size_px > 0) overlay_.text(names[axis], middle + (length + 9.0 * text_scale_) * end, style);
  }
}

}  // namespace palpate::visualization
