// What a slice view draws over its slice: outline, grab, crosshair, frame and words.
#include "slice_scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace palpate::visualization {
namespace {

constexpr double pi = 3.14159265358979323846;

const char* name_of(SlicePlane plane) {
  switch (plane) {
    case SlicePlane::axial:
      return "Axial";
    case SlicePlane::coronal:
      return "Coronal";
    case SlicePlane::sagittal:
      break;
  }
  return "Sagittal";
}

std::string with_decimals(double value, int decimals) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

}  // namespace

double SliceScene::px(double at_scale_one) const {
  return std::max(1.0, std::round(at_scale_one * text_scale_));
}

void SliceScene::update_outline() {
  if (!outline_old_) return;
  outline_old_ = false;
  outline_.clear();
  if (!content_.mesh || content_.mesh->empty()) return;
  const auto& mesh = *content_.mesh;
  const Eigen::Vector3d origin = slice_center_mm(content_.volume.geometry(), frame_.axis, slice());
  // A deformed surface of another mesh can be under way while tissue is built anew.
  const bool deformed = content_.deformed && content_.deformed->vertex_count() == mesh.vertices_mm.size();
  const float* vertices = deformed ? content_.deformed->vertices() : mesh.vertices_mm.front().data();
  outline_ = cut_by_plane(vertices, mesh.vertices_mm.size(), mesh.triangles, origin, frame_.toward);
}

void SliceScene::draw_outline(const Projection& projection) {
  update_outline();
  const double width = std::max(1.25, 1.6 * text_scale_);
  for (std::size_t n = 0; n + 1 < outline_.size(); n += 2) {
    Eigen::Vector2d from = on_screen(projection, outline_[n].cast<double>());
    Eigen::Vector2d to = on_screen(projection, outline_[n + 1].cast<double>());
    const Eigen::Vector2d along = to - from;
    const double length = along.norm();
    if (!(length > 1e-6)) continue;
    // Neighbouring pieces overlap a little, so that no gap shows in a bend.
    const Eigen::Vector2d cap = along * (0.35 * width / length);
    overlay_.line(from - cap, to + cap, width, accent_color);
  }
}

void SliceScene::draw_grab(const Projection& projection) {
  if (!content_.grab) return;
  const GrabMarker& grab = *content_.grab;
  const double height =
      (grab.origin_mm - slice_center_mm(content_.volume.geometry(), frame_.axis, slice())).dot(frame_.toward);
  const double squared = grab.radius_mm * grab.radius_mm - height * height;
  if (!(squared > 0.0)) return;
  const double radius = std::sqrt(squared) / projection.mm_per_px;
  const Eigen::Vector2d middle = on_screen(projection, grab.origin_mm);
  constexpr int corners = 72;
  std::vector<Eigen::Vector2d> circle;
  for (int n = 0; n < corners; ++n) {
    const double angle = 2.0 * pi * n / corners;
    circle.emplace_back(middle + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  overlay_.polygon(circle, with_alpha(grab_color, 56));
  for (std::size_t n = 0; n < circle.size(); ++n)
    overlay_.line(circle[n], circle[(n + 1) % circle.size()], px(1.25), with_alpha(grab_color, 230));
}

// Those nearer to this slice than to the next one.
void SliceScene::draw_anchors(const Projection& projection) {
  if (anchors_old_) {
    anchors_old_ = false;
    anchors_here_.clear();
    const core::ImageGeometry& geometry = content_.volume.geometry();
    const Eigen::Vector3d middle = slice_center_mm(geometry, frame_.axis, slice());
    const double reach_mm = 0.5 * geometry.spacing_mm()[frame_.axis];
    if (content_.anchors) {
      for (const std::uint32_t point : *content_.anchors) {
        const auto place = place_of(content_, point);
        if (place && std::abs((*place - middle).dot(frame_.toward)) <= reach_mm)
          anchors_here_.push_back(*place);
      }
    }
  }
  const double half = std::max(1.5, 2.0 * text_scale_);
  for (const Rgba color : {anchor_rim_color, anchor_color}) {
    const double size = color.r == anchor_color.r ? half : half + std::max(1.0, text_scale_);
    for (const Eigen::Vector3d& anchor : anchors_here_) {
      const Eigen::Vector2d at = on_screen(projection, anchor);
      overlay_.rectangle(at.x() - size, at.y() - size, at.x() + size, at.y() + size, color);
    }
  }
}

void SliceScene::draw_point_mark(const Tile& tile, const Projection& projection) {
  if (!content_.mark) return;
  const auto place = place_of(content_, content_.mark->point);
  if (!place) return;
  const core::ImageGeometry& geometry = content_.volume.geometry();
  const Eigen::Vector3d middle = slice_center_mm(geometry, frame_.axis, slice());
  // A point of this slice may have moved out of its middle; a voxel is near enough to be pointed at.
  if (std::abs((*place - middle).dot(frame_.toward)) > geometry.spacing_mm()[frame_.axis]) return;
  draw_mark(overlay_, on_screen(projection, *place), content_.mark->text, text_scale_, tile);
}

void SliceScene::draw_crosshair(const Tile& tile, const Projection& projection) {
  const core::ImageGeometry& geometry = content_.volume.geometry();
  Eigen::Vector3d ijk = geometry.to_ijk(settings_.crosshair_mm);
  ijk[frame_.axis] = slice();
  const Eigen::Vector2d middle = on_screen(projection, geometry.to_lps_mm(ijk));
  const double gap = 9.0 * text_scale_;
  const double reach =
      2.0 * std::hypot(tile.view_width, tile.view_height) + (middle - projection.middle_px).norm();
  // The plane that steps along one axis of the slice cuts it along the other.
  const std::array<std::array<int, 2>, 2> lines{
      {{frame_.horizontal_axis, frame_.vertical_axis}, {frame_.vertical_axis, frame_.horizontal_axis}}};
  for (const auto& [stepped, along] : lines) {
    const Eigen::Vector3d step = geometry.ijk_to_lps_mm().block<3, 1>(0, along);
    const Eigen::Vector2d direction =
        Eigen::Vector2d(step.dot(frame_.right), step.dot(frame_.up)).normalized();
    const Rgba color = with_alpha(plane_color(plane_of_axis(geometry, stepped)), 210);
    for (const double sign : {-1.0, 1.0})
      overlay_.line(middle + direction * (sign * gap), middle + direction * (sign * reach), px(1.0), color);
  }
}

void SliceScene::draw_frame(const Tile& tile) {
  const double w = tile.view_width;
  const double h = tile.view_height;
  const double t = px(1.5);
  const Rgba color = plane_color(plane_);
  overlay_.rectangle(0, 0, w, t, color);
  overlay_.rectangle(0, h - t, w, h, color);
  overlay_.rectangle(0, t, t, h - t, color);
  overlay_.rectangle(w - t, t, w, h - t, color);
}

std::string SliceScene::position_text() const {
  const core::ImageGeometry& geometry = content_.volume.geometry();
  if (is_picture()) return {};
  const std::string count = "slice " + std::to_string(slice() + 1) + " of " + std::to_string(slice_count());
  if (content_.spacing_assumed) return count;
  const double place = slice_center_mm(geometry, frame_.axis, slice()).dot(frame_.toward);
  if (!content_.orientation_known) {
    const Eigen::Vector3d step = geometry.ijk_to_lps_mm().block<3, 1>(0, frame_.axis);
    // Depth below the first slice: without a patient there is no other zero.
    const double depth = slice() * std::abs(step.dot(frame_.toward));
    return with_decimals(depth, 1) + " mm · " + count;
  }
  const Eigen::Vector3d side = place < 0.0 ? Eigen::Vector3d(-frame_.toward) : frame_.toward;
  return side_letters(side) + " " + with_decimals(std::abs(place), 1) + " mm · " + count;
}

// A scan of one slice, seen from its front: a picture, not a plane of a body.
bool SliceScene::is_picture() const {
  return slice_count() == 1 && frame_.axis == 2 && content_.volume.dims()[0] > 1 &&
         content_.volume.dims()[1] > 1;
}

std::string SliceScene::spacing_text() const {
  const std::string badge = content_.spacing_badge.empty() ? "" : " · " + content_.spacing_badge;
  if (content_.spacing_assumed) return "spacing unknown" + badge;
  const Eigen::Vector3d& spacing = content_.volume.geometry().spacing_mm();
  if (is_picture()) {
    const double across = spacing[frame_.horizontal_axis];
    const double down = spacing[frame_.vertical_axis];
    if (across == down) return short_number(across) + " mm pixels" + badge;
    return short_number(across) + " × " + short_number(down) + " mm" + badge;
  }
  if (spacing[0] == spacing[1] && spacing[1] == spacing[2])
    return short_number(spacing[0]) + " mm voxels" + badge;
  return short_number(spacing[0]) + " × " + short_number(spacing[1]) + " × " + short_number(spacing[2]) +
         " mm" + badge;
}

void SliceScene::draw_corner_text(const Tile& tile) {
  Overlay::TextStyle style;
  style.size_px = legible_px(13.0, text_scale_, tile);
  if (style.size_px == 0) return;  // not legible: nothing rather than smear
  const double inset = std::round(11.0 * text_scale_);
  const double w = tile.view_width;
  const double h = tile.view_height;
  Overlay::TextStyle title = style;
  title.bold = true;
  title.color = plane_color(plane_);
  title.vertical = Align::end;
  const Eigen::Vector2d size =
      overlay_.text(is_picture() ? "Image" : name_of(plane_), {inset, h - inset}, title);
  const double line = std::round(std::max(size.y(), 1.15 * style.size_px));
  style.vertical = Align::end;
  double top = h - inset - line;
  for (const std::string& text : {position_text(), content_.frame_text}) {
    if (text.empty()) continue;
    overlay_.text(text, {inset, top}, style);
    top -= line;
  }

  style.vertical = Align::start;
  overlay_.text("W " + short_number(settings_.window) + "  L " + short_number(settings_.level),
                {inset, inset + line}, style);
  style.color = quiet_text_color;
  const Eigen::Vector2d spacing = overlay_.text(spacing_text(), {inset, inset}, style);
  // The letter at the lower edge stands above these lines where they reach it.
  lower_letter_px_ = inset + spacing.x() + line > 0.5 * w ? inset + 2.0 * line : inset;

  style.horizontal = Align::end;
  style.vertical = Align::end;
  overlay_.text(std::to_string(std::lround(zoom_percent())) + " %", {w - inset, h - inset}, style);
  if (mark_.empty()) return;
  style.bold = true;
  style.color = accent_color;
  overlay_.text(mark_, {w - inset, h - inset - line}, style);
}

void SliceScene::draw_side_letters(const Tile& tile) {
  if (!content_.orientation_known) return;
  Overlay::TextStyle style;
  style.size_px = legible_px(15.0, text_scale_, tile);
  if (style.size_px == 0) return;
  style.bold = true;
  const double inset = std::round(9.0 * text_scale_);
  const double w = tile.view_width;
  const double h = tile.view_height;
  const auto put = [&](const Eigen::Vector3d& side, const Eigen::Vector2d& place, Align horizontal,
                       Align vertical) {
    style.horizontal = horizontal;
    style.vertical = vertical;
    overlay_.text(side_letters(side), place, style);
  };
  put(-frame_.right, {inset, 0.5 * h}, Align::start, Align::middle);
  put(frame_.right, {w - inset, 0.5 * h}, Align::end, Align::middle);
  put(frame_.up, {0.5 * w, h - inset}, Align::middle, Align::end);
  put(-frame_.up, {0.5 * w, std::max(inset, lower_letter_px_)}, Align::middle, Align::start);
}

void SliceScene::draw_scale_bar(const Tile& tile, const Projection& projection) {
  Overlay::TextStyle style;
  style.size_px = legible_px(13.0, text_scale_, tile);
  if (style.size_px == 0) return;
  // In voxels where nobody said how large one is: those that lie across.
  const double unit_mm =
      content_.spacing_assumed ? content_.volume.geometry().spacing_mm()[frame_.horizontal_axis] : 1.0;
  const double units_per_px = projection.mm_per_px / unit_mm;
  const double length =
      nice_length(0.24 * std::min<double>(tile.view_width, 1.6 * tile.view_height) * units_per_px);
  const double inset = std::round(13.0 * text_scale_);
  const double right = tile.view_width - inset;
  const double left = right - length / units_per_px;
  const double thick = px(2.0);
  const double tick = px(7.0);
  const Rgba halo{0, 0, 0, 120};
  overlay_.rectangle(left - 1, inset - 1, right + 1, inset + thick + 1, halo);
  overlay_.rectangle(left, inset, right, inset + thick, text_color);
  overlay_.rectangle(left, inset, left + thick, inset + tick, text_color);
  overlay_.rectangle(right - thick, inset, right, inset + tick, text_color);
  style.horizontal = Align::middle;
  overlay_.text(length_text(length, content_.spacing_assumed),
                {0.5 * (left + right), inset + thick + px(4.0)}, style);
}

}  // namespace palpate::visualization
