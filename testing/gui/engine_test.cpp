// The controls of the engine: physics, time step, anchors, masks, and going on
// after a device was lost.
#include "message_bar.hpp"
#include "panels/log_spin_box.hpp"
#include "session_keeper.hpp"
#include "window_fixture.hpp"

#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QFrame>
#include <QLabel>
#include <QMenuBar>
#include <QPushButton>
#include <QSet>
#include <QSignalSpy>
#include <QSlider>
#include <QSpinBox>
#include <QScrollArea>
#include <QScrollBar>
#include <QWheelEvent>

#include <cmath>

namespace palpate::testing {
namespace {

using simulation::Integrator;
using Rule = session::AnchorSettings::Rule;

class Engine : public WindowTest {
 protected:
  void SetUp() override {
    make_window();
    open_sample();
  }
  const session::SimulationSettings& settings() { return workbench().recipe().simulation; }
  QString path(const char* name) const { return QString::fromStdString((folder() / name).string()); }
  void set(const char* field, double value) { find<QDoubleSpinBox>(field).setValue(value); }
  void tick(const char* box, bool on) { find<QCheckBox>(box).setChecked(on); }
  /// As a user does: the combo tells of it.
  void choose(const char* combo, int index) {
    auto& found = find<QComboBox>(combo);
    found.setCurrentIndex(index);
    emit found.activated(index);
  }
  QString message() {
    return find<QFrame>("messageBar").isVisible() ? find<QLabel>("messageText").text() : QString();
  }
  std::size_t anchor_count() { return workbench().anchors() ? workbench().anchors()->size() : 0; }
  QPoint on_tissue() {
    auto& view = window().views().tissue_view();
    return {view.width() / 2, view.height() / 2};
  }
  void stroke(const QPoint& by, Qt::KeyboardModifiers keys = Qt::NoModifier) {
    auto& view = window().views().tissue_view();
    drag(view, on_tissue(), by, Qt::LeftButton, keys);
    QTest::mouseRelease(&view, Qt::LeftButton, keys, on_tissue() + by);
  }
  /// A label image of the sample's geometry: 7 in its lower half along k.
  QString half_mask(const char* name) {
    const auto& geometry = workbench().volume().geometry();
    std::vector<float> voxels(geometry.voxel_count(), 0.0F);
    std::fill(voxels.begin(), voxels.begin() + static_cast<std::ptrdiff_t>(voxels.size() / 2), 7.0F);
    imaging::write(folder() / name, {core::Volume(geometry, std::move(voxels))}, 0.0, as_bytes(false));
    return path(name);
  }
  void fix_lower_half() {
    auto wanted = settings();
    wanted.anchors.rule = Rule::file;
    wanted.anchors.file = half_mask("half.mha").toStdString();
    workbench().set_simulation(wanted);
    ASSERT_TRUE(wait_for([this] { return settings().anchors.rule == Rule::file; }));
    EXPECT_EQ(find<QComboBox>("anchorCombo").currentIndex(), 2);
  }
  void set_every_control() {
    set("stiffnessSpin", 250000.0);
    set("dampingSpin", 12.5);
    set("dragSpin", 0.75);
    set("massSpin", 2.5);
    choose("gravityCombo", 1);
    choose("integratorCombo", find<QComboBox>("integratorCombo").findText("Velocity Verlet"));
    choose("layoutCombo", 2);
    tick("scaleStiffness", true);
    tick("scaleMass", true);
    tick("beatCheck", true);
    set("beatPeriodSpin", 0.8);
    set("beatAmplitudeSpin", 15.0);
    tick("stepAuto", false);
    set("stepSpin", 0.25);
    choose("anchorCombo", 1);
    find<QSpinBox>("strideSpin").setValue(2);
    find<QSpinBox>("minComponentSpin").setValue(1);
    find<QComboBox>("linksCombo").setCurrentIndex(3);
  }
};

void expect_every_setting(const session::Recipe& recipe) {
  const auto& s = recipe.simulation;
  EXPECT_EQ(s.parameters.stiffness_per_s2, 250000.0);
  EXPECT_EQ(s.parameters.damping_per_s, 12.5);
  EXPECT_EQ(s.parameters.drag_per_s, 0.75);
  EXPECT_EQ(s.parameters.mass, 2.5);
  EXPECT_EQ(s.parameters.gravity_mm_per_s2, Eigen::Vector3d(0.0, 9810.0, 0.0));
  EXPECT_EQ(s.parameters.integrator, Integrator::velocity_verlet);
  EXPECT_EQ(s.layout, simulation::LayoutChoice::explicit_links);
  EXPECT_TRUE(s.scaling.stiffness && s.scaling.mass);
  EXPECT_FALSE(s.scaling.damping || s.scaling.drag);
  EXPECT_EQ(s.parameters.beat_period_s, 0.8);
  EXPECT_DOUBLE_EQ(s.parameters.beat_amplitude, 0.15);
  ASSERT_TRUE(s.step_s.has_value());
  EXPECT_DOUBLE_EQ(*s.step_s, 0.00025);
  EXPECT_EQ(s.anchors.rule, Rule::border);
  EXPECT_EQ(recipe.tissue.stride, 2);
  EXPECT_EQ(recipe.tissue.links, model::LinkRule::lattice26);
}

TEST_F(Engine, EachControlReachesTheRecipe) {
  set_every_control();
  expect_every_setting(workbench().recipe());
  choose("gravityCombo", 2);
  EXPECT_EQ(settings().parameters.gravity_mm_per_s2, Eigen::Vector3d(0.0, 0.0, -9810.0));
  set("gravityX", 120.0);
  EXPECT_EQ(find<QComboBox>("gravityCombo").currentIndex(), 3) << "no preset any more";
  choose("gravityCombo", 0);
  EXPECT_TRUE(settings().parameters.gravity_mm_per_s2.isZero());
  tick("beatCheck", false);
  EXPECT_EQ(settings().parameters.beat_amplitude, 0.0);
  EXPECT_FALSE(find<QDoubleSpinBox>("beatPeriodSpin").isEnabled());
  EXPECT_EQ(settings().parameters.beat_period_s, 0.8) << "kept for the next time";
  tick("stepAuto", true);
  EXPECT_FALSE(settings().step_s.has_value());
}

TEST_F(Engine, ASessionBringsEachControlBack) {
  set_every_control();
  build_tissue();
  window().view_state().set_tool(gui::Tool::anchor);
  stroke({10, 0});
  const auto painted = settings().anchors.painted;
  ASSERT_FALSE(painted.empty());
  const std::size_t anchored = anchor_count();
  QSignalSpy saved(&window().session(), &gui::SessionKeeper::saved);
  window().session().save(path("mine.palpate.json"));
  ASSERT_TRUE(wait_for([&] { return !saved.isEmpty(); })) << message().toStdString();
  close_window();
  make_window();
  QSignalSpy opened(&window().session(), &gui::SessionKeeper::opened);
  window().open(path("mine.palpate.json"));
  ASSERT_TRUE(wait_for([&] { return !opened.isEmpty() || !message().isEmpty(); }, 60000));
  ASSERT_EQ(opened.count(), 1) << message().toStdString();
  expect_every_setting(workbench().recipe());
  EXPECT_EQ(settings().anchors.painted, painted);
  ASSERT_TRUE(wait_for([&] { return anchor_count() == anchored; })) << anchor_count() << " of " << anchored;
  EXPECT_EQ(find<QDoubleSpinBox>("stiffnessSpin").value(), 250000.0);
  EXPECT_EQ(find<QDoubleSpinBox>("massSpin").value(), 2.5);
  EXPECT_EQ(find<QComboBox>("gravityCombo").currentIndex(), 1);
  EXPECT_EQ(find<QComboBox>("integratorCombo").currentText(), "Velocity Verlet");
  EXPECT_EQ(find<QComboBox>("layoutCombo").currentIndex(), 2);
  EXPECT_TRUE(find<QCheckBox>("scaleMass").isChecked());
  EXPECT_EQ(find<QDoubleSpinBox>("beatAmplitudeSpin").value(), 15.0);
  EXPECT_EQ(find<QComboBox>("anchorCombo").currentIndex(), 1);
  EXPECT_EQ(find<QDoubleSpinBox>("stepSpin").value(), 0.25);
  EXPECT_EQ(find<QSpinBox>("strideSpin").value(), 2) << "the tissue's fields too";
  EXPECT_EQ(find<QComboBox>("linksCombo").currentIndex(), 3);
}

TEST_F(Engine, TheDriverHearsOfAChangeWhileItIsThere) {
  build_tissue();
  // Estimates are compared with estimates: each is 0.90 to 1.00 of the true limit.
  double known_s = 0.0;
  const auto next_limit_s = [&] {
    EXPECT_TRUE(wait_for([&] {
      const auto& frame = *workbench().last_frame();
      return frame.stable_step_is_estimate && frame.stable_step_s != known_s;
    }));
    return known_s = workbench().last_frame()->stable_step_s;
  };
  const double soft_s = next_limit_s();
  set("stiffnessSpin", 100.0 * settings().parameters.stiffness_per_s2);
  const double stiff_s = next_limit_s();
  EXPECT_LT(stiff_s, 0.12 * soft_s) << "a hundred times as stiff vibrates ten times as fast";
  set("massSpin", 4.0);
  const double heavy_s = next_limit_s();
  EXPECT_GT(heavy_s, 1.7 * stiff_s) << "four times the mass, half the frequency";
  choose("integratorCombo", find<QComboBox>("integratorCombo").findText("Verlet"));
  EXPECT_LT(next_limit_s(), 0.87 * heavy_s) << "2/omega in place of 2.6/omega";
}

TEST_F(Engine, FixedPointsStayUnderGravity) {
  fix_lower_half();
  choose("gravityCombo", 1);
  build_tissue();
  ASSERT_TRUE(wait_for([this] { return anchor_count() > 0; }));
  ASSERT_LT(anchor_count(), workbench().tissue()->statistics.points);
  const auto& rest = workbench().tissue()->tissue->points.positions_mm;
  click("simulateButton");
  ASSERT_TRUE(wait_for([this] {
    return workbench().last_frame()->time_s > 0.05 && workbench().last_frame()->max_displacement_mm > 0.5;
  }));
  const auto positions = workbench().last_frame()->positions_mm;
  for (const auto point : *workbench().anchors()) EXPECT_EQ((*positions)[point], rest[point]) << point;
}

TEST_F(Engine, GravityWithoutAnythingFixedIsSaid) {
  build_tissue();
  EXPECT_FALSE(find<QLabel>("fallNote").isVisible());
  choose("gravityCombo", 1);
  EXPECT_TRUE(find<QLabel>("fallNote").isVisible());
  choose("gravityCombo", 0);
  EXPECT_FALSE(find<QLabel>("fallNote").isVisible());
}

TEST_F(Engine, TissueThatIsTooSoftForItsGravityIsSaid) {
  fix_lower_half();
  build_tissue();
  ASSERT_TRUE(wait_for([this] { return anchor_count() > 0; }));
  find<QDoubleSpinBox>("stiffnessSpin").setValue(1e3);
  choose("gravityCombo", 2);
  const auto& note = find<QLabel>("fallNote");
  EXPECT_TRUE(note.isVisible());
  EXPECT_TRUE(note.text().contains("stiffness of")) << note.text().toStdString();
  find<QDoubleSpinBox>("stiffnessSpin").setValue(1e8);
  EXPECT_FALSE(note.isVisible());
}

TEST_F(Engine, AStepAboveTheLimitIsWarnedOfBeforeTheRun) {
  build_tissue();
  const double limit_ms = workbench().last_frame()->stable_step_s * 1000.0;
  EXPECT_TRUE(find<QLabel>("limitLabel").text().contains("ms")) << "shown before anything runs";
  EXPECT_EQ(workbench().last_frame()->time_s, 0.0);
  auto& warning = find<QFrame>("stepWarning");
  EXPECT_FALSE(warning.isVisible());
  tick("stepAuto", false);
  set("stepSpin", 0.5 * limit_ms);
  EXPECT_FALSE(warning.isVisible());
  set("stepSpin", 2.0 * limit_ms);
  EXPECT_TRUE(warning.isVisible());
  EXPECT_TRUE(find<QLabel>("stepWarningText").text().contains("above the largest stable step"));
  ASSERT_TRUE(wait_for([this] { return workbench().last_frame()->substeps > 1; })) << "as the words say";
  EXPECT_FALSE(find<QLabel>("stepWarningIcon").pixmap(Qt::ReturnByValue).isNull()) << "a shape, not a colour";
  tick("stepAuto", true);
  EXPECT_FALSE(warning.isVisible());
}

TEST_F(Engine, TheLimitingPointIsMarkedWhereItLies) {
  EXPECT_FALSE(find<QPushButton>("limitButton").isEnabled());
  build_tissue();
  const visualization::PictureRequest request{400, 300, visualization::PictureView::axial};
  const auto picture = [&] {
    return visualization::draw_picture(workbench().content(), window().view_state().settings(), request);
  };
  EXPECT_FALSE(workbench().content().mark.has_value());
  click("limitButton");
  const auto content = workbench().content();
  ASSERT_TRUE(content.mark.has_value());
  EXPECT_EQ(content.mark->point, workbench().last_frame()->worst_point);
  const auto place = visualization::place_of(content, content.mark->point);
  ASSERT_TRUE(place.has_value());
  EXPECT_LT((window().view_state().settings().crosshair_mm - *place).norm(), 1e-9);
  // It is where its voxel is, but for the noise of the lattice: a tenth of a voxel along each axis.
  const auto& tissue = *workbench().tissue()->tissue;
  const auto& voxel = tissue.points.voxels[content.mark->point];
  const Eigen::Vector3d at = tissue.geometry.to_lps_mm(Eigen::Vector3d(voxel[0], voxel[1], voxel[2]));
  EXPECT_LT((*place - at).norm(), 0.2 * tissue.spacing_mm.norm());
  EXPECT_GE(workbench().filtered().at(voxel[0], voxel[1], voxel[2]), workbench().tissue()->threshold_low);
  const auto marked = picture();
  const auto texts = visualization::burned_in_text(content, window().view_state().settings(), request);
  EXPECT_NE(std::find(texts.begin(), texts.end(), "limits the step"), texts.end());
  click("limitButton");
  EXPECT_FALSE(workbench().content().mark.has_value());
  EXPECT_NE(picture().rgba, marked.rgba);
}

TEST_F(Engine, TheBrushFixesPointsAndUndoFreesThem) {
  build_tissue();
  key(Qt::Key_4);
  ASSERT_EQ(window().view_state().tool(), gui::Tool::anchor);
  EXPECT_FALSE(find<QPushButton>("clearAnchorsButton").isVisible());
  stroke({40, 0});
  const std::size_t first = anchor_count();
  ASSERT_GT(first, 0U);
  ASSERT_TRUE(workbench().content().anchors);
  // Counted by hand: the points that lie within the radius of a dab, at rest.
  const auto& points = workbench().tissue()->tissue->points;
  std::size_t within = 0;
  for (std::size_t p = 0; p < points.size(); ++p) {
    bool inside = false;
    for (const auto& dab : settings().anchors.painted)
      inside = inside || (points.lps_mm(p) - dab.place_mm).norm() <= dab.radius_mm;
    within += inside ? 1U : 0U;
  }
  // Single and double precision may differ on the rim.
  EXPECT_NEAR(static_cast<double>(first), static_cast<double>(within), 2.0);
  stroke({-60, 0});
  const std::size_t second = anchor_count();
  EXPECT_GT(second, first);
  stroke({-60, 0}, Qt::ControlModifier);
  EXPECT_LT(anchor_count(), second) << "Ctrl frees them";
  ASSERT_TRUE(wait_for([this] { return find<QAction>("actionUndo").isEnabled(); }));
  key(Qt::Key_Z, Qt::ControlModifier);
  EXPECT_EQ(anchor_count(), second);
  key(Qt::Key_Z, Qt::ControlModifier);
  EXPECT_EQ(anchor_count(), first);
  key(Qt::Key_Z, Qt::ControlModifier);
  EXPECT_EQ(anchor_count(), 0U);
  key(Qt::Key_Z, Qt::ControlModifier | Qt::ShiftModifier);
  EXPECT_EQ(anchor_count(), first);
  click("clearAnchorsButton");
  EXPECT_EQ(anchor_count(), 0U);
  key(Qt::Key_Z, Qt::ControlModifier);
  EXPECT_EQ(anchor_count(), first) << "clearing is a step too";
}

TEST_F(Engine, AMaskThatDoesNotFitCostsNothing) {
  build_tissue();
  const auto points = workbench().tissue()->statistics.points;
  session::MaskSettings mask;
  mask.path = folder() / "not there.mha";
  workbench().set_mask(mask);
  ASSERT_TRUE(wait_for([this] { return !message().isEmpty(); }));
  EXPECT_TRUE(message().contains("not there.mha")) << message().toStdString();
  EXPECT_FALSE(workbench().recipe().mask.path.has_value());
  EXPECT_EQ(find<QComboBox>("maskCombo").currentIndex(), 0);
  ASSERT_TRUE(workbench().has_tissue());
  EXPECT_EQ(workbench().tissue()->statistics.points, points);
}

TEST_F(Engine, AMaskIsCountedBeforeItIsBuilt) {
  session::MaskSettings mask;
  mask.path = half_mask("half.mha").toStdString();
  find<QSpinBox>("minComponentSpin").setValue(1);
  find<QSpinBox>("strideSpin").setValue(4);
  workbench().set_mask(mask);
  ASSERT_TRUE(wait_for(
      [this] { return workbench().recipe().mask.path.has_value() && workbench().estimate().has_value(); }));
  EXPECT_EQ(find<QComboBox>("maskCombo").currentIndex(), 1);
  EXPECT_TRUE(find<QLabel>("maskFileLabel").text().contains("half.mha"));
  // Every fourth voxel along each axis of the half that is marked.
  const auto& dims = workbench().volume().dims();
  std::size_t marked = 0;
  const std::size_t half = workbench().volume().size() / 2;
  for (int k = 0; k < dims[2]; k += 4)
    for (int j = 0; j < dims[1]; j += 4)
      for (int i = 0; i < dims[0]; i += 4) {
        const auto at = static_cast<std::size_t>((k * dims[1] + j) * dims[0] + i);
        marked += at < half ? 1U : 0U;
      }
  EXPECT_EQ(workbench().estimate()->tissue.statistics.points, marked);
  // A label that nothing has says so and stays to be mended.
  find<QSpinBox>("maskLabelSpin").setValue(3);
  ASSERT_TRUE(wait_for([this] { return !find<QLabel>("estimateLabel").text().startsWith("Counting"); }));
  EXPECT_FALSE(workbench().estimate().has_value());
  find<QSpinBox>("maskLabelSpin").setValue(7);
  ASSERT_TRUE(wait_for([this] { return workbench().estimate().has_value(); }));
  EXPECT_EQ(workbench().estimate()->tissue.statistics.points, marked);
}

TEST_F(Engine, AnAnchorFileThatCannotBeReadCostsNothing) {
  build_tissue();
  fix_lower_half();
  ASSERT_TRUE(wait_for([this] { return anchor_count() > 0; }));
  const std::size_t before = anchor_count();
  auto wanted = settings();
  wanted.anchors.rule = Rule::file;
  wanted.anchors.file = folder() / "not there.mha";
  workbench().set_simulation(wanted);
  ASSERT_TRUE(wait_for([this] { return !message().isEmpty(); }));
  EXPECT_EQ(settings().anchors.file.filename(), "half.mha");
  EXPECT_EQ(find<QComboBox>("anchorCombo").currentIndex(), 2);
  EXPECT_EQ(anchor_count(), before);
  EXPECT_TRUE(workbench().simulation_ready()) << "the simulation goes on";
}

TEST_F(Engine, PointsWithoutALatticeAreJoinedByTheNearestOnly) {
  find<QComboBox>("linksCombo").setCurrentIndex(2);
  EXPECT_EQ(workbench().recipe().tissue.links, model::LinkRule::lattice18);
  find<QComboBox>("pointsCombo").setCurrentIndex(1);
  EXPECT_EQ(workbench().recipe().tissue.points, model::PointRule::blue_noise);
  EXPECT_EQ(workbench().recipe().tissue.links, model::LinkRule::nearest);
  EXPECT_FALSE(find<QComboBox>("linksCombo").isEnabled());
}

TEST_F(Engine, TheStiffnessTakesAnyPowerOfTen) {
  auto& field = find<gui::LogSpinBox>("stiffnessSpin");
  const auto type = [&](const char* text) {
    field.selectAll();
    QTest::keyClicks(&field, text);
    QTest::keyClick(&field, Qt::Key_Return);
  };
  build_tissue();  // opens the panel
  type("1e6");
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 1e6);
  type("2 500");
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 2500.0);
  QTest::keyClick(&field, Qt::Key_Up);
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 5000.0);
  QTest::keyClick(&field, Qt::Key_Up);
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 10000.0);
  QTest::keyClick(&field, Qt::Key_Down);
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 5000.0);
  type("1e9");
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 1e9);
  EXPECT_EQ(find<QSlider>("stiffnessSlider").value(), 900);
  find<QSlider>("stiffnessSlider").setValue(400);
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 1e4);
  EXPECT_EQ(field.value(), 1e4);
}

TEST_F(Engine, TheWheelScrollsThePanelAndChangesNothing) {
  build_tissue();
  const auto turn = [](QWidget& field) {
    const QPointF place = field.rect().center();
    QWheelEvent event(place, field.mapToGlobal(place.toPoint()), {}, {0, -120}, Qt::NoButton, Qt::NoModifier,
                      Qt::NoScrollPhase, false);
    QApplication::sendEvent(&field, &event);
  };
  auto& field = find<QDoubleSpinBox>("stiffnessSpin");
  field.clearFocus();
  turn(field);
  turn(find<QSlider>("stiffnessSlider"));
  turn(find<QComboBox>("anchorCombo"));
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 10000.0);
  EXPECT_EQ(settings().anchors.rule, Rule::none);
  field.setFocus();
  turn(field);
  EXPECT_EQ(settings().parameters.stiffness_per_s2, 5000.0) << "one that was chosen takes it";

  auto* panel = window().findChild<QWidget*>("SimulatePanel");
  ASSERT_NE(panel, nullptr);
  panel->findChild<QAbstractButton*>("moreButton")->setChecked(true);
  auto& area = find<QScrollArea>("sidePanel");
  auto& bar = *area.verticalScrollBar();
  ASSERT_TRUE(QTest::qWaitFor([&] { return bar.maximum() > 0; })) << "too tall to test";
  bar.setValue(0);
  turn(*area.viewport());
  EXPECT_GT(bar.value(), 0);
}

TEST_F(Engine, EveryControlIsReachedByTheKeyboard) {
  build_tissue();
  find<QAbstractButton>("moreButton");
  auto* panel = window().findChild<QWidget*>("SimulatePanel");
  ASSERT_NE(panel, nullptr);
  auto* more = panel->findChild<QAbstractButton*>("moreButton");
  more->setChecked(true);
  QSet<QString> reached;
  QWidget* start = panel->findChild<QWidget*>("simulateButton");
  start->setFocus();
  // Tab after Tab, until the panel is left.
  for (int n = 0; n < 60; ++n) {
    QWidget* focus = QApplication::focusWidget();
    if (focus == nullptr || !panel->isAncestorOf(focus)) break;
    reached.insert(focus->objectName());
    QTest::keyClick(focus, Qt::Key_Tab);
  }
  for (auto* field : panel->findChildren<QWidget*>()) {
    const bool control = qobject_cast<QAbstractSpinBox*>(field) || qobject_cast<QComboBox*>(field) ||
                         qobject_cast<QAbstractButton*>(field) || qobject_cast<QSlider*>(field);
    if (!control || !field->isVisible() || !field->isEnabled()) continue;
    EXPECT_TRUE(reached.contains(field->objectName())) << field->objectName().toStdString();
    EXPECT_FALSE(field->accessibleName().isEmpty()) << field->objectName().toStdString();
  }
  // No letter stands for two fields, or for a menu and a field.
  QStringList labels;
  for (const auto* label : panel->findChildren<QLabel*>())
    if (label->buddy() != nullptr) labels << label->text();
  for (const auto* button : panel->findChildren<QAbstractButton*>()) labels << button->text();
  for (const auto* menu : window().menuBar()->actions()) labels << menu->text();
  QSet<QChar> letters;
  for (const QString& text : labels) {
    const int at = text.indexOf('&');
    if (at < 0) continue;
    const QChar letter = text.at(at + 1).toLower();
    EXPECT_FALSE(letters.contains(letter)) << text.toStdString();
    letters.insert(letter);
  }
}

TEST_F(Engine, AfterADeviceWasLostItGoesOnFromWhatIsShown) {
  build_tissue();
  key(Qt::Key_3);
  auto& view = window().views().tissue_view();
  const auto rest = surface_now();
  drag(view, on_tissue(), {120, -60});
  ASSERT_TRUE(wait_for([&] { return largest_move_mm(rest, surface_now()) > 2.0; }));
  key(Qt::Key_Space);
  ASSERT_TRUE(wait_for([this] { return !workbench().playing(); }));
  QTest::mouseRelease(&view, Qt::LeftButton, Qt::NoModifier, on_tissue() + QPoint(120, -60));
  ASSERT_TRUE(wait_for([this] { return !workbench().last_frame()->grab_origin_mm.has_value(); }));
  const auto shown = workbench().last_frame()->positions_mm;
  const double time_s = workbench().last_frame()->time_s;
  // The message of a lost device offers another one and the reference.
  gui::Problem lost;
  lost.code = "device-lost";
  lost.text = "The device was lost.";
  lost.offer = gui::Problem::Offer::other_device;
  lost.other_device = "1";
  lost.other_device_name = "Another";
  auto* bar = window().findChild<gui::MessageBar*>("messageBar");
  ASSERT_NE(bar, nullptr);
  bar->show_problem(lost);
  EXPECT_TRUE(find<QAbstractButton>("messageAction").isVisible());
  EXPECT_TRUE(find<QAbstractButton>("messageAction").text().contains("Another"));
  click("messageOffer");
  ASSERT_TRUE(
      wait_for([this] { return workbench().simulation_ready() && workbench().last_frame().has_value(); }));
  EXPECT_EQ(workbench().device(), "reference");
  EXPECT_EQ(*workbench().last_frame()->positions_mm, *shown);
  EXPECT_EQ(workbench().last_frame()->time_s, time_s);
}

/// A device that stops after so many launches of kernels: more than building
/// and warming up takes, fewer than a run of a second.
class LostDevice : public Engine {
 protected:
  LostDevice() { setenv("PALPATE_FAIL_AFTER_LAUNCHES", "600", 1); }
  ~LostDevice() override {
    close_window();
    unsetenv("PALPATE_FAIL_AFTER_LAUNCHES");
  }
};

TEST_F(LostDevice, LeavesTheLastStateAndTheReferenceGoesOnFromIt) {
  choose("gravityCombo", 1);
  build_tissue();
  click("simulateButton");
  ASSERT_TRUE(wait_for([this] { return workbench().simulation_stopped(); }));
  EXPECT_FALSE(message().isEmpty());
  EXPECT_FALSE(workbench().playing());
  EXPECT_TRUE(find<QLabel>("timeLabel").text().startsWith("Stopped at"));
  EXPECT_FALSE(find<QPushButton>("simulateButton").isEnabled());
  ASSERT_TRUE(workbench().last_frame().has_value());
  const double stopped_s = workbench().last_frame()->time_s;
  EXPECT_GT(stopped_s, 0.0);
  const auto shown = workbench().last_frame()->positions_mm;
  EXPECT_EQ(workbench().content().positions_mm, shown) << "still on the screen";
  QSignalSpy saved(&window().session(), &gui::SessionKeeper::saved);
  window().session().save(path("lost.palpate.json"));
  QSignalSpy pictured(&workbench(), &gui::Workbench::pictureSaved);
  workbench().save_picture(path("lost.png"), window().views().picture_settings(),
                           {320, 240, visualization::PictureView::three_d});
  ASSERT_TRUE(wait_for([&] { return !saved.isEmpty() && !pictured.isEmpty(); }));
  workbench().go_on_with("reference");
  ASSERT_TRUE(
      wait_for([this] { return workbench().simulation_ready() && workbench().last_frame().has_value(); }));
  EXPECT_EQ(workbench().last_frame()->time_s, stopped_s);
  EXPECT_EQ(*workbench().last_frame()->positions_mm, *shown);
  EXPECT_TRUE(find<QPushButton>("simulateButton").isEnabled());
}

}  // namespace
}  // namespace palpate::testing
