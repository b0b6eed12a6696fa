// The part of the workbench that fixes points in their place.
#include "workbench.hpp"

#include <QFileInfo>

#include <algorithm>
#include <utility>

namespace palpate::gui {
namespace {

using Rule = session::AnchorSettings::Rule;

// A stroke leaves a dab where it has come a good part of the brush further.
constexpr double dab_apart = 0.35;

}  // namespace

void Workbench::check_anchor_file(const session::AnchorSettings& anchors) {
  const QString name = QFileInfo(QString::fromStdString(anchors.file.string())).fileName();
  jobs_.start(
      JobLane::anchors, tr("Reading %1").arg(name),
      [this, anchors, built = built_,
       settings = recipe_.simulation](const core::Progress& progress) mutable -> JobTracker::Delivery {
        if (built) {
          settings.anchors = anchors;
          settings.scaling = {};
          session::material_of(*built->tissue, settings, progress);
        } else {
          session::InputSettings input;
          input.path = anchors.file;
          session::read_input(input, progress);
        }
        return [this, anchors] { take_anchors(anchors); };
      },
      [this](const core::Error& error) {
        fail(error);
        emit simulationSettingsChanged();  // what was chosen did not come about
      });
}

void Workbench::take_anchors(const session::AnchorSettings& anchors) {
  recipe_.simulation.anchors = anchors;
  if (driver_) driver_->set_settings(recipe_.simulation);
  emit simulationSettingsChanged();
  find_anchors();
}

// What the rule gives; what was painted is laid over it here, without waiting.
void Workbench::find_anchors() {
  rule_anchors_.clear();
  if (!built_ || recipe_.simulation.anchors.rule == Rule::none) {
    jobs_.cancel_lane(JobLane::anchors);
    lay_anchors();
    return;
  }
  session::SimulationSettings settings = recipe_.simulation;
  settings.anchors.painted.clear();
  settings.scaling = {};
  jobs_.start(
      JobLane::anchors, QString(),
      [this, settings, tissue = built_->tissue](const core::Progress& progress) -> JobTracker::Delivery {
        auto found = std::make_shared<std::vector<std::uint32_t>>(
            session::material_of(*tissue, settings, progress).anchors);
        return [this, found] {
          rule_anchors_ = std::move(*found);
          lay_anchors();
        };
      },
      [this](const core::Error& error) {
        lay_anchors();
        fail(error);
      });
}

void Workbench::lay_anchors() {
  anchors_.reset();
  if (built_) {
    auto laid =
        session::paint_anchors(rule_anchors_, built_->tissue->points, recipe_.simulation.anchors.painted);
    if (!laid.empty()) anchors_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(laid));
  }
  emit anchorsChanged();
}

// They belong to the scan and to where its tissue lay.
void Workbench::forget_anchors() {
  jobs_.cancel_lane(JobLane::anchors);
  anchor_undo_.clear();
  anchor_redo_.clear();
  stroke_before_.reset();
  rule_anchors_.clear();
  anchors_.reset();
  pulls_ = 0;
  emit anchorsChanged();
}

void Workbench::begin_anchor_stroke(bool frees) {
  if (!built_) return;
  stroke_before_ = recipe_.simulation.anchors.painted;
  stroke_frees_ = frees != brush_frees_;
}

void Workbench::paint_anchors(const interaction::Ray& ray, const interaction::PickReach& reach) {
  if (!built_ || !stroke_before_) return;
  const auto& points = built_->tissue->points;
  const bool moved = frame_ && frame_->positions_mm && frame_->positions_mm->size() == points.size();
  const auto& positions = moved ? *frame_->positions_mm : points.positions_mm;
  const auto hit = interaction::pick(ray, reach, {positions, points.center_mm});
  if (!hit) return;
  auto& painted = recipe_.simulation.anchors.painted;
  const session::AnchorDab dab{points.lps_mm(hit->point), grab_radius_mm_, stroke_frees_};
  const bool begun = painted.size() > stroke_before_->size();
  if (begun && (painted.back().place_mm - dab.place_mm).norm() < dab_apart * grab_radius_mm_) return;
  painted.push_back(dab);
  lay_anchors();
}

void Workbench::end_anchor_stroke() {
  if (!stroke_before_) return;
  auto before = std::move(*stroke_before_);
  stroke_before_.reset();
  if (before.size() == recipe_.simulation.anchors.painted.size()) return;
  put_anchor_step(std::move(before));
}

void Workbench::clear_painted_anchors() {
  auto& painted = recipe_.simulation.anchors.painted;
  if (painted.empty()) return;
  put_anchor_step(std::exchange(painted, {}));
  lay_anchors();
}

void Workbench::put_anchor_step(std::vector<session::AnchorDab> before) {
  anchor_undo_.push_back({std::move(before), pulls_});
  anchor_redo_.clear();
  if (driver_) driver_->set_settings(recipe_.simulation);
  emit simulationSettingsChanged();
  emit anchorsChanged();
}

// Strokes and pulls are undone in the order in which they were made.
bool Workbench::anchors_undo_first() const {
  return !anchor_undo_.empty() && (anchor_undo_.back().pulls >= pulls_ || !(frame_ && frame_->can_undo));
}

bool Workbench::anchors_redo_first() const {
  return !anchor_redo_.empty() && (anchor_redo_.back().pulls <= pulls_ || !(frame_ && frame_->can_redo));
}

bool Workbench::simulation_can_undo() const {
  return simulation_ready() && ((frame_ && frame_->can_undo) || !anchor_undo_.empty());
}

bool Workbench::simulation_can_redo() const {
  return simulation_ready() && ((frame_ && frame_->can_redo) || !anchor_redo_.empty());
}

void Workbench::undo_simulation() {
  if (anchors_undo_first()) {
    exchange_painted(anchor_undo_, anchor_redo_);
  } else {
    pulls_ = std::max(0, pulls_ - 1);
    driver_->undo();
  }
}

void Workbench::redo_simulation() {
  if (anchors_redo_first()) {
    exchange_painted(anchor_redo_, anchor_undo_);
  } else {
    ++pulls_;
    driver_->redo();
  }
}

void Workbench::exchange_painted(std::vector<AnchorStep>& from, std::vector<AnchorStep>& to) {
  AnchorStep step = std::move(from.back());
  from.pop_back();
  to.push_back({std::exchange(recipe_.simulation.anchors.painted, std::move(step.painted)), step.pulls});
  if (driver_) driver_->set_settings(recipe_.simulation);
  lay_anchors();
  emit simulationSettingsChanged();
}

}  // namespace palpate::gui
