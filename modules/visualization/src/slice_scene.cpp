#include "slice_scene.hpp"

#include <vtkCallbackCommand.h>
#include <vtkCamera.h>
#include <vtkImageProperty.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace palpate::visualization {
namespace {

/// Lays the scene out whenever its renderer is about to draw, so that a
/// resized window needs no call.
void on_start(vtkObject* /*caller*/, unsigned long /*event*/, void* scene, void* /*data*/) {
  static_cast<SliceScene*>(scene)->lay_out();
}

}  // namespace

SliceScene::SliceScene(SlicePlane plane) : plane_(plane), overlay_(*renderer_) {
  mapper_->BorderOn();  // whole voxels at the edge, not their inner halves
  mapper_->SliceAtFocalPointOff();
  mapper_->SliceFacesCameraOff();
  mapper_->SetInputData(voxels_.image());
  actor_->SetMapper(mapper_);
  actor_->SetUserMatrix(voxels_.ijk_to_lps());
  actor_->GetProperty()->SetInterpolationTypeToLinear();
  actor_->VisibilityOff();
  renderer_->AddViewProp(actor_);
  renderer_->GetActiveCamera()->ParallelProjectionOn();
  vtkNew<vtkCallbackCommand> command;
  command->SetCallback(on_start);
  command->SetClientData(this);
  renderer_->AddObserver(vtkCommand::StartEvent, command);
}

SliceScene::~SliceScene() { renderer_->RemoveObservers(vtkCommand::StartEvent); }

void SliceScene::set_content(const SceneContent& content) {
  const bool moved = content.mesh != content_.mesh || content.deformed != content_.deformed;
  const bool reshaped = !same_geometry(content.volume, content_.volume);
  if (content.anchors != content_.anchors || content.tissue != content_.tissue ||
      content.positions_mm != content_.positions_mm || reshaped)
    anchors_old_ = true;
  content_ = content;
  if (voxels_.set_volume(content_.volume)) {
    actor_->SetVisibility(content_.volume.empty() ? 0 : 1);
    mapper_->Modified();
  }
  if (reshaped) {
    frame_ = slice_frame(content_.volume.geometry(), plane_);
    mapper_->SetOrientation(frame_.axis);
    fit();
  }
  show_voxels();
  if (moved || reshaped) outline_old_ = true;
}

void SliceScene::set_preview(const SlicePreview& preview) {
  mark_ = preview.mark;
  if (preview_.set_volume(preview.slice)) mapper_->Modified();
  show_voxels();
}

bool SliceScene::preview_fits() const {
  const core::Volume& preview = preview_.volume();
  if (preview.empty() || content_.volume.empty()) return false;
  const core::ImageGeometry& geometry = content_.volume.geometry();
  auto dims = geometry.dims();
  dims[static_cast<std::size_t>(frame_.axis)] = 1;
  if (preview.dims() != dims) return false;
  const double step_mm = geometry.spacing_mm()[frame_.axis];
  const Eigen::Vector3d apart =
      slice_center_mm(preview.geometry(), frame_.axis, 0) - slice_center_mm(geometry, frame_.axis, slice());
  return apart.norm() < 1e-3 * step_mm;  // rounding of places, far below a slice
}

void SliceScene::show_voxels() {
  const bool preview = preview_fits();
  const VoxelImage& shown = preview ? preview_ : voxels_;
  if (mapper_->GetInput() != shown.image()) mapper_->SetInputData(shown.image());
  actor_->SetUserMatrix(shown.ijk_to_lps());
  mapper_->SetSliceNumber(preview ? 0 : slice());
}

void SliceScene::set_settings(const ViewSettings& settings) {
  const int before = slice();
  settings_ = settings;
  if (slice() != before) outline_old_ = anchors_old_ = true;
  show_voxels();
  actor_->GetProperty()->SetColorWindow(settings_.window);
  actor_->GetProperty()->SetColorLevel(settings_.level);
  renderer_->SetBackground(settings_.background[0], settings_.background[1], settings_.background[2]);
}

int SliceScene::slice() const noexcept {
  return slice_through(content_.volume.geometry(), frame_.axis, settings_.crosshair_mm);
}

int SliceScene::slice_count() const noexcept {
  return content_.volume.empty() ? 0 : content_.volume.dims()[static_cast<std::size_t>(frame_.axis)];
}

Eigen::Vector3d SliceScene::crosshair_at_slice(int index) const {
  const core::ImageGeometry& geometry = content_.volume.geometry();
  Eigen::Vector3d ijk = geometry.to_ijk(settings_.crosshair_mm);
  ijk[frame_.axis] = std::clamp(index, 0, std::max(0, slice_count() - 1));
  return geometry.to_lps_mm(ijk);
}

void SliceScene::fit() {
  zoom_ = 1.0;
  pan_mm_.setZero();
}

void SliceScene::zoom(double factor) {
  if (factor > 0.0 && std::isfinite(factor)) zoom_ = std::clamp(zoom_ * factor, 0.05, 200.0);
}

void SliceScene::pan(double dx_px, double dy_px) {
  pan_mm_ -= Eigen::Vector2d(dx_px, dy_px) * projection(viewport_tile()).mm_per_px;
}

Tile SliceScene::viewport_tile() const {
  if (tile_fixed_ || renderer_->GetVTKWindow() == nullptr) return tile_;  // as it was last drawn
  const int* size = renderer_->GetSize();
  if (size[0] <= 0 || size[1] <= 0) return tile_;
  return {0, 0, size[0], size[1], size[0], size[1]};
}

void SliceScene::set_tile(const Tile& tile) {
  tile_fixed_ = true;
  tile_ = tile;
}

SliceScene::Projection SliceScene::projection(const Tile& tile) const {
  const core::ImageGeometry& geometry = content_.volume.geometry();
  const Eigen::Vector2d half = slice_half_extent_mm(geometry, frame_);
  const double aspect = static_cast<double>(tile.view_width) / tile.view_height;
  constexpr double margin = 1.04;
  Projection projection;
  projection.half_height_mm = std::max(half.y(), half.x() / aspect) * margin / zoom_;
  projection.mm_per_px = 2.0 * projection.half_height_mm / tile.view_height;
  projection.middle_mm =
      slice_center_mm(geometry, frame_.axis, slice()) + pan_mm_.x() * frame_.right + pan_mm_.y() * frame_.up;
  projection.middle_px = Eigen::Vector2d(tile.view_width, tile.view_height) * 0.5;
  return projection;
}

Eigen::Vector2d SliceScene::on_screen(const Projection& projection, const Eigen::Vector3d& lps_mm) const {
  const Eigen::Vector3d offset = lps_mm - projection.middle_mm;
  return projection.middle_px +
         Eigen::Vector2d(offset.dot(frame_.right), offset.dot(frame_.up)) / projection.mm_per_px;
}

Eigen::Vector3d SliceScene::place_at(double x_px, double y_px) const {
  const Projection now = projection(viewport_tile());
  const Eigen::Vector2d offset = (Eigen::Vector2d(x_px, y_px) - now.middle_px) * now.mm_per_px;
  return now.middle_mm + offset.x() * frame_.right + offset.y() * frame_.up;
}

void SliceScene::aim_camera(const Tile& tile, const Projection& projection) {
  vtkCamera* camera = renderer_->GetActiveCamera();
  const Eigen::Vector3d& focal = projection.middle_mm;
  // Far enough for any pan; only the slice itself is in the scene.
  const double distance = std::max(1.0, 10.0 * projection.half_height_mm);
  const Eigen::Vector3d eye = focal + frame_.toward * distance;
  camera->SetFocalPoint(focal.x(), focal.y(), focal.z());
  camera->SetPosition(eye.x(), eye.y(), eye.z());
  camera->SetViewUp(frame_.up.x(), frame_.up.y(), frame_.up.z());
  camera->SetParallelScale(projection.half_height_mm * tile.height / tile.view_height);
  camera->SetWindowCenter((2.0 * tile.x + tile.width - tile.view_width) / tile.width,
                          (2.0 * tile.y + tile.height - tile.view_height) / tile.height);
  camera->SetClippingRange(0.5 * distance, 1.5 * distance);
}

void SliceScene::lay_out() {
  const Tile tile = viewport_tile();
  tile_ = tile;
  const Projection now = projection(tile);
  aim_camera(tile, now);
  overlay_.begin(tile);
  if (!content_.volume.empty()) {
    draw_grab(now);
    draw_outline(now);
    draw_anchors(now);
    // One slice has no other view that its crosshair would lead to.
    if (settings_.show_crosshair && !is_picture()) draw_crosshair(tile, now);
    draw_point_mark(tile, now);
  }
  draw_frame(tile);
  if (settings_.annotations && !content_.volume.empty()) {
    draw_corner_text(tile);
    draw_side_letters(tile);
    draw_scale_bar(tile, now);
  }
  overlay_.end();
}

}  // namespace palpate::visualization
