#include "main_window.hpp"

#include "empty_state.hpp"
#include "help_overlay.hpp"
#include "icons.hpp"
#include "job_bar.hpp"
#include "message_bar.hpp"
#include "panels/data_panel.hpp"
#include "panels/filter_panel.hpp"
#include "panels/picture_panel.hpp"
#include "panels/side_panel.hpp"
#include "panels/simulate_panel.hpp"
#include "panels/tissue_panel.hpp"
#include "picture_dialog.hpp"
#include "series_dialog.hpp"
#include "session_keeper.hpp"
#include "status_strip.hpp"
#include "text.hpp"
#include "theme.hpp"
#include "time_bar.hpp"
#include "transport_bar.hpp"
#include "ui_main_window.h"
#include "views/view_grid.hpp"

#include <QActionGroup>
#include <QCloseEvent>
#include <QDir>
#include <QFileDialog>
#include <QFileInfo>
#include <QMessageBox>
#include <QMimeData>
#include <QStandardPaths>

namespace palpate::gui {
namespace {

constexpr int side_width_px = 296;

std::unique_ptr<QSettings> open_settings(const QString& file) {
  if (file.isEmpty()) return std::make_unique<QSettings>();
  return std::make_unique<QSettings>(file, QSettings::IniFormat);
}

}  // namespace

MainWindow::MainWindow(const WindowOptions& options, QWidget* parent)
    : QMainWindow(parent),
      settings_(open_settings(options.settings_file)),
      options_(options),
      scanner_memory_(*settings_),
      ui_(std::make_unique<Ui::MainWindow>()),
      recent_(*settings_) {
  ui_->setupUi(this);
  setAcceptDrops(true);
  workbench_.set_scanner_memory(&scanner_memory_);
  if (const auto mb = settings_->value(QStringLiteral("memory/frames_mb")).toULongLong(); mb > 0)
    workbench_.set_frame_budget(static_cast<std::size_t>(mb) << 20);
  if (!options.device.isEmpty()) workbench_.set_device(options.device);
  build_centre();
  build_side();
  build_tools();
  wire_files();
  wire_views();
  wire_simulation();
  wire_results();
  wire_session();
  keep_keys_for_views();
  refresh_recent();
  refresh_actions();
  restore();
  workbench_.find_devices();
}

MainWindow::~MainWindow() { workbench_.jobs().cancel_all(); }

void MainWindow::build_centre() {
  auto* column = qobject_cast<QVBoxLayout*>(ui_->centralwidget->layout());
  messages_ = new MessageBar(this);
  empty_ = new EmptyState(recent_, this);
  views_ = new ViewGrid(workbench_, state_, this);
  transport_ = new TransportBar(workbench_, this);
  status_ = new StatusStrip(workbench_, this);
  ui_->centre->addWidget(empty_);
  ui_->centre->addWidget(views_);
  column->insertWidget(0, messages_);
  column->addWidget(new JobBar(workbench_.jobs(), this));
  column->addWidget(new TimeBar(workbench_, this));
  column->addWidget(transport_);
  column->addWidget(status_);
  column->setStretchFactor(ui_->centre, 1);
  help_ = new HelpOverlay(ui_->centre);
  transport_->hide();
}

void MainWindow::build_side() {
  side_ = new SidePanel(this);
  auto* scan = new DataPanel(workbench_);
  filter_ = new FilterPanel(workbench_);
  auto* picture = new PicturePanel(workbench_);
  side_->add_step(QStringLiteral("data"), tr("Data"), scan);
  side_->add_step(QStringLiteral("filter"), tr("Filter"), filter_);
  side_->add_step(QStringLiteral("tissue"), tr("Tissue"), new TissuePanel(workbench_));
  side_->add_step(QStringLiteral("simulate"), tr("Simulate"), new SimulatePanel(workbench_));
  side_->add_step(QStringLiteral("picture"), tr("Picture"), picture);
  side_->open_step(steps::data);
  side_->setFixedWidth(side_width_px);
  ui_->sideDock->setWidget(side_);
  ui_->sideDock->setTitleBarWidget(new QWidget(ui_->sideDock));
  connect(scan, &DataPanel::openRequested, ui_->actionOpen, &QAction::trigger);
  connect(scan, &DataPanel::openFolderRequested, ui_->actionOpenFolder, &QAction::trigger);
  connect(scan, &DataPanel::openSampleRequested, ui_->actionOpenSample, &QAction::trigger);
  connect(picture, &PicturePanel::savePictureRequested, ui_->actionSavePicture, &QAction::trigger);
}

void MainWindow::wire_files() {
  connect(ui_->actionOpen, &QAction::triggered, this, &MainWindow::choose_file);
  connect(ui_->actionOpenFolder, &QAction::triggered, this, &MainWindow::choose_folder);
  connect(ui_->actionOpenSample, &QAction::triggered, this, &MainWindow::open_sample);
  connect(ui_->actionSavePicture, &QAction::triggered, this, &MainWindow::choose_picture);
  connect(ui_->actionQuit, &QAction::triggered, this, &QWidget::close);
  connect(empty_, &EmptyState::openRequested, ui_->actionOpen, &QAction::trigger);
  connect(empty_, &EmptyState::openFolderRequested, ui_->actionOpenFolder, &QAction::trigger);
  connect(empty_, &EmptyState::openSampleRequested, ui_->actionOpenSample, &QAction::trigger);
  connect(empty_, &EmptyState::recentRequested, this, &MainWindow::open);
  connect(&recent_, &RecentFiles::changed, this, &MainWindow::refresh_recent);
  connect(&workbench_, &Workbench::seriesFound, this, &MainWindow::choose_series);
}

void MainWindow::wire_views() {
  connect(ui_->actionMaximise, &QAction::triggered, this,
          [this] { views_->toggle_maximised(views_->active_place()); });
  connect(ui_->actionFitView, &QAction::triggered, this,
          [this] { views_->view(views_->active_place()).fit(); });
  connect(ui_->actionResetViews, &QAction::triggered, views_, &ViewGrid::reset_views);
  connect(ui_->actionFullScreen, &QAction::toggled, this,
          [this](bool on) { on ? showFullScreen() : showNormal(); });
  connect(ui_->actionKeys, &QAction::triggered, this, &MainWindow::toggle_help);
  connect(ui_->actionAbout, &QAction::triggered, this, &MainWindow::show_about);
  connect(views_, &ViewGrid::hovered, transport_, &TransportBar::show_cursor);
  connect(status_, &StatusStrip::placeRequested, this, [this](double x_mm, double y_mm, double z_mm) {
    state_.set_crosshair({x_mm, y_mm, z_mm});
  });
  connect(&workbench_, &Workbench::limitShown, this, [this] {
    const auto place = workbench_.limiting_place_mm();
    if (workbench_.limiting_point_shown() && place) state_.set_crosshair(*place);
  });
  status_->watch([this] { return views_->frames_per_second(); },
                 [this] { return views_->tissue_view().renderer_name(); });
}

void MainWindow::wire_simulation() {
  connect(ui_->actionBuild, &QAction::triggered, &workbench_, &Workbench::build_tissue);
  connect(ui_->actionPlayPause, &QAction::triggered, this,
          [this] { workbench_.playing() ? workbench_.pause() : workbench_.play(); });
  connect(ui_->actionStep, &QAction::triggered, &workbench_, &Workbench::step_once);
  connect(ui_->actionReset, &QAction::triggered, &workbench_, &Workbench::reset);
  connect(ui_->actionUndo, &QAction::triggered, &workbench_, &Workbench::undo);
  connect(ui_->actionRedo, &QAction::triggered, &workbench_, &Workbench::redo);
  for (const auto signal :
       {&Workbench::volumeOpened, &Workbench::tissueBuilt, &Workbench::tissueDropped,
        &Workbench::simulationStarted, &Workbench::simulationReady, &Workbench::simulationStopped,
        &Workbench::anchorsChanged, &Workbench::frameArrived}) {
    connect(&workbench_, signal, this, &MainWindow::refresh_actions);
  }
}

// What a finished hop says in the side panel, and which step comes next.
void MainWindow::wire_results() {
  connect(&workbench_, &Workbench::problemFound, messages_, &MessageBar::show_problem);
  connect(messages_, &MessageBar::referenceRequested, this,
          [this] { workbench_.go_on_with(QStringLiteral("reference")); });
  connect(messages_, &MessageBar::deviceRequested, &workbench_, &Workbench::go_on_with);
  connect(&workbench_, &Workbench::volumeOpened, this, [this] {
    messages_->hide();
    ui_->centre->setCurrentWidget(views_);
    transport_->show();
    show_title();
    show_data_result();
    for (const int step : {steps::filter, steps::tissue, steps::simulate, steps::picture}) {
      side_->header(step).set_result({}, false);
    }
    side_->open_step(steps::filter);
    const QFileInfo file(QString::fromStdString(workbench_.recipe().input.path.string()));
    if (file.exists() && file != QFileInfo(options_.sample_file)) recent_.add(file.absoluteFilePath());
  });
  connect(&workbench_, &Workbench::geometryStated, this, &MainWindow::show_data_result);
  connect(&workbench_, &Workbench::orientationRemembered, this, &MainWindow::tell_orientation);
  connect(&workbench_, &Workbench::volumeFiltered, this, [this] {
    const bool any = workbench_.is_filtered();
    side_->header(steps::filter).set_result(any ? filter_->result() : QString(), any);
    refresh_actions();
  });
  connect(&workbench_, &Workbench::filtersApplied, this, [this] {
    side_->header(steps::filter).set_result(filter_->result(), true);
    side_->open_step(steps::tissue);
    refresh_actions();
  });
  connect(&workbench_, &Workbench::tissueDropped, this, [this] {
    for (const int step : {steps::tissue, steps::simulate}) side_->header(step).set_result({}, false);
  });
  connect(&workbench_, &Workbench::tissueBuilt, this, [this] {
    const auto& statistics = workbench_.tissue()->statistics;
    if (!side_->header(steps::filter).done())
      side_->header(steps::filter).set_result(filter_->result(), true);
    side_->header(steps::tissue)
        .set_result(tr("%1 points · %2 links")
                        .arg(short_count(static_cast<double>(statistics.points)),
                             short_count(static_cast<double>(statistics.links))),
                    true);
    side_->header(steps::simulate).set_result({}, false);
    side_->open_step(steps::simulate);
  });
  connect(&workbench_, &Workbench::frameArrived, this, [this] {
    const auto& frame = *workbench_.last_frame();
    auto& header = side_->header(steps::simulate);
    if (frame.time_s <= 0.0) return;
    const QString moved =
        tr("moved up to %1").arg(describe_length(frame.max_displacement_mm, workbench_.info()));
    if (!header.done() || header.result() != moved) header.set_result(moved, true);
  });
  connect(&workbench_, &Workbench::pictureSaved, this, [this](const QString& path) {
    side_->header(steps::picture).set_result(QFileInfo(path).fileName(), true);
    messages_->show_info(tr("The picture is saved as %1.").arg(QDir::toNativeSeparators(path)));
  });
}

void MainWindow::open(const QString& path) {
  if (SessionKeeper::is_session(path)) {
    session_->open(path);
  } else {
    workbench_.open(path);
  }
}

void MainWindow::open_sample() { workbench_.open_sample(options_.sample_file); }

void MainWindow::choose_file() {
  const QString path = QFileDialog::getOpenFileName(
      this, tr("Open scan"), settings_->value(QStringLiteral("folders/open")).toString(),
      tr("Scans (*.mha *.mhd *.nrrd *.nhdr *.nii *.nii.gz *.dcm *.ima);;All files (*)"));
  if (path.isEmpty()) return;
  settings_->setValue(QStringLiteral("folders/open"), QFileInfo(path).absolutePath());
  open(path);
}

void MainWindow::choose_folder() {
  const QString path = QFileDialog::getExistingDirectory(
      this, tr("Open folder"), settings_->value(QStringLiteral("folders/open")).toString());
  if (path.isEmpty()) return;
  settings_->setValue(QStringLiteral("folders/open"), path);
  open(path);
}

void MainWindow::choose_series(const QString&, const std::vector<imaging::SeriesSummary>& series) {
  auto* dialog = new SeriesDialog(series, this);
  connect(dialog, &SeriesDialog::seriesChosen, this,
          [this](const QString& path, const QString& uid) { workbench_.open(path, uid.toStdString()); });
  dialog->open();
}

void MainWindow::show_data_result() {
  side_->header(steps::data)
      .set_result(QStringLiteral("%1 · %2").arg(workbench_.input_name(), describe_volume(workbench_.info())),
                  true);
}

void MainWindow::tell_orientation(const QString& orientation) {
  messages_->show_info(tr("%1 was taken as the orientation, as you chose last time for %2.")
                           .arg(orientation, QString::fromStdString(workbench_.info().scanner)),
                       tr("As the file says"),
                       [this] { workbench_.state_orientation(QStringLiteral("file")); });
}

void MainWindow::choose_picture() {
  if (!workbench_.has_volume()) return;
  const QString pictures = QStandardPaths::writableLocation(QStandardPaths::PicturesLocation);
  QString folder = settings_->value(QStringLiteral("folders/pictures"), pictures).toString();
  if (!QDir(folder).exists()) folder = QDir::homePath();
  auto* dialog = new PictureDialog(workbench_, views_->picture_settings(), folder, this);
  connect(dialog, &PictureDialog::saveRequested, this,
          [this](const QString& path, const visualization::ViewSettings& settings,
                 const visualization::PictureRequest& request) {
            settings_->setValue(QStringLiteral("folders/pictures"), QFileInfo(path).absolutePath());
            workbench_.save_picture(path, settings, request);
          });
  dialog->open();
}

}  // namespace palpate::gui
