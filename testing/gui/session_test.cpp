#include "session_keeper.hpp"
#include "session_views.hpp"
#include "window_fixture.hpp"

#include "palpate/imaging/writer.hpp"

#include <QAbstractButton>
#include <QDialog>
#include <QDir>
#include <QFile>
#include <QFrame>
#include <QLabel>
#include <QProcess>
#include <QSignalSpy>

#include <filesystem>

namespace palpate::testing {
namespace {

namespace fs = std::filesystem;
using gui::SessionKeeper;

class Sessions : public WindowTest {
 protected:
  void SetUp() override { make_window(); }
  SessionKeeper& session() { return window().session(); }
  QString path(const char* name) const { return QString::fromStdString((folder() / name).string()); }
  QString message() {
    return find<QFrame>("messageBar").isVisible() ? find<QLabel>("messageText").text() : QString();
  }
  QStringList autosaves() const {
    return QDir(path("autosave")).entryList({QStringLiteral("*.palpate.json")}, QDir::Files);
  }
  void open_scan(const QString& scan) {
    QSignalSpy opened(&workbench(), &gui::Workbench::volumeOpened);
    window().open(scan);
    ASSERT_TRUE(wait_for([&] { return !opened.isEmpty(); }));
  }
  void save(const QString& file) {
    QSignalSpy saved(&session(), &SessionKeeper::saved);
    const QSignalSpy failed(&session(), &SessionKeeper::problemFound);
    session().save(file);
    ASSERT_TRUE(wait_for([&] { return !saved.isEmpty() || !failed.isEmpty(); }));
    ASSERT_EQ(saved.count(), 1) << message().toStdString();
  }
  void open_session(const QString& file) {
    QSignalSpy opened(&session(), &SessionKeeper::opened);
    window().open(file);
    ASSERT_TRUE(wait_for([&] { return !opened.isEmpty() || !message().isEmpty(); }, 60000));
    ASSERT_EQ(opened.count(), 1) << message().toStdString();
  }
  /// What the file says of the recipe and the views, without its places.
  std::string now() {
    session::Session session;
    session.recipe = workbench().recipe();
    session.recipe.input.path = "/scan";
    session.recipe.input.sha256.clear();
    session.views = gui::views_now(window().views(), window().view_state());
    return session::to_json(session, {});
  }
  void filter(const char* step) {
    QSignalSpy filtered(&workbench(), &gui::Workbench::volumeFiltered);
    workbench().apply_filters({imaging::parse_filter(step)});
    ASSERT_TRUE(wait_for([&] { return !filtered.isEmpty(); }));
  }
  /// Far from what a newly opened scan looks like.
  void set_everything() {
    workbench().state_spacing(std::array<double, 3>{3.0, 3.5, 4.0});
    workbench().state_orientation("RAS");
    filter("median:radius=1");
    auto tissue = workbench().recipe().tissue;
    tissue.stride = 2;
    tissue.seed = 5;
    tissue.min_component = 10;
    workbench().set_tissue_parameters(tissue);
    auto simulation = workbench().recipe().simulation;
    simulation.parameters.stiffness_per_s2 *= 0.5;
    workbench().set_simulation(simulation);
    workbench().set_face_budget(4321);
    build_tissue();
    window().views().set_layout(gui::ViewLayout::three_d_large);
    auto& state = window().view_state();
    state.set_crosshair(workbench().volume().geometry().to_lps_mm({5, 6, 7}));
    state.set_window_level(77.0, 33.0);
    state.set_show(visualization::Show::points);
    auto& axial = static_cast<gui::SliceWidget&>(window().views().view(gui::ViewGrid::axial));
    axial.set_framing({250.0, workbench().volume().geometry().to_lps_mm({4, 9, 7})});
    auto camera = window().views().tissue_view().camera();
    camera.position_mm = camera.focal_point_mm + Eigen::Vector3d(200.0, 100.0, 50.0);
    window().views().tissue_view().set_camera(camera);
    window().views().toggle_maximised(gui::ViewGrid::sagittal);
  }
};

TEST_F(Sessions, EverythingComesBackInANewWindow) {
  open_scan(sample_path());
  set_everything();
  const auto points = workbench().tissue()->statistics.points;
  save(path("mine.palpate.json"));
  const std::string before = now();
  EXPECT_EQ(window().windowTitle(), QStringLiteral("mine[*] – Palpate"));
  EXPECT_FALSE(window().isWindowModified());
  EXPECT_EQ(window().recent_files().paths().front(), path("mine.palpate.json"));
  close_window();
  make_window();
  open_session(path("mine.palpate.json"));
  ASSERT_TRUE(wait_for([this] { return workbench().simulation_ready(); }, 60000));
  EXPECT_EQ(now(), before);
  EXPECT_EQ(workbench().tissue()->statistics.points, points);
  EXPECT_TRUE(workbench().frame_is_filtered());
  EXPECT_EQ(workbench().info().spacing_provenance[0], core::Provenance::user);
  EXPECT_EQ(window().windowTitle(), QStringLiteral("mine[*] – Palpate"));
}

TEST_F(Sessions, TheTitleMarksWhatChangedSince) {
  open_scan(sample_path());
  EXPECT_FALSE(window().isWindowModified()) << "a scan that was never saved differs from nothing";
  save(path("mine.palpate.json"));
  EXPECT_FALSE(window().isWindowModified());
  window().view_state().set_window_level(50.0, 20.0);
  ASSERT_TRUE(wait_for([this] { return window().isWindowModified(); }));
  save(path("mine.palpate.json"));
  EXPECT_FALSE(window().isWindowModified());
  // Another scan is another session.
  open_scan(noise_volume("other.mha", 12));
  EXPECT_EQ(window().windowTitle(), QStringLiteral("other.mha[*] – Palpate"));
  EXPECT_TRUE(session().file().isEmpty());
}

TEST_F(Sessions, AFileThatIsNoSessionCostsNothing) {
  open_scan(sample_path());
  filter("median:radius=1");
  const std::string before = now();
  const auto refused = [&](const QByteArray& text) {
    QFile file(path("bad.palpate.json"));
    ASSERT_TRUE(file.open(QIODevice::WriteOnly | QIODevice::Truncate));
    file.write(text);
    file.close();
    window().open(file.fileName());
    ASSERT_TRUE(wait_for([this] { return !message().isEmpty(); }));
    EXPECT_TRUE(message().contains(QStringLiteral("bad.palpate.json"))) << message().toStdString();
    EXPECT_EQ(now(), before);
    click("messageClose");
  };
  refused("{\"kind\": \"palpate-session\", \"version\": 99}");
  refused("{\"kind\": \"palp");
  EXPECT_EQ(workbench().input_name(), "sample heart.mha");
}

// The recipe is whole and yet cannot be made: nothing of it is taken.
TEST_F(Sessions, ASessionThatCannotBeMadeCostsNothing) {
  open_scan(sample_path());
  build_tissue();
  session::Session session;
  session.recipe = workbench().recipe();
  session.recipe.tissue.threshold_low = 1e9;  // no voxel is tissue
  session.tissue_frame = 0;
  session::save_session(folder() / "empty.palpate.json", session);
  const std::string before = now();
  window().open(path("empty.palpate.json"));
  ASSERT_TRUE(wait_for([this] { return !message().isEmpty(); }));
  EXPECT_EQ(now(), before);
  EXPECT_TRUE(workbench().has_tissue());
}

TEST_F(Sessions, AScanThatMovedIsAskedFor) {
  const QString scan = noise_volume("scan.mha", 12);
  open_scan(scan);
  filter("median:radius=1");
  save(path("mine.palpate.json"));
  close_window();
  fs::create_directory(folder() / "archive");
  fs::rename(folder() / "scan.mha", folder() / "archive" / fs::path("other name.mha"));
  make_window();
  window().open(path("mine.palpate.json"));
  ASSERT_TRUE(wait_for([this] { return window().findChild<QDialog*>("sessionDialog") != nullptr; }));
  EXPECT_TRUE(find<QLabel>("sessionQuestion").text().contains(QStringLiteral("scan.mha")));
  EXPECT_EQ(window().findChild<QAbstractButton*>("openAnywayButton"), nullptr) << "there is nothing to open";
  click("cancelSessionButton");
  EXPECT_FALSE(workbench().has_volume());
  QSignalSpy opened(&session(), &SessionKeeper::opened);
  session().open_with_scan(path("archive/other name.mha"), false);
  ASSERT_TRUE(wait_for([&] { return !opened.isEmpty(); }));
  EXPECT_EQ(workbench().input_name(), "other name.mha");
  EXPECT_EQ(workbench().recipe().filters.size(), 1U);
}

TEST_F(Sessions, AScanThatChangedIsAskedAbout) {
  open_scan(noise_volume("scan.mha", 12));
  save(path("mine.palpate.json"));
  close_window();
  noise_volume("scan.mha", 14);
  make_window();
  window().open(path("mine.palpate.json"));
  ASSERT_TRUE(wait_for([this] { return window().findChild<QDialog*>("sessionDialog") != nullptr; }));
  EXPECT_TRUE(find<QLabel>("sessionQuestion").text().contains(QStringLiteral("checksum")));
  EXPECT_FALSE(workbench().has_volume());
  QSignalSpy opened(&session(), &SessionKeeper::opened);
  click("openAnywayButton");
  ASSERT_TRUE(wait_for([&] { return !opened.isEmpty(); }));
  EXPECT_EQ(workbench().volume().dims()[0], 14);
}

TEST_F(Sessions, WhereItCannotBeWrittenTheMessageSaysSo) {
  open_scan(sample_path());
  session().save(QStringLiteral("/proc/mine.palpate.json"));
  ASSERT_TRUE(wait_for([this] { return !message().isEmpty(); }));
  EXPECT_TRUE(message().contains(QStringLiteral("/proc/mine.palpate.json"))) << message().toStdString();
  EXPECT_TRUE(session().file().isEmpty());
}

TEST_F(Sessions, WindowsKeepAutosavesOfTheirOwnAndRemoveThem) {
  open_scan(sample_path());
  gui::WindowOptions options;
  options.settings_file = path("settings.ini");
  {
    gui::MainWindow second(options);
    second.show();
    EXPECT_FALSE(second.session().lost()) << "the first window lives";
    second.open(noise_volume("other.mha", 12));
    ASSERT_TRUE(wait_for([this] { return autosaves().size() == 2; }));
    second.close();
    EXPECT_EQ(autosaves().size(), 1);
  }
  close_window();
  EXPECT_EQ(autosaves().size(), 0);
  make_window();
  EXPECT_FALSE(find<QFrame>("lostSessionBar").isVisible());
}

/// The program itself, opened on a scan and killed once its autosave is there.
class KilledProgram : public Sessions {
 protected:
  void SetUp() override {
    // Its data folder is the folder that the window under test looks into.
    fs::create_directories(folder() / "data" / fs::path("Palpate"));
    fs::create_directory_symlink(folder().path(), folder() / "data" / fs::path("Palpate") / "Palpate");
    QProcess program;
    auto environment = QProcessEnvironment::systemEnvironment();
    environment.insert(QStringLiteral("XDG_DATA_HOME"), path("data"));
    environment.insert(QStringLiteral("XDG_CONFIG_HOME"), path("config"));
    program.setProcessEnvironment(environment);
    program.start(QString::fromStdString((program_folder() / "palpate").string()), {sample_path()});
    ASSERT_TRUE(program.waitForStarted());
    ASSERT_TRUE(
        wait_for([&] { return !autosaves().isEmpty() || program.state() == QProcess::NotRunning; }, 60000));
    ASSERT_EQ(program.state(), QProcess::Running) << program.readAllStandardError().toStdString();
    program.kill();  // SIGKILL: nothing of it runs any more
    ASSERT_TRUE(program.waitForFinished());
    make_window();
  }
};

TEST_F(KilledProgram, WhatWasOpenIsOfferedAndComesBack) {
  EXPECT_TRUE(find<QFrame>("lostSessionBar").isVisible());
  EXPECT_FALSE(workbench().has_volume());
  QSignalSpy opened(&session(), &SessionKeeper::opened);
  click("restoreLostButton");
  ASSERT_TRUE(wait_for([&] { return !opened.isEmpty(); }));
  EXPECT_EQ(workbench().input_name(), "sample heart.mha");
  EXPECT_FALSE(find<QFrame>("lostSessionBar").isVisible());
  // This window's own autosave takes its place.
  ASSERT_TRUE(wait_for([this] { return !session().lost() && autosaves().size() == 1; }));
  close_window();
  EXPECT_EQ(autosaves().size(), 0);
}

TEST_F(KilledProgram, WhatIsNotRestoredIsOfferedAgainUntilItIsDiscarded) {
  open_scan(sample_path());
  EXPECT_FALSE(find<QFrame>("lostSessionBar").isVisible());
  close_window();
  make_window();
  EXPECT_TRUE(find<QFrame>("lostSessionBar").isVisible());
  click("discardLostButton");
  EXPECT_EQ(autosaves().size(), 0);
  close_window();
  make_window();
  EXPECT_FALSE(find<QFrame>("lostSessionBar").isVisible());
}

}  // namespace
}  // namespace palpate::testing
