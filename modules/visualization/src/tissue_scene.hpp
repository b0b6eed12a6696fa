#pragma once

#include "overlay.hpp"
#include "voxel_image.hpp"

#include "palpate/visualization/scene.hpp"

#include <vtkActor.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkImageSlice.h>
#include <vtkImageSliceMapper.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkRenderer.h>
#include <vtkSphereSource.h>

#include <array>
#include <memory>
#include <string>
#include <vector>

namespace palpate::visualization {

/// Drawn data whose coordinates lie in memory that somebody else owns.
struct SharedGeometry {
  SharedGeometry();
  vtkNew<vtkPoints> points;
  vtkNew<vtkPolyData> data;
  vtkNew<vtkPolyDataMapper> mapper;
  vtkNew<vtkActor> actor;
};

/// A deformed surface that belongs to the content's mesh: another one can be
/// under way while tissue is built anew.
bool is_deformed(const SceneContent& content);

/// The sphere around what the view is about: surface or tissue at rest, else the scan.
struct Sphere {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double radius = 50.0;
};
Sphere sphere_around(const SceneContent& content);

/// What a TissueView shows, and the same for pictures, tile by tile.
class TissueScene {
 public:
  TissueScene();
  ~TissueScene();
  TissueScene(const TissueScene&) = delete;
  TissueScene& operator=(const TissueScene&) = delete;

  vtkRenderer* renderer() const { return renderer_; }
  void set_content(const SceneContent& content);
  void set_settings(const ViewSettings& settings);
  void set_text_scale(double scale) { text_scale_ = scale; }
  /// Aims the camera and draws the overlay anew; happens before every rendering.
  void lay_out();
  /// Fixes the tile for the next renderings, in place of the viewport.
  void set_tile(const Tile& tile);
  const std::vector<std::string>& texts() const noexcept { return overlay_.texts(); }

  interaction::Camera camera() const;
  void set_camera(const interaction::Camera& camera);
  void fit() { fitted_ = true; }
  void rotate(double dx_px, double dy_px);
  void zoom(double factor);
  void pan(double dx_px, double dy_px);
  interaction::Ray ray_at(double x_px, double y_px) const;
  interaction::PickReach reach(double reach_px) const;

 private:
  Tile viewport_tile() const;
  interaction::Camera fitted_camera(const Tile& tile) const;
  double mm_per_px(const Tile& tile) const;  ///< at the focal point
  void take_over(interaction::Camera camera);

  void add_lights();
  void update_surface();
  void update_surface_arrays();
  void update_points();
  void update_point_places();
  void update_held();
  void update_anchors();
  void update_box();
  void update_visibility();
  Show shown() const;
  void aim_camera(const Tile& tile);
  void paint_ground(const Tile& tile);
  void draw_corner_text(const Tile& tile);
  void draw_cube(const Tile& tile);
  void draw_axes(const Tile& tile);
  void place_anchors(const Tile& tile);
  void draw_point_mark(const Tile& tile);

  SceneContent content_;
  ViewSettings settings_;
  interaction::Camera camera_;
  Sphere extent_;
  bool fitted_ = true;  ///< nobody moved the camera
  double text_scale_ = 1.0;
  bool tile_fixed_ = false;
  Tile tile_;
  /// Keeps alive what the arrays of VTK point at.
  std::shared_ptr<const void> surface_memory_;
  std::shared_ptr<const void> point_memory_;

  vtkNew<vtkRenderer> renderer_;
  Overlay overlay_;
  SharedGeometry surface_;
  SharedGeometry points_;
  SharedGeometry links_;
  SharedGeometry held_;
  SharedGeometry anchor_rims_;
  SharedGeometry anchors_;
  SharedGeometry box_;
  SharedGeometry grab_;
  vtkNew<vtkSphereSource> sphere_;
  std::vector<Eigen::Vector3f> anchor_places_;  ///< relative to the tissue's centre
  VoxelImage voxels_;
  std::array<vtkNew<vtkImageSliceMapper>, 3> slice_mappers_;
  std::array<vtkNew<vtkImageSlice>, 3> slices_;
};

}  // namespace palpate::visualization
