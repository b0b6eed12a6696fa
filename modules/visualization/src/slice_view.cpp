#include "palpate/visualization/slice_view.hpp"

#include "slice_scene.hpp"

namespace palpate::visualization {

struct SliceView::Impl {
  explicit Impl(SlicePlane plane) : scene(plane) {}
  SliceScene scene;
};

SliceView::SliceView(SlicePlane plane) : impl_(std::make_unique<Impl>(plane)) {}
SliceView::~SliceView() = default;
SlicePlane SliceView::plane() const noexcept { return impl_->scene.plane(); }
vtkRenderer* SliceView::renderer() const noexcept { return impl_->scene.renderer(); }
void SliceView::set_content(const SceneContent& content) { impl_->scene.set_content(content); }
void SliceView::set_settings(const ViewSettings& settings) { impl_->scene.set_settings(settings); }
void SliceView::set_preview(const SlicePreview& preview) { impl_->scene.set_preview(preview); }
void SliceView::set_text_scale(double scale) { impl_->scene.set_text_scale(scale); }
int SliceView::axis() const noexcept { return impl_->scene.axis(); }
int SliceView::slice() const noexcept { return impl_->scene.slice(); }
int SliceView::slice_count() const noexcept { return impl_->scene.slice_count(); }
Eigen::Vector3d SliceView::crosshair_at_slice(int index) const {
  return impl_->scene.crosshair_at_slice(index);
}
void SliceView::fit() { impl_->scene.fit(); }
void SliceView::zoom(double factor) { impl_->scene.zoom(factor); }
void SliceView::pan(double dx_px, double dy_px) { impl_->scene.pan(dx_px, dy_px); }
double SliceView::zoom_percent() const { return impl_->scene.zoom_percent(); }
Eigen::Vector3d SliceView::place_at(double x_px, double y_px) const {
  return impl_->scene.place_at(x_px, y_px);
}

}  // namespace palpate::visualization
