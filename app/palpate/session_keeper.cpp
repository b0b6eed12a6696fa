#include "session_keeper.hpp"

#include "frame_source.hpp"
#include "session_views.hpp"
#include "views/view_grid.hpp"

#include <QDir>
#include <QFileInfo>

#include <utility>

namespace palpate::gui {
namespace {

// Views that turn draw many times a second; the session is compared when there was time.
constexpr int look_delay_ms = 300;
constexpr int autosave_delay_ms = 1500;

// The keeper's own trackers know these kinds of work only.
constexpr JobLane checksum_lane = JobLane::open;
constexpr JobLane save_lane = JobLane::picture;
constexpr JobLane autosave_lane = JobLane::preview;

QString qt_path(const std::filesystem::path& path) {
  return QFile::decodeName(QByteArray::fromStdString(path.string()));
}

QString file_name(const std::filesystem::path& path) { return QFileInfo(qt_path(path)).fileName(); }

}  // namespace

/// A session on its way from the file to the window.
struct SessionKeeper::Opening {
  QString path;
  session::LoadedSession loaded;
  bool lost = false;  ///< it is an autosave that a crash left
};

SessionKeeper::SessionKeeper(Workbench& workbench, ViewState& state, ViewGrid& views,
                             const QString& autosave_folder, QObject* parent)
    : QObject(parent),
      workbench_(workbench),
      state_(state),
      views_(views),
      autosaves_(autosave_folder),
      checksums_(std::make_unique<JobTracker>()),
      jobs_(std::make_unique<JobTracker>()) {
  look_delay_.setSingleShot(true);
  look_delay_.setInterval(look_delay_ms);
  connect(&look_delay_, &QTimer::timeout, this, &SessionKeeper::look_at_change);
  autosave_delay_.setSingleShot(true);
  autosave_delay_.setInterval(autosave_delay_ms);
  connect(&autosave_delay_, &QTimer::timeout, this, &SessionKeeper::autosave);
  lost_ = autosaves_.take_lost();
  watch();
}

SessionKeeper::~SessionKeeper() = default;

void SessionKeeper::watch() {
  connect(&workbench_, &Workbench::volumeOpened, this, &SessionKeeper::take_scan);
  // Not restarted by each change: one that never rests is looked at too.
  const auto look = [this] {
    if (!look_delay_.isActive()) look_delay_.start();
  };
  for (const auto signal :
       {&Workbench::geometryStated, &Workbench::frameShown, &Workbench::volumeFiltered,
        &Workbench::tissueParametersChanged, &Workbench::surfaceSourceChanged, &Workbench::tissueBuilt,
        &Workbench::tissueDropped, &Workbench::simulationSettingsChanged})
    connect(&workbench_, signal, this, look);
  connect(&state_, &ViewState::settingsChanged, this, look);
  connect(&views_, &ViewGrid::layoutChanged, this, look);
  for (int place = 0; place < ViewGrid::count; ++place)
    connect(&views_.view(place), &GlView::rendered, this, look);
}

bool SessionKeeper::is_session(const QString& path) {
  return path.endsWith(QLatin1String(session::session_ending), Qt::CaseInsensitive);
}

bool SessionKeeper::can_save() const {
  return workbench_.has_volume() && workbench_.recipe().input.path.is_absolute();
}

QString SessionKeeper::proposed_file() const {
  if (!file_.isEmpty()) return file_;
  const QFileInfo scan(qt_path(workbench_.recipe().input.path));
  return scan.dir().filePath((scan.isDir() ? scan.fileName() : scan.baseName()) +
                             QLatin1String(session::session_ending));
}

// Another scan is another session, with nothing that was saved.
void SessionKeeper::take_scan() {
  file_.clear();
  changed_ = false;
  saved_text_.clear();
  autosaved_text_.clear();
  checksum_.clear();
  ++scans_;
  look_delay_.start();
  emit titleChanged();
  if (!can_save() || !checksums_) return;
  checksums_->start(
      checksum_lane, QString(),
      [this, path = workbench_.recipe().input.path](const core::Progress& progress) -> JobTracker::Delivery {
        const std::string sum = session::file_sha256(path, progress);
        return [this, sum] {
          checksum_ = sum;
          autosaved_text_.clear();  // it was written without
          look_delay_.start();
        };
      },
      [](const core::Error&) {});  // without it the scan is found again by its name only
}

session::Session SessionKeeper::session_now() const {
  session::Session now;
  now.recipe = workbench_.recipe();
  now.recipe.input.sha256.clear();
  if (workbench_.tissue_frame() >= 0) now.tissue_frame = workbench_.tissue_frame();
  now.views = views_now(views_, state_);
  return now;
}

std::string SessionKeeper::text_now() const { return session::to_json(session_now(), {}); }

void SessionKeeper::look_at_change() {
  if (!can_save()) return;
  const std::string now = text_now();
  if (!file_.isEmpty()) {
    if (saved_text_.empty()) saved_text_ = now;
    if (changed_ != (now != saved_text_)) {
      changed_ = !changed_;
      emit titleChanged();
    }
  }
  if (now != autosaved_text_ && !autosave_delay_.isActive()) autosave_delay_.start();
}

void SessionKeeper::autosave() {
  if (!can_save() || !jobs_) return;
  const QString path = autosaves_.own_file();
  if (path.isEmpty()) return;
  session::Session now = session_now();
  now.recipe.input.sha256 = checksum_;
  if (!file_.isEmpty()) now.saved_as = native_path(file_);
  jobs_->start(
      autosave_lane, QString(),
      [this, now, text = text_now(),
       file = native_path(path)](const core::Progress&) -> JobTracker::Delivery {
        session::save_session(file, now);
        return [this, text] {
          autosaved_text_ = text;
          if (std::exchange(lost_is_back_, false)) discard_lost();
        };
      },
      // The next change tries again; nobody is disturbed over a net that failed.
      [](const core::Error&) {});
}

void SessionKeeper::save(const QString& path) {
  if (!can_save() || !jobs_) return;
  session::Session now = session_now();
  now.recipe.input.sha256 = checksum_;
  jobs_->start(
      save_lane, QString(),
      [this, now, text = text_now(), path,
       scan = scans_](const core::Progress& progress) mutable -> JobTracker::Delivery {
        auto& sum = now.recipe.input.sha256;
        if (sum.empty()) sum = session::file_sha256(now.recipe.input.path, progress);
        session::note_label_checksums(now.recipe);  // as they are now
        session::save_session(native_path(path), now);
        return [this, text, path, scan] {
          if (scan == scans_) {  // else another was opened meanwhile
            file_ = path;
            saved_text_ = text;
            changed_ = text_now() != text;
            emit titleChanged();
          }
          emit saved(path);
        };
      },
      [this](const core::Error& error) { fail(error); });
}

void SessionKeeper::open(const QString& path) { load(QFileInfo(path).absoluteFilePath(), false); }

void SessionKeeper::load(const QString& path, bool lost) {
  workbench_.jobs().start(
      JobLane::open, tr("Opening %1").arg(lost ? tr("what was open") : QFileInfo(path).fileName()),
      [this, path, lost](const core::Progress& progress) -> JobTracker::Delivery {
        auto opening = std::make_shared<Opening>();
        opening->path = path;
        opening->lost = lost;
        opening->loaded = session::load_session(native_path(path));
        const auto found = session::find_input(opening->loaded, progress);
        return [this, opening, found] {
          opening_ = opening;
          go_on(found);
        };
      },
      [this](const core::Error& error) { fail(error); });
}

void SessionKeeper::go_on(const session::FoundInput& found) {
  if (found.state == session::FoundInput::State::same) {
    build(found);
    return;
  }
  const auto& first = opening_->loaded.places.front();
  ScanQuestion question;
  question.state = found.state;
  question.session = opening_->lost ? tr("What was open") : QFileInfo(opening_->path).fileName();
  question.scan = file_name(first);
  question.place = QDir::toNativeSeparators(qt_path(found.path.empty() ? first : found.path));
  emit scanUnclear(question);
}

void SessionKeeper::open_with_scan(const QString& scan, bool changed_too) {
  if (!opening_) return;
  workbench_.jobs().start(
      JobLane::open, tr("Looking at %1").arg(QFileInfo(scan).fileName()),
      [this, opening = opening_, place = native_path(scan),
       changed_too](const core::Progress& progress) -> JobTracker::Delivery {
        session::LoadedSession there = opening->loaded;
        there.places = {place};
        auto found = session::find_input(there, progress);
        if (found.state == session::FoundInput::State::changed && changed_too)
          found.state = session::FoundInput::State::same;
        return [this, opening, there, found] {
          opening->loaded.places = there.places;
          opening_ = opening;
          go_on(found);
        };
      },
      [this](const core::Error& error) { fail(error); });
}

void SessionKeeper::build(const session::FoundInput& found) {
  opening_->loaded.session.recipe.input.path = found.path;
  opening_->loaded.session.recipe.input.sha256 = found.sha256;
  workbench_.open_session(opening_->loaded.session, [this, opening = opening_] {
    opening_ = opening;
    take_opened();
  });
}

// What the workbench made of it stands; now it looks as it did.
void SessionKeeper::take_opened() {
  const auto opening = std::exchange(opening_, nullptr);
  const auto& session = opening->loaded.session;
  show_views(session.views, views_, state_);
  if (checksums_) checksums_->cancel_all();
  checksum_ = session.recipe.input.sha256;
  if (opening->lost) {
    file_ = session.saved_as.empty() ? QString() : qt_path(session.saved_as);
    // It may hold more than the file does.
    changed_ = !file_.isEmpty();
    saved_text_ = changed_ ? "lost" : "";
    lost_is_back_ = true;
    autosave();
  } else {
    file_ = opening->path;
    changed_ = false;
    saved_text_.clear();
  }
  look_delay_.start();
  emit titleChanged();
  emit opened();
}

void SessionKeeper::restore_lost() {
  if (lost_) load(lost_->path, true);
}

void SessionKeeper::discard_lost() {
  autosaves_.remove_lost();
  lost_.reset();
}

void SessionKeeper::end() {
  look_delay_.stop();
  autosave_delay_.stop();
  checksums_.reset();
  jobs_.reset();  // a write that was under way would bring the file back
  autosaves_.release_lost();
  autosaves_.remove_own_file();
}

void SessionKeeper::fail(const core::Error& error) {
  Problem problem;
  problem.text = QString::fromUtf8(error.what());
  problem.code = QString::fromStdString(error.code());
  problem.details = QString::fromStdString(error.details());
  emit problemFound(problem);
}

}  // namespace palpate::gui
