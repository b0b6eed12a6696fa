#pragma once

#include "palpate/visualization/scene.hpp"

#include <memory>
#include <string>

class vtkRenderer;

namespace palpate::visualization {

/// Shown in the place of the content's voxels while its slice is the one shown.
struct SlicePreview {
  core::Volume slice;  ///< one voxel thick, at its place; empty: the content's voxels
  std::string mark;    ///< in the view's corner, "Preview"; empty: none
};

/// One slice through the voxels: the image plane whose normal lies closest to
/// the anatomical one, placed in LPS by the volume's IJK-to-LPS matrix
/// (vtkImageData itself stays in voxel indices), the crosshair, the outline of
/// the deformed surface, corner text, orientation letters where known, and a
/// scale bar. Shown as in the field: axial from the feet (patient's right on
/// the screen's left), coronal from the front, sagittal from the left.
/// GUI thread (the thread of the render window) only.
class SliceView {
 public:
  explicit SliceView(SlicePlane plane);
  ~SliceView();
  SlicePlane plane() const noexcept;
  vtkRenderer* renderer() const noexcept;  ///< add it to any render window

  void set_content(const SceneContent& content);  ///< cheap for what did not change
  void set_settings(const ViewSettings& settings);
  void set_preview(const SlicePreview& preview);
  /// Pixels per point of text, so that pictures of any size look alike: 1 for
  /// a view 500 pixels high.
  void set_text_scale(double scale);

  int axis() const noexcept;   ///< of the image, 0..2, that is stepped through
  int slice() const noexcept;  ///< index along that axis
  int slice_count() const noexcept;
  /// The crosshair moved so that slice `index` is shown.
  Eigen::Vector3d crosshair_at_slice(int index) const;

  void fit();                ///< shows the whole slice
  void zoom(double factor);  ///< > 1 makes it larger
  void pan(double dx_px, double dy_px);
  double zoom_percent() const;  ///< 100 = fitted
  /// LPS place on the shown slice under a viewport pixel (origin bottom left;
  /// the middle of the first pixel is 0.5).
  Eigen::Vector3d place_at(double x_px, double y_px) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::visualization
