#pragma once

#include "palpate/interaction/ray.hpp"
#include "palpate/visualization/scene.hpp"

#include <memory>

class vtkRenderer;

namespace palpate::visualization {

/// The 3-D view: deformed surface, points or links, the scan's box, the grab,
/// an orientation cube, three lights, a soft gradient. The surface's vertex and
/// normal arrays are those of the DeformedSurface, not copies.
/// GUI thread (the thread of the render window) only.
class TissueView {
 public:
  TissueView();
  ~TissueView();
  vtkRenderer* renderer() const noexcept;

  void set_content(const SceneContent& content);  ///< cheap for what did not change
  void set_settings(const ViewSettings& settings);
  void set_text_scale(double scale);

  interaction::Camera camera() const;
  void set_camera(const interaction::Camera& camera);
  void fit();
  void rotate(double dx_px, double dy_px);  ///< turntable about the focal point
  void zoom(double factor);
  void pan(double dx_px, double dy_px);
  /// Ray through a viewport pixel (origin bottom left; the middle of the first
  /// pixel is 0.5).
  interaction::Ray ray_at(double x_px, double y_px) const;
  interaction::PickReach reach(double reach_px) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::visualization
