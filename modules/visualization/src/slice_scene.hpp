#pragma once

#include "overlay.hpp"
#include "slice_geometry.hpp"
#include "voxel_image.hpp"

#include "palpate/visualization/scene.hpp"
#include "palpate/visualization/slice_view.hpp"

#include <vtkImageSlice.h>
#include <vtkImageSliceMapper.h>
#include <vtkNew.h>
#include <vtkRenderer.h>

#include <vector>

namespace palpate::visualization {

/// What a SliceView shows, and the same for pictures, tile by tile.
class SliceScene {
 public:
  explicit SliceScene(SlicePlane plane);
  ~SliceScene();
  SliceScene(const SliceScene&) = delete;
  SliceScene& operator=(const SliceScene&) = delete;

  vtkRenderer* renderer() const { return renderer_; }
  SlicePlane plane() const noexcept { return plane_; }
  void set_content(const SceneContent& content);
  void set_settings(const ViewSettings& settings);
  void set_preview(const SlicePreview& preview);
  void set_text_scale(double scale) { text_scale_ = scale; }
  /// Aims the camera and draws the overlay anew; happens before every rendering.
  void lay_out();
  /// Fixes the tile for the next renderings, in place of the viewport.
  void set_tile(const Tile& tile);
  const std::vector<std::string>& texts() const noexcept { return overlay_.texts(); }

  int axis() const noexcept { return frame_.axis; }
  int slice() const noexcept;
  int slice_count() const noexcept;
  Eigen::Vector3d crosshair_at_slice(int index) const;
  void fit();
  void zoom(double factor);
  void pan(double dx_px, double dy_px);
  double zoom_percent() const { return zoom_ * 100.0; }
  Eigen::Vector3d place_at(double x_px, double y_px) const;

 private:
  /// From millimetres in LPS to pixels of the whole view.
  struct Projection {
    Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();
    double mm_per_px = 1.0;
    double half_height_mm = 1.0;
    Eigen::Vector2d middle_px = Eigen::Vector2d::Zero();
  };
  /// The preview lies where the slice that is shown lies.
  bool preview_fits() const;
  void show_voxels();
  Tile viewport_tile() const;
  Projection projection(const Tile& tile) const;
  Eigen::Vector2d on_screen(const Projection& projection, const Eigen::Vector3d& lps_mm) const;
  double px(double at_scale_one) const;  ///< at least one whole pixel
  void aim_camera(const Tile& tile, const Projection& projection);
  void update_outline();
  void draw_outline(const Projection& projection);
  void draw_grab(const Projection& projection);
  void draw_anchors(const Projection& projection);
  void draw_point_mark(const Tile& tile, const Projection& projection);
  void draw_crosshair(const Tile& tile, const Projection& projection);
  void draw_frame(const Tile& tile);
  void draw_corner_text(const Tile& tile);
  void draw_side_letters(const Tile& tile);
  void draw_scale_bar(const Tile& tile, const Projection& projection);
  bool is_picture() const;
  std::string position_text() const;
  std::string spacing_text() const;

  SlicePlane plane_;
  SceneContent content_;
  ViewSettings settings_;
  SliceFrame frame_;
  double text_scale_ = 1.0;
  double zoom_ = 1.0;
  Eigen::Vector2d pan_mm_ = Eigen::Vector2d::Zero();
  bool tile_fixed_ = false;
  Tile tile_;
  std::vector<Eigen::Vector3f> outline_;
  bool outline_old_ = true;
  std::vector<Eigen::Vector3d> anchors_here_;  ///< that lie in the slice
  bool anchors_old_ = true;
  double lower_letter_px_ = 0.0;
  vtkNew<vtkRenderer> renderer_;
  Overlay overlay_;
  VoxelImage voxels_;
  VoxelImage preview_;
  std::string mark_;
  vtkNew<vtkImageSliceMapper> mapper_;
  vtkNew<vtkImageSlice> actor_;
};

}  // namespace palpate::visualization
