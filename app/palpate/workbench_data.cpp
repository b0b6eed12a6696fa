// The half of the workbench that opens scans and shows their frames.
#include "opened_scan.hpp"
#include "scanner_memory.hpp"
#include "stated_geometry.hpp"
#include "text.hpp"
#include "workbench.hpp"

#include "palpate/imaging/frame_store.hpp"
#include "palpate/imaging/phantom.hpp"

#include <QDir>
#include <QFile>
#include <QFileInfo>

#include <algorithm>
#include <limits>
#include <unistd.h>

namespace palpate::gui {

namespace {

// A folder may still hold something to choose where it cannot be read as one scan.
bool may_hold_series(const core::Error& error) {
  for (const char* code : {"several-series", "no-image", "no-volume", "unsupported"})
    if (error.code() == code) return true;
  return false;
}

}  // namespace

imaging::ReadOptions file_options(const session::InputSettings& input) {
  // Spacing and orientation of the user are laid over what the file says.
  imaging::ReadOptions options;
  options.series_uid = input.series_uid;
  options.frame = input.frame;
  options.grid_spacing_mm = input.grid_spacing_mm;
  options.allow_truncated = input.allow_truncated;
  return options;
}

std::size_t standard_frame_budget() {
  constexpr std::size_t most = std::size_t{4} << 30;
  const long pages = sysconf(_SC_PHYS_PAGES);
  const long page_bytes = sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || page_bytes <= 0) return std::size_t{1} << 30;
  return std::min(most, static_cast<std::size_t>(pages) * static_cast<std::size_t>(page_bytes) / 4);
}

std::filesystem::path native_path(const QString& path) {
  return std::filesystem::path(QFile::encodeName(path).toStdString());
}

void Workbench::open(const QString& path, const std::string& series_uid) {
  session::InputSettings input;
  input.path = native_path(QDir(path).absolutePath());
  input.series_uid = series_uid;
  open(input);
}

void Workbench::open(const session::InputSettings& input) {
  const QString name = QFileInfo(QString::fromStdString(input.path.string())).fileName();
  jobs_.start(
      JobLane::open, tr("Reading %1").arg(name),
      [this, input,
       budget_bytes = frame_budget_bytes_](const core::Progress& progress) -> JobTracker::Delivery {
        auto scan = std::make_shared<OpenedScan>();
        scan->input = input;
        const auto store = std::make_shared<imaging::FrameStore>(input.path, file_options(input),
                                                                 budget_bytes, progress.part(0.0, 0.95));
        scan->info = store->info();
        scan->volume = store->frame(input.frame, progress.part(0.95, 1.0));
        scan->frames = [store](int frame, const core::Progress& frame_progress) {
          return store->frame(frame, frame_progress);
        };
        return [this, scan] { take_scan(std::move(*scan)); };
      },
      [this, input](const core::Error& error) {
        const bool folder = QFileInfo(QString::fromStdString(input.path.string())).isDir();
        if (input.series_uid.empty() && folder && may_hold_series(error)) {
          list_series(input, error);
        } else {
          fail(error);
        }
      });
}

void Workbench::open_sample(const QString& path) {
  if (!path.isEmpty() && QFileInfo::exists(path)) {
    open(path);
    return;
  }
  jobs_.start(
      JobLane::open, tr("Making the sample heart"),
      [this](const core::Progress& progress) -> JobTracker::Delivery {
        const imaging::Phantom phantom = imaging::make_phantom({}, progress);
        auto scan = std::make_shared<OpenedScan>();
        scan->input.path = "sample-heart";
        scan->volume = phantom.frames.front();
        scan->info.format = "Palpate sample";
        scan->info.geometry = scan->volume.geometry();
        scan->info.pixel_type = "uint8";
        scan->info.spacing_provenance.fill(core::Provenance::stated);
        scan->info.origin_provenance = core::Provenance::stated;
        scan->info.direction_provenance = core::Provenance::stated;
        scan->info.patient_axes = true;
        scan->frames = [volume = scan->volume](int, const core::Progress&) { return volume; };
        return [this, scan] { take_scan(std::move(*scan)); };
      },
      [this](const core::Error& error) { fail(error); });
}

void Workbench::list_series(const session::InputSettings& input, const core::Error& why) {
  const QString path = QString::fromStdString(input.path.string());
  jobs_.start(
      JobLane::open, tr("Looking through %1").arg(QFileInfo(path).fileName()),
      [this, path, why](const core::Progress& progress) -> JobTracker::Delivery {
        const auto series = std::make_shared<std::vector<imaging::SeriesSummary>>(
            imaging::list_series(native_path(path), progress));
        return [this, path, series, why] {
          const bool any = std::any_of(series->begin(), series->end(),
                                       [](const auto& one) { return one.error_code.empty(); });
          if (any || (why.code() == "several-series" && !series->empty())) {
            emit seriesFound(path, *series);
          } else {
            fail(why);
          }
        };
      },
      [this](const core::Error& error) { fail(error); });
}

// The scan that was open stays until the new one is there: a bad file costs nothing.
void Workbench::take_scan(OpenedScan scan) {
  for (const auto lane : {JobLane::filter, JobLane::frame, JobLane::mask, JobLane::anchors})
    jobs_.cancel_lane(lane);
  frame_jobs_.cancel_all();
  wanted_frame_.reset();
  scan_playing_ = false;
  rest_delay_.stop();
  drop_tissue();
  remembered_ = false;
  if (scan_memory_applies(scan.info, scan.input.orientation)) {
    scan.input.orientation = scanner_memory_->orientation(scan.info).toStdString();
    remembered_ = true;
  }
  recipe_.input = std::move(scan.input);
  recipe_.filters.clear();
  recipe_.tissue.threshold_low.reset();
  recipe_.tissue.threshold_high = std::numeric_limits<double>::infinity();
  recipe_.tissue.crop.reset();
  recipe_.surface.mesh.reset();  // it lies where the scan before lay
  recipe_.mask = {};
  recipe_.simulation.anchors = {};
  file_info_ = std::move(scan.info);
  info_ = restated(file_info_, recipe_.input.spacing_mm, recipe_.input.orientation);
  frames_ = std::move(scan.frames);
  volume_ = laid_out(scan.volume, info_.geometry);
  filtered_ = volume_;
  filtered_frames_.clear();
  filtered_frames_.set_budget(frame_budget_bytes_ / 2);
  emit volumeOpened();
  emit tissueParametersChanged();
  emit surfaceSourceChanged();
  emit simulationSettingsChanged();
  if (remembered_) emit orientationRemembered(QString::fromStdString(recipe_.input.orientation));
  start_estimate();
}

bool Workbench::scan_memory_applies(const core::VolumeInfo& info, const std::string& orientation) const {
  return scanner_memory_ != nullptr && orientation.empty() && ScannerMemory::is_open_question(info) &&
         !scanner_memory_->orientation(info).isEmpty();
}

void Workbench::state_spacing(const std::optional<std::array<double, 3>>& spacing_mm) {
  if (!has_volume() || recipe_.input.spacing_mm == spacing_mm) return;
  recipe_.input.spacing_mm = spacing_mm;
  restate();
}

void Workbench::state_orientation(const QString& orientation) {
  if (!has_volume()) return;
  remembered_ = false;
  if (scanner_memory_ != nullptr && ScannerMemory::is_open_question(file_info_)) {
    if (is_orientation(orientation)) {
      scanner_memory_->remember(file_info_, orientation);
    } else {
      scanner_memory_->forget(file_info_);
    }
  }
  recipe_.input.orientation = is_orientation(orientation) ? orientation.toStdString() : "file";
  restate();
}

void Workbench::restate() {
  frame_jobs_.cancel_all();
  wanted_frame_.reset();
  for (const auto lane : {JobLane::filter, JobLane::frame}) jobs_.cancel_lane(lane);
  drop_tissue();
  recipe_.simulation.anchors.painted.clear();  // by places that are others now
  info_ = restated(file_info_, recipe_.input.spacing_mm, recipe_.input.orientation);
  volume_ = laid_out(volume_, info_.geometry);
  filtered_ = volume_;  // what was filtered may hang on the spacing
  filtered_frames_.clear();
  emit geometryStated();
  emit frameShown();
  rest_at_frame();
}

bool Workbench::frame_is_filtered() const {
  return recipe_.filters.empty() || filtered_.data() != volume_.data();
}

void Workbench::show_frame(int frame) {
  if (!has_volume()) return;
  const int wanted = std::clamp(frame, 0, info_.frames - 1);
  if (wanted == wanted_frame()) return;
  wanted_frame_ = wanted;
  emit frameWanted();
  if (!frame_jobs_.busy(JobLane::frame)) load_wanted_frame();
}

// One at a time, and then the newest: a slider that is dragged asks for many.
void Workbench::load_wanted_frame() {
  frame_jobs_.start(
      JobLane::frame, QString(),
      [this, frame = *wanted_frame_, frames = frames_,
       geometry = info_.geometry](const core::Progress& progress) -> JobTracker::Delivery {
        const core::Volume volume = laid_out(frames(frame, progress), geometry);
        return [this, frame, volume] { take_scan_frame(frame, volume); };
      },
      [this](const core::Error& error) {
        wanted_frame_.reset();
        scan_playing_ = false;
        fail(error);
        emit frameShown();
      });
}

void Workbench::take_scan_frame(int frame, const core::Volume& volume) {
  jobs_.cancel_lane(JobLane::frame);
  if (!recipe_.filters.empty() && frame_is_filtered())
    filtered_frames_.put(recipe_.filters, this->frame(), filtered_);
  recipe_.input.frame = frame;
  volume_ = volume;
  filtered_ =
      recipe_.filters.empty() ? volume_ : filtered_frames_.find(recipe_.filters, frame).value_or(volume_);
  if (wanted_frame_ == frame) wanted_frame_.reset();
  emit frameShown();
  rest_delay_.start();
  if (wanted_frame_) load_wanted_frame();
}

void Workbench::set_scan_playing(bool playing) {
  if (scan_playing_ == playing) return;
  scan_playing_ = playing;
  if (!playing) rest_delay_.start();
}

void Workbench::rest_at_frame() {
  if (scan_playing_ || !has_volume()) return;
  if (!frame_is_filtered()) filter_frame();
  start_estimate();
}

void Workbench::filter_frame() {
  const QString title = info_.frames > 1 ? tr("Filtering frame %1").arg(frame() + 1) : tr("Filtering");
  jobs_.start(
      JobLane::frame, title,
      [this, source = volume_, chain = recipe_.filters, options = filter_options(),
       frame = this->frame()](const core::Progress& progress) -> JobTracker::Delivery {
        const core::Volume filtered = session::filter_volume(source, chain, options, progress).volume;
        return [this, source, chain, frame, filtered] {
          if (source.data() != volume_.data() || !(chain == recipe_.filters)) return;
          filtered_ = filtered;
          filtered_frames_.put(chain, frame, filtered);
          emit frameShown();
          start_estimate();
        };
      },
      [this](const core::Error& error) { fail(error); });
}

}  // namespace palpate::gui
