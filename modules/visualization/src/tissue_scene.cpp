#include "tissue_scene.hpp"

#include "palette.hpp"
#include "slice_geometry.hpp"

#include <Eigen/Geometry>
#include <vtkCallbackCommand.h>
#include <vtkImageProperty.h>
#include <vtkLight.h>
#include <vtkPointData.h>
#include <vtkProperty.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace palpate::visualization {
namespace {

void on_start(vtkObject* /*caller*/, unsigned long /*event*/, void* scene, void* /*data*/) {
  static_cast<TissueScene*>(scene)->lay_out();
}

/// A VTK array over memory that is never written through it.
vtkNew<vtkFloatArray> view_of(const float* xyz, std::size_t tuples) {
  vtkNew<vtkFloatArray> array;
  array->SetNumberOfComponents(3);
  array->SetArray(const_cast<float*>(xyz), static_cast<vtkIdType>(tuples * 3), 1);
  return array;
}

vtkNew<vtkUnsignedCharArray> color_array(const std::vector<std::uint8_t>& rgb) {
  vtkNew<vtkUnsignedCharArray> array;
  array->SetNumberOfComponents(3);
  array->SetNumberOfTuples(static_cast<vtkIdType>(rgb.size() / 3));
  std::memcpy(array->GetPointer(0), rgb.data(), rgb.size());
  return array;
}

/// Cells of `corners` points each, from a flat list of point numbers.
template <typename Lists>
vtkNew<vtkCellArray> cells_of(const Lists& lists, int corners) {
  vtkNew<vtkCellArray> cells;
  cells->AllocateExact(static_cast<vtkIdType>(lists.size()), static_cast<vtkIdType>(lists.size()) * corners);
  std::array<vtkIdType, 3> ids{};
  for (const auto& list : lists) {
    for (std::size_t n = 0; n < list.size(); ++n) ids[n] = static_cast<vtkIdType>(list[n]);
    cells->InsertNextCell(corners, ids.data());
  }
  return cells;
}

void set_color(vtkProperty* property, Rgba color) {
  property->SetColor(color.r / 255.0, color.g / 255.0, color.b / 255.0);
  property->SetOpacity(color.a / 255.0);
}

bool same_camera(const std::optional<interaction::Camera>& a, const std::optional<interaction::Camera>& b) {
  if (!a || !b) return !a && !b;
  return a->position_mm == b->position_mm && a->focal_point_mm == b->focal_point_mm &&
         a->view_up == b->view_up && a->view_angle_deg == b->view_angle_deg && a->parallel == b->parallel &&
         a->parallel_scale_mm == b->parallel_scale_mm;
}

}  // namespace

bool is_deformed(const SceneContent& content) {
  return content.mesh && content.deformed &&
         content.deformed->vertex_count() == content.mesh->vertices_mm.size();
}

SharedGeometry::SharedGeometry() {
  points->SetDataTypeToFloat();
  data->SetPoints(points);
  mapper->SetInputData(data);
  actor->SetMapper(mapper);
  actor->PickableOff();
  actor->VisibilityOff();
}

TissueScene::TissueScene() : overlay_(*renderer_) {
  add_lights();
  for (SharedGeometry* part : {&surface_, &points_, &links_, &held_, &anchor_rims_, &anchors_, &box_, &grab_})
    renderer_->AddActor(part->actor);
  vtkProperty* skin = surface_.actor->GetProperty();
  set_color(skin, flesh_color(0.5));
  skin->SetAmbient(0.14);
  skin->SetDiffuse(0.92);
  skin->SetSpecular(0.16);
  skin->SetSpecularPower(22.0);
  vtkNew<vtkProperty> inside;  // seen through an opening: darker, so that it reads as inside
  inside->DeepCopy(skin);
  inside->SetDiffuse(0.55);
  inside->SetSpecular(0.0);
  surface_.actor->SetBackfaceProperty(inside);
  for (SharedGeometry* part : {&points_, &held_}) {
    part->actor->GetProperty()->SetRepresentationToPoints();
    part->actor->GetProperty()->RenderPointsAsSpheresOn();
    part->actor->GetProperty()->SetAmbient(0.18);
    part->actor->GetProperty()->SetDiffuse(0.85);
    part->actor->GetProperty()->SetSpecular(0.10);
  }
  set_color(held_.actor->GetProperty(), held_color);
  // Flat squares with a dark rim: what moves is round.
  set_color(anchors_.actor->GetProperty(), anchor_color);
  set_color(anchor_rims_.actor->GetProperty(), anchor_rim_color);
  for (SharedGeometry* part : {&anchors_, &anchor_rims_})
    part->actor->GetProperty()->SetRepresentationToPoints();
  for (SharedGeometry* part : {&links_, &box_, &anchors_, &anchor_rims_})
    part->actor->GetProperty()->LightingOff();
  set_color(box_.actor->GetProperty(), {150, 160, 172, 120});
  sphere_->SetThetaResolution(48);
  sphere_->SetPhiResolution(32);
  sphere_->SetRadius(1.0);
  grab_.mapper->SetInputConnection(sphere_->GetOutputPort());
  set_color(grab_.actor->GetProperty(), with_alpha(grab_color, 84));
  grab_.actor->GetProperty()->BackfaceCullingOn();
  grab_.actor->GetProperty()->SetAmbient(0.35);
  // Both are blended over what was drawn before them, in the same pass: VTK's pass
  // for translucent things goes over the whole view several times for every picture.
  for (SharedGeometry* part : {&box_, &grab_}) part->actor->ForceOpaqueOn();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    slice_mappers_[axis]->BorderOn();
    slice_mappers_[axis]->SetInputData(voxels_.image());
    slice_mappers_[axis]->SetOrientation(static_cast<int>(axis));
    slices_[axis]->SetMapper(slice_mappers_[axis]);
    slices_[axis]->SetUserMatrix(voxels_.ijk_to_lps());
    slices_[axis]->GetProperty()->SetInterpolationTypeToLinear();
    slices_[axis]->VisibilityOff();
    renderer_->AddViewProp(slices_[axis]);
  }
  vtkNew<vtkCallbackCommand> command;
  command->SetCallback(on_start);
  command->SetClientData(this);
  renderer_->AddObserver(vtkCommand::StartEvent, command);
}

TissueScene::~TissueScene() { renderer_->RemoveObservers(vtkCommand::StartEvent); }

void TissueScene::add_lights() {
  struct Lamp {
    double x, y, z, intensity, r, g, b;
  };
  // Key from upper left, cool fill from the right, and a rim from behind above.
  const Lamp lamps[] = {{-0.75, 0.95, 1.15, 0.92, 1.0, 0.965, 0.92},
                        {1.25, 0.10, 0.80, 0.34, 0.82, 0.90, 1.0},
                        {0.35, 0.85, -1.10, 0.55, 1.0, 0.98, 0.95}};
  renderer_->AutomaticLightCreationOff();
  for (const Lamp& lamp : lamps) {
    vtkNew<vtkLight> light;
    light->SetLightTypeToCameraLight();
    light->SetPosition(lamp.x, lamp.y, lamp.z);
    light->SetFocalPoint(0.0, 0.0, 0.0);
    light->SetIntensity(lamp.intensity);
    light->SetColor(lamp.r, lamp.g, lamp.b);
    renderer_->AddLight(light);
  }
}

void TissueScene::set_content(const SceneContent& content) {
  const SceneContent old = content_;
  content_ = content;
  const bool reshaped = !same_geometry(old.volume, content_.volume);
  voxels_.set_volume(content_.volume);
  if (old.mesh != content_.mesh) update_surface();
  if (old.mesh != content_.mesh || old.deformed != content_.deformed) update_surface_arrays();
  if (old.tissue != content_.tissue) update_points();
  if (old.tissue != content_.tissue || old.positions_mm != content_.positions_mm) update_point_places();
  if (old.tissue != content_.tissue || old.positions_mm != content_.positions_mm ||
      old.held_points != content_.held_points)
    update_held();
  if (old.tissue != content_.tissue || old.positions_mm != content_.positions_mm ||
      old.anchors != content_.anchors)
    update_anchors();
  if (reshaped || old.mesh != content_.mesh || old.tissue != content_.tissue)
    extent_ = sphere_around(content_);
  if (reshaped) {
    update_box();
    fitted_ = !settings_.camera.has_value();
  }
  if (content_.grab) {
    const Eigen::Vector3d& at = content_.grab->origin_mm;
    grab_.actor->SetPosition(at.x(), at.y(), at.z());
    grab_.actor->SetScale(std::max(1e-6, content_.grab->radius_mm));
  }
  update_visibility();
}

void TissueScene::set_settings(const ViewSettings& settings) {
  const bool camera_given = !same_camera(settings.camera, settings_.camera);
  settings_ = settings;
  if (settings_.camera && camera_given) set_camera(*settings_.camera);
  update_visibility();
}

void TissueScene::update_surface() {
  surface_.data->Initialize();
  surface_.data->SetPoints(surface_.points);
  if (!content_.mesh || content_.mesh->empty()) return;
  const core::TriangleMesh& mesh = *content_.mesh;
  surface_.data->SetPolys(cells_of(mesh.triangles, 3));
  if (mesh.intensities.size() == mesh.vertices_mm.size())
    surface_.data->GetPointData()->SetScalars(color_array(map_colors(mesh.intensities, flesh_color)));
}

void TissueScene::update_surface_arrays() {
  if (!content_.mesh || content_.mesh->empty()) {
    surface_memory_.reset();
    return;
  }
  const core::TriangleMesh& mesh = *content_.mesh;
  const std::size_t count = mesh.vertices_mm.size();
  const auto old_memory = surface_memory_;  // until VTK has let go of it
  if (is_deformed(content_)) {
    surface_memory_ = content_.deformed;
    surface_.points->SetData(view_of(content_.deformed->vertices(), count));
    surface_.data->GetPointData()->SetNormals(view_of(content_.deformed->normals(), count));
  } else {
    // Without normals of its own the mesh gets some that live beside it.
    using Normals = std::vector<Eigen::Vector3f>;
    auto made =
        mesh.normals.size() == count ? nullptr : std::make_shared<const Normals>(core::vertex_normals(mesh));
    const float* normals = made ? made->front().data() : mesh.normals.front().data();
    surface_.points->SetData(view_of(mesh.vertices_mm.front().data(), count));
    surface_.data->GetPointData()->SetNormals(view_of(normals, count));
    using Both = std::pair<std::shared_ptr<const core::TriangleMesh>, std::shared_ptr<const Normals>>;
    surface_memory_ = std::make_shared<const Both>(content_.mesh, std::move(made));
  }
  surface_.points->Modified();
  surface_.data->Modified();
}

void TissueScene::update_points() {
  for (SharedGeometry* part : {&points_, &links_}) {
    part->data->Initialize();
    part->data->SetPoints(part->points);
  }
  if (!content_.tissue || content_.tissue->points.size() == 0) return;
  const model::Tissue& tissue = *content_.tissue;
  std::vector<std::array<std::uint32_t, 1>> single(tissue.points.size());
  for (std::size_t p = 0; p < single.size(); ++p) single[p] = {static_cast<std::uint32_t>(p)};
  points_.data->SetVerts(cells_of(single, 1));
  links_.data->SetLines(cells_of(tissue.links.pairs, 2));
  const vtkNew<vtkUnsignedCharArray> colors = color_array(map_colors(tissue.points.intensities, ember_color));
  points_.data->GetPointData()->SetScalars(colors);
  links_.data->GetPointData()->SetScalars(colors);
  const Eigen::Vector3d& center = tissue.points.center_mm;
  for (SharedGeometry* part : {&points_, &links_, &held_})
    part->actor->SetPosition(center.x(), center.y(), center.z());
}

void TissueScene::update_point_places() {
  if (!content_.tissue || content_.tissue->points.size() == 0) {
    point_memory_.reset();
    return;
  }
  const std::size_t count = content_.tissue->points.size();
  const bool moved = content_.positions_mm && content_.positions_mm->size() == count;
  const auto old_memory = point_memory_;
  const auto& places = moved ? *content_.positions_mm : content_.tissue->points.positions_mm;
  if (moved)
    point_memory_ = content_.positions_mm;
  else
    point_memory_ = content_.tissue;
  const vtkNew<vtkFloatArray> array = view_of(places.front().data(), count);
  for (SharedGeometry* part : {&points_, &links_}) {
    part->points->SetData(array);
    part->points->Modified();
    part->data->Modified();
  }
}

void TissueScene::update_held() {
  held_.points->Reset();
  std::vector<std::array<std::uint32_t, 1>> single;
  if (content_.tissue && point_memory_) {
    for (const std::uint32_t p : content_.held_points) {
      if (p >= content_.tissue->points.size()) continue;
      held_.points->InsertNextPoint(points_.points->GetPoint(static_cast<vtkIdType>(p)));
      single.push_back({static_cast<std::uint32_t>(single.size())});
    }
  }
  held_.data->SetVerts(cells_of(single, 1));
  held_.points->Modified();
  held_.data->Modified();
}

// They stay where they are while the others move, so there is rarely anything new to tell VTK.
void TissueScene::update_anchors() {
  std::vector<Eigen::Vector3f> places;
  if (content_.anchors && content_.tissue) {
    const bool moved =
        content_.positions_mm && content_.positions_mm->size() == content_.tissue->points.size();
    const auto& all = moved ? *content_.positions_mm : content_.tissue->points.positions_mm;
    for (const std::uint32_t p : *content_.anchors)
      if (p < all.size()) places.push_back(all[p]);
  }
  if (places == anchor_places_) return;
  anchor_places_ = std::move(places);
  std::vector<std::array<std::uint32_t, 1>> single(anchor_places_.size());
  for (std::size_t p = 0; p < single.size(); ++p) single[p] = {static_cast<std::uint32_t>(p)};
  const vtkNew<vtkCellArray> verts = cells_of(single, 1);
  for (SharedGeometry* part : {&anchor_rims_, &anchors_}) {
    part->points->Reset();
    for (const Eigen::Vector3f& place : anchor_places_)
      part->points->InsertNextPoint(place.x(), place.y(), place.z());
    part->data->SetVerts(verts);
    part->points->Modified();
    part->data->Modified();
  }
}

void TissueScene::update_box() {
  box_.points->Reset();
  if (content_.volume.empty()) return;
  const core::ImageGeometry& geometry = content_.volume.geometry();
  const auto& dims = geometry.dims();
  std::vector<std::array<std::uint32_t, 2>> edges;
  for (std::uint32_t corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d ijk;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const bool far = ((corner >> axis) & 1U) != 0;
      ijk[axis] = far ? dims[axis] - 0.5 : -0.5;
      if (!far) edges.push_back({corner, corner | (1U << axis)});
    }
    const Eigen::Vector3d place = geometry.to_lps_mm(ijk);
    box_.points->InsertNextPoint(place.data());
  }
  box_.data->SetLines(cells_of(edges, 2));
  box_.points->Modified();
  box_.data->Modified();
}

Show TissueScene::shown() const {
  const bool has_mesh = content_.mesh && !content_.mesh->empty();
  const bool has_points = content_.tissue && content_.tissue->points.size() > 0;
  if (settings_.show == Show::surface && !has_mesh && has_points) return Show::points;
  if (settings_.show != Show::surface && !has_points) return Show::surface;
  return settings_.show;
}

void TissueScene::update_visibility() {
  const bool has_mesh = content_.mesh && !content_.mesh->empty();
  const bool has_points = content_.tissue && content_.tissue->points.size() > 0;
  const Show show = shown();
  surface_.actor->SetVisibility(show == Show::surface && has_mesh ? 1 : 0);
  points_.actor->SetVisibility(show == Show::points && has_points ? 1 : 0);
  links_.actor->SetVisibility(show == Show::links && has_points ? 1 : 0);
  held_.actor->SetVisibility(held_.points->GetNumberOfPoints() > 0 ? 1 : 0);
  for (SharedGeometry* part : {&anchor_rims_, &anchors_})
    part->actor->SetVisibility(anchor_places_.empty() ? 0 : 1);
  box_.actor->SetVisibility(content_.volume.empty() ? 0 : 1);
  grab_.actor->SetVisibility(content_.grab ? 1 : 0);
  // Before there is any tissue the three slices stand in the box.
  const bool slices = !has_mesh && !has_points && !content_.volume.empty();
  for (int axis = 0; axis < 3; ++axis) {
    const auto n = static_cast<std::size_t>(axis);
    slices_[n]->SetVisibility(slices ? 1 : 0);
    if (!slices) continue;
    slice_mappers_[n]->SetSliceNumber(
        slice_through(content_.volume.geometry(), axis, settings_.crosshair_mm));
    slices_[n]->GetProperty()->SetColorWindow(settings_.window);
    slices_[n]->GetProperty()->SetColorLevel(settings_.level);
  }
}

}  // namespace palpate::visualization
