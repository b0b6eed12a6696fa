#include "workbench.hpp"

#include "provenance_badge.hpp"
#include "text.hpp"

#include <QFileInfo>

namespace palpate::gui {
namespace {

// A slider that is dragged changes its value many times; one estimate when it rests.
constexpr int estimate_delay_ms = 150;
// Frames that are passed over are neither filtered nor counted.
constexpr int rest_delay_ms = 300;

}  // namespace

Workbench::Workbench(QObject* parent) : QObject(parent) {
  recipe_.tissue.min_component = 100;  // specks of an echo are not tissue that anyone pulls
  estimate_delay_.setSingleShot(true);
  estimate_delay_.setInterval(estimate_delay_ms);
  connect(&estimate_delay_, &QTimer::timeout, this, &Workbench::run_estimate);
  rest_delay_.setSingleShot(true);
  rest_delay_.setInterval(rest_delay_ms);
  connect(&rest_delay_, &QTimer::timeout, this, &Workbench::rest_at_frame);
  frame_delay_.setSingleShot(true);
  frame_delay_.setTimerType(Qt::PreciseTimer);
  connect(&frame_delay_, &QTimer::timeout, this, &Workbench::take_frame);
  connect(this, &Workbench::volumeOpened, this, &Workbench::forget_filters);
  connect(this, &Workbench::geometryStated, this, &Workbench::forget_filters);
  connect(this, &Workbench::frameShown, this, [this] {
    const auto chain = preview_.chain();
    if (preview_.active()) preview_filters(chain);
  });
}

Workbench::~Workbench() {
  frame_jobs_.cancel_all();
  jobs_.cancel_all();
  stop_driver();
  retired_.clear();  // waits for them: they speak to this object
}

QString Workbench::input_name() const {
  return QFileInfo(QString::fromStdString(recipe_.input.path.string())).fileName();
}

visualization::SceneContent Workbench::content() const {
  visualization::SceneContent content;
  content.volume = comparing_ ? volume_ : filtered_;
  content.spacing_assumed = info_.spacing_is_assumed();
  content.spacing_badge = core::to_string(least_certain(spacing_provenances(info_)));
  if (info_.frames > 1) content.frame_text = describe_frame(info_, frame()).toStdString();
  content.orientation_known = info_.patient_axes;
  content.mesh = surface_.mesh;
  if (built_) content.tissue = built_->tissue;
  content.anchors = anchors_;
  if (const auto limit = step_limit(); limit && limit_shown_)
    content.mark = visualization::PointMark{limit->worst_point, tr("limits the step").toStdString()};
  if (frame_) {
    content.deformed = frame_->surface;
    content.positions_mm = frame_->positions_mm;
    content.held_points = frame_->held_points;
    if (frame_->grab_origin_mm) {
      content.grab = visualization::GrabMarker{*frame_->grab_origin_mm, frame_->grab_radius_mm};
    }
  }
  return content;
}

void Workbench::drop_tissue() {
  jobs_.cancel_lane(JobLane::tissue);
  stop_driver();
  const bool had = built_.has_value();
  built_.reset();
  surface_ = {};
  limit_shown_ = false;
  forget_anchors();
  if (had) emit tissueDropped();
}

void Workbench::set_tissue_parameters(const model::TissueParameters& parameters) {
  recipe_.tissue = parameters;
  emit tissueParametersChanged();
  start_estimate();
}

void Workbench::set_mask(const session::MaskSettings& mask) {
  jobs_.cancel_lane(JobLane::mask);
  if (!mask.path || mask.path == recipe_.mask.path || !has_volume()) {
    recipe_.mask = mask;
    emit tissueParametersChanged();
    start_estimate();
    return;
  }
  session::Recipe wanted = recipe_;
  wanted.mask = mask;
  const QString name = QFileInfo(QString::fromStdString(mask.path->string())).fileName();
  jobs_.start(
      JobLane::mask, tr("Reading %1").arg(name),
      [this, volume = filtered_, wanted](const core::Progress& progress) -> JobTracker::Delivery {
        session::estimate_tissue(volume, wanted, progress);
        return [this, mask = wanted.mask] {
          recipe_.mask = mask;
          emit tissueParametersChanged();
          start_estimate();
        };
      },
      [this](const core::Error& error) {
        fail(error);
        emit tissueParametersChanged();  // what was chosen did not come about
      });
}

void Workbench::set_face_budget(int faces) { recipe_.surface.face_budget = faces; }

void Workbench::set_surface_mesh(const QString& path, surface::MeshSpace space) {
  recipe_.surface.mesh.reset();
  if (!path.isEmpty()) recipe_.surface.mesh = native_path(path);
  recipe_.surface.mesh_space = space;
  emit surfaceSourceChanged();
}

void Workbench::start_estimate() {
  jobs_.cancel_lane(JobLane::estimate);
  estimate_.reset();
  if (!has_volume()) return;
  emit estimateStarted();
  estimate_delay_.start();
}

void Workbench::run_estimate() {
  if (!has_volume()) return;
  jobs_.start(
      JobLane::estimate, QString(),
      [this, volume = filtered_, recipe = recipe_](const core::Progress& progress) -> JobTracker::Delivery {
        auto estimate =
            std::make_shared<session::Estimate>(session::estimate_tissue(volume, recipe, progress));
        return [this, estimate] {
          estimate_ = std::move(*estimate);
          emit tissueEstimated();
        };
      },
      [this](const core::Error& error) { emit estimateFailed(QString::fromUtf8(error.what())); });
}

void Workbench::build_tissue() {
  if (!has_volume()) return;
  const bool filtered = frame_is_filtered();
  jobs_.start(
      JobLane::tissue, tr("Building tissue"),
      [this, volume = filtered ? filtered_ : volume_, filtered, options = filter_options(),
       recipe = recipe_](const core::Progress& progress) -> JobTracker::Delivery {
        const double begin = filtered ? 0.0 : 0.5;
        const core::Volume source =
            filtered
                ? volume
                : session::filter_volume(volume, recipe.filters, options, progress.part(0.0, begin)).volume;
        const core::Progress rest = progress.part(begin, 1.0);
        auto built = std::make_shared<session::BuiltTissue>(
            session::build_tissue(source, recipe, rest.part(0.0, 0.6)));
        auto surface = std::make_shared<session::BoundSurface>(
            session::build_surface(source, *built, recipe, rest.part(0.6, 1.0)));
        return [this, built, surface, frame = recipe.input.frame] {
          take_tissue(std::move(*built), std::move(*surface), frame);
        };
      },
      [this](const core::Error& error) { fail(error); });
}

void Workbench::take_tissue(session::BuiltTissue built, session::BoundSurface surface, int frame) {
  stop_driver();
  forget_anchors();
  built_ = std::move(built);
  surface_ = std::move(surface);
  tissue_frame_ = frame;
  emit tissueBuilt();
  find_anchors();
  start_driver();
  warn(built_->warnings);
}

void Workbench::save_picture(const QString& path, const visualization::ViewSettings& settings,
                             const visualization::PictureRequest& request) {
  jobs_.start(
      JobLane::picture, tr("Drawing the picture"),
      [this, path, settings, request,
       scene = content()](const core::Progress& progress) -> JobTracker::Delivery {
        const core::Picture picture =
            visualization::draw_picture(scene, settings, request, progress.part(0.0, 0.7));
        progress.report(0.7, "writing");
        visualization::save_png(native_path(path), picture);
        return [this, path] { emit pictureSaved(path); };
      },
      [this](const core::Error& error) { fail(error); });
}

void Workbench::preview_picture(const visualization::ViewSettings& settings,
                                const visualization::PictureRequest& request) {
  jobs_.start(
      JobLane::preview, QString(),
      [this, settings, request, scene = content()](const core::Progress& progress) -> JobTracker::Delivery {
        auto picture =
            std::make_shared<core::Picture>(visualization::draw_picture(scene, settings, request, progress));
        return [this, picture] { emit previewDrawn(*picture); };
      },
      [this](const core::Error& error) { emit previewFailed(QString::fromUtf8(error.what())); });
}

void Workbench::warn(const std::vector<core::Warning>& warnings) {
  for (const auto& warning : warnings) {
    Problem problem;
    problem.warning = true;
    problem.code = QString::fromStdString(warning.code);
    problem.text = QString::fromStdString(warning.text);
    emit problemFound(problem);
  }
}

void Workbench::fail(const core::Error& error) {
  Problem problem;
  problem.text = QString::fromUtf8(error.what());
  problem.code = QString::fromStdString(error.code());
  problem.details = QString::fromStdString(error.details());
  if (error.kind() == core::ErrorKind::device) problem.offer = Problem::Offer::reference_device;
  emit problemFound(problem);
}

}  // namespace palpate::gui
