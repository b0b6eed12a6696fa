#include "palpate/visualization/tissue_view.hpp"

#include "tissue_scene.hpp"

namespace palpate::visualization {

struct TissueView::Impl {
  TissueScene scene;
};

TissueView::TissueView() : impl_(std::make_unique<Impl>()) {}
TissueView::~TissueView() = default;
vtkRenderer* TissueView::renderer() const noexcept { return impl_->scene.renderer(); }
void TissueView::set_content(const SceneContent& content) { impl_->scene.set_content(content); }
void TissueView::set_settings(const ViewSettings& settings) { impl_->scene.set_settings(settings); }
void TissueView::set_text_scale(double scale) { impl_->scene.set_text_scale(scale); }
interaction::Camera TissueView::camera() const { return impl_->scene.camera(); }
void TissueView::set_camera(const interaction::Camera& camera) { impl_->scene.set_camera(camera); }
void TissueView::fit() { impl_->scene.fit(); }
void TissueView::rotate(double dx_px, double dy_px) { impl_->scene.rotate(dx_px, dy_px); }
void TissueView::zoom(double factor) { impl_->scene.zoom(factor); }
void TissueView::pan(double dx_px, double dy_px) { impl_->scene.pan(dx_px, dy_px); }
interaction::Ray TissueView::ray_at(double x_px, double y_px) const {
  return impl_->scene.ray_at(x_px, y_px);
}
interaction::PickReach TissueView::reach(double reach_px) const { return impl_->scene.reach(reach_px); }

}  // namespace palpate::visualization
