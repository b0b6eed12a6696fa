#include "workbench.hpp"

#include "text.hpp"

#include "palpate/imaging/phantom.hpp"

#include <QDir>
#include <QFileInfo>

#include <filesystem>

namespace palpate::gui {
namespace {

// A slider that is dragged changes its value many times; one estimate when it rests.
constexpr int estimate_delay_ms = 150;

std::filesystem::path native(const QString& path) {
  return std::filesystem::path(QFile::encodeName(path).toStdString());
}

core::VolumeSequence make_sample(const core::Progress& progress) {
  imaging::Phantom phantom = imaging::make_phantom({}, progress);
  core::VolumeSequence sequence;
  sequence.info.format = "Palpate sample";
  sequence.info.geometry = phantom.frames.front().geometry();
  sequence.info.pixel_type = "uint8";
  sequence.info.spacing_provenance.fill(core::Provenance::stated);
  sequence.info.origin_provenance = core::Provenance::stated;
  sequence.info.direction_provenance = core::Provenance::stated;
  sequence.info.patient_axes = true;
  sequence.frames.push_back(phantom.frames.front());
  return sequence;
}

}  // namespace

Workbench::Workbench(QObject* parent) : QObject(parent) {
  recipe_.tissue.min_component = 100;  // specks of an echo are not tissue that anyone pulls
  estimate_delay_.setSingleShot(true);
  estimate_delay_.setInterval(estimate_delay_ms);
  connect(&estimate_delay_, &QTimer::timeout, this, &Workbench::run_estimate);
  frame_delay_.setSingleShot(true);
  frame_delay_.setTimerType(Qt::PreciseTimer);
  connect(&frame_delay_, &QTimer::timeout, this, &Workbench::take_frame);
}

Workbench::~Workbench() {
  jobs_.cancel_all();
  stop_driver();
  retired_.clear();  // waits for them: they speak to this object
}

QString Workbench::input_name() const {
  return QFileInfo(QString::fromStdString(recipe_.input.path.string())).fileName();
}

visualization::SceneContent Workbench::content() const {
  visualization::SceneContent content;
  content.volume = filtered_;
  content.spacing_assumed = info_.spacing_is_assumed();
  content.spacing_badge = core::to_string(info_.spacing_provenance[0]);
  content.orientation_known = info_.patient_axes;
  content.mesh = surface_.mesh;
  if (built_) content.tissue = built_->tissue;
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

void Workbench::open(const QString& path, const std::string& series_uid) {
  session::InputSettings input;
  input.path = native(QDir(path).absolutePath());
  input.series_uid = series_uid;
  read(input, tr("Reading %1").arg(QFileInfo(path).fileName()));
}

void Workbench::open_sample(const QString& path) {
  if (!path.isEmpty() && QFileInfo::exists(path)) {
    open(path);
    return;
  }
  jobs_.start(
      JobLane::open, tr("Making the sample heart"),
      [this](const core::Progress& progress) -> JobTracker::Delivery {
        auto sequence = std::make_shared<core::VolumeSequence>(make_sample(progress));
        session::InputSettings input;
        input.path = "sample-heart";
        return [this, sequence, input] { take_volume(std::move(*sequence), input); };
      },
      [this](const core::Error& error) { fail(error); });
}

void Workbench::reopen(int frame, const std::optional<std::array<double, 3>>& spacing_mm) {
  session::InputSettings input = recipe_.input;
  input.frame = frame;
  input.spacing_mm = spacing_mm;
  read(input, tr("Reading %1 again").arg(input_name()));
}

void Workbench::read(const session::InputSettings& input, const QString& title) {
  jobs_.start(
      JobLane::open, title,
      [this, input](const core::Progress& progress) -> JobTracker::Delivery {
        auto sequence = std::make_shared<core::VolumeSequence>(session::read_input(input, progress));
        return [this, sequence, input] { take_volume(std::move(*sequence), input); };
      },
      [this, input](const core::Error& error) {
        if (error.code() == "several-series" && input.series_uid.empty()) {
          list_series(QString::fromStdString(input.path.string()));
        } else {
          fail(error);
        }
      });
}

void Workbench::list_series(const QString& path) {
  jobs_.start(
      JobLane::open, tr("Looking through %1").arg(QFileInfo(path).fileName()),
      [this, path](const core::Progress& progress) -> JobTracker::Delivery {
        const auto reports = imaging::inspect({native(path)}, {}, progress);
        QVector<SeriesChoice> series;
        for (const auto& report : reports) {
          for (const auto& volume : report.volumes) {
            if (volume.series_uid.empty()) continue;
            series.append({QString::fromStdString(volume.series_uid), describe_series(volume)});
          }
        }
        return [this, path, series] { emit seriesFound(path, series); };
      },
      [this](const core::Error& error) { fail(error); });
}

// The scan that was open stays until the new one is there: a bad file costs nothing.
void Workbench::take_volume(core::VolumeSequence sequence, const session::InputSettings& input) {
  if (sequence.frames.empty()) {
    fail(core::Error(core::ErrorKind::input, "no-image", "This file holds no image."));
    return;
  }
  jobs_.cancel_lane(JobLane::filter);
  drop_tissue();
  recipe_.input = input;
  recipe_.filters.clear();
  recipe_.tissue.threshold_low.reset();
  recipe_.tissue.threshold_high = std::numeric_limits<double>::infinity();
  recipe_.tissue.crop.reset();
  recipe_.surface.mesh.reset();  // it lies where the scan before lay
  info_ = std::move(sequence.info);
  volume_ = sequence.frames.front();
  filtered_ = volume_;
  emit volumeOpened();
  emit tissueParametersChanged();
  emit surfaceSourceChanged();
  start_estimate();
}

void Workbench::apply_filters(const std::vector<imaging::FilterStep>& chain) {
  if (!has_volume()) return;
  const auto take = [this, chain](const core::Volume& filtered) {
    recipe_.filters = chain;
    filtered_ = filtered;
    drop_tissue();
    emit volumeFiltered();
    start_estimate();
  };
  if (chain.empty()) {
    jobs_.cancel_lane(JobLane::filter);
    take(volume_);
    return;
  }
  const core::Volume source = volume_;
  jobs_.start(
      JobLane::filter, tr("Filtering"),
      [source, chain, take](const core::Progress& progress) -> JobTracker::Delivery {
        core::Volume filtered = session::filter_volume(source, chain, {}, progress).volume;
        return [take, filtered] { take(filtered); };
      },
      [this](const core::Error& error) { fail(error); });
}

void Workbench::drop_tissue() {
  jobs_.cancel_lane(JobLane::tissue);
  stop_driver();
  const bool had = built_.has_value();
  built_.reset();
  surface_ = {};
  if (had) emit tissueDropped();
}

void Workbench::set_tissue_parameters(const model::TissueParameters& parameters) {
  recipe_.tissue = parameters;
  emit tissueParametersChanged();
  start_estimate();
}

void Workbench::set_face_budget(int faces) { recipe_.surface.face_budget = faces; }

void Workbench::set_surface_mesh(const QString& path, surface::MeshSpace space) {
  recipe_.surface.mesh.reset();
  if (!path.isEmpty()) recipe_.surface.mesh = native(path);
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
  jobs_.start(
      JobLane::tissue, tr("Building tissue"),
      [this, volume = filtered_, recipe = recipe_](const core::Progress& progress) -> JobTracker::Delivery {
        auto built = std::make_shared<session::BuiltTissue>(
            session::build_tissue(volume, recipe, progress.part(0.0, 0.6)));
        auto surface = std::make_shared<session::BoundSurface>(
            session::build_surface(volume, *built, recipe, progress.part(0.6, 1.0)));
        return [this, built, surface] {
          stop_driver();
          built_ = std::move(*built);
          surface_ = std::move(*surface);
          emit tissueBuilt();
          start_driver();
        };
      },
      [this](const core::Error& error) { fail(error); });
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
        visualization::save_png(native(path), picture);
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

void Workbench::fail(const core::Error& error) {
  Problem problem;
  problem.text = QString::fromUtf8(error.what());
  problem.code = QString::fromStdString(error.code());
  problem.details = QString::fromStdString(error.details());
  if (error.kind() == core::ErrorKind::device) problem.offer = Problem::Offer::reference_device;
  emit problemFound(problem);
}

}  // namespace palpate::gui
