#include "panels/side_panel.hpp"
#include "status_strip.hpp"
#include "window_fixture.hpp"

#include <QAction>
#include <QCheckBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QMenu>
#include <QPlainTextEdit>
#include <QPushButton>

#include <cstdlib>
#include <fstream>

namespace palpate::testing {
namespace {

class Simulating : public WindowTest {
 protected:
  void SetUp() override {
    make_window();
    open_sample();
    build_tissue();
  }
  double time_s() { return workbench().last_frame()->time_s; }
  /// A place of the 3-D view under which there is tissue.
  QPoint on_tissue() {
    auto& view = window().views().tissue_view();
    return {view.width() / 2, view.height() / 2};
  }
};

TEST_F(Simulating, PlayPauseStepAndReset) {
  EXPECT_FALSE(workbench().playing());
  click("playPauseButton");
  ASSERT_TRUE(wait_for([this] { return workbench().playing() && time_s() > 0.02; }));
  EXPECT_EQ(find<QPushButton>("simulateButton").text(), "Pause");
  click("playPauseButton");
  ASSERT_TRUE(wait_for([this] { return !workbench().playing(); }));
  const double paused = time_s();
  click("stepButton");
  ASSERT_TRUE(wait_for([&] { return time_s() > paused; }));
  EXPECT_NEAR(time_s() - paused, workbench().last_frame()->step_s, 1e-9) << "one step is one step";
  click("resetButton");
  ASSERT_TRUE(wait_for([this] { return time_s() == 0.0; }));
  ASSERT_TRUE(wait_for([this] { return find<QLabel>("timeLabel").text() == "t = 0.00 s"; }));
}

TEST_F(Simulating, TheGrabPullsTheSurfaceAndUndoBringsItBack) {
  const auto rest = surface_now();
  ASSERT_FALSE(rest.empty());
  key(Qt::Key_3);
  ASSERT_EQ(window().view_state().tool(), gui::Tool::grab);
  auto& view = window().views().tissue_view();
  drag(view, on_tissue(), {120, -60});
  ASSERT_TRUE(wait_for([this] { return workbench().last_frame()->grab_origin_mm.has_value(); }))
      << "the grab took hold of something";
  EXPECT_FALSE(workbench().last_frame()->held_points.empty());
  // The drag spans a good part of the view; a move of 2 mm is far over any rounding.
  ASSERT_TRUE(wait_for([&] { return largest_move_mm(rest, surface_now()) > 2.0; }));
  QTest::mouseRelease(&view, Qt::LeftButton, Qt::NoModifier, on_tissue() + QPoint(120, -60));
  ASSERT_TRUE(wait_for([this] { return !workbench().last_frame()->grab_origin_mm.has_value(); }));
  key(Qt::Key_Space);
  ASSERT_TRUE(wait_for([this] { return !workbench().playing(); }));
  ASSERT_TRUE(wait_for([this] { return find<QAction>("actionUndo").isEnabled(); }));
  key(Qt::Key_Z, Qt::ControlModifier);
  // Before the drag the tissue lay at rest: it comes back to it exactly.
  ASSERT_TRUE(wait_for([&] { return largest_move_mm(rest, surface_now()) < 1e-3; }));
  ASSERT_TRUE(wait_for([this] { return find<QAction>("actionRedo").isEnabled(); }));
  key(Qt::Key_Z, Qt::ControlModifier | Qt::ShiftModifier);
  ASSERT_TRUE(wait_for([&] { return largest_move_mm(rest, surface_now()) > 1e-2; }));
}

TEST_F(Simulating, TheGrabWorksOnASlice) {
  const auto rest = surface_now();
  const auto points = workbench().tissue()->tissue;
  // The crosshair at a point of the tissue; the slice there shows it.
  const Eigen::Vector3d place = points->points.lps_mm(points->points.size() / 2);
  window().view_state().set_crosshair(place);
  trigger("tool3");
  auto& axial = window().views().view(gui::ViewGrid::axial);
  auto& slice = dynamic_cast<gui::SliceWidget&>(axial);
  // Where on the widget the place is: searched by the view's own mapping.
  QPoint best;
  double nearest = 1e9;
  for (int y = 0; y < axial.height(); y += 2) {
    for (int x = 0; x < axial.width(); x += 2) {
      const QPointF pixel = viewport(axial, {x, y});
      const Eigen::Vector3d there = slice.view().place_at(pixel.x(), pixel.y());
      if ((there - place).norm() < nearest) {
        nearest = (there - place).norm();
        best = {x, y};
      }
    }
  }
  drag(axial, best, {60, 0});
  ASSERT_TRUE(wait_for([&] { return largest_move_mm(rest, surface_now()) > 1.0; }));
  QTest::mouseRelease(&axial, Qt::LeftButton, Qt::NoModifier, best + QPoint(60, 0));
  ASSERT_TRUE(wait_for([this] { return !workbench().last_frame()->grab_origin_mm.has_value(); }));
}

TEST_F(Simulating, TheGaugeSaysWhenTheStepIsTooLarge) {
  auto& gauge = find<gui::StepGauge>("stepGauge");
  ASSERT_TRUE(wait_for([&] { return gauge.state() == gui::StepGauge::State::stable; }));
  EXPECT_TRUE(gauge.text().contains("stable"));
  // The quick bound gives way to the measured limit, which then stays.
  ASSERT_TRUE(wait_for([this] { return workbench().last_frame()->stable_step_is_estimate; }));
  const double stable_s = workbench().last_frame()->stable_step_s;
  find<QCheckBox>("stepAuto").setChecked(false);
  find<QDoubleSpinBox>("stepSpin").setValue(stable_s * 1000.0 * 0.95);
  ASSERT_TRUE(wait_for([&] { return gauge.state() == gui::StepGauge::State::near_limit; }));
  find<QDoubleSpinBox>("stepSpin").setValue(stable_s * 1000.0 * 1.2);
  ASSERT_TRUE(wait_for([&] { return gauge.state() == gui::StepGauge::State::too_large; }));
  EXPECT_TRUE(gauge.text().contains("too large")) << "told by words, not by colour alone";
  find<QCheckBox>("stepAuto").setChecked(true);
  ASSERT_TRUE(wait_for([&] { return gauge.state() == gui::StepGauge::State::stable; }));
}

TEST_F(Simulating, PointsAndLinksAreShownToo) {
  for (const auto& [name, show] : {std::pair{"showPoints", visualization::Show::points},
                                   std::pair{"showLinks", visualization::Show::links},
                                   std::pair{"showSurface", visualization::Show::surface}}) {
    click(name);
    EXPECT_EQ(window().view_state().settings().show, show) << name;
    EXPECT_TRUE(find<QAbstractButton>(name).isChecked());
  }
}

TEST_F(Simulating, TheGaugeOffersTheAutomaticStep) {
  ASSERT_TRUE(wait_for([this] { return workbench().last_frame()->stable_step_is_estimate; }));
  find<QCheckBox>("stepAuto").setChecked(false);
  find<QDoubleSpinBox>("stepSpin").setValue(workbench().last_frame()->stable_step_s * 1000.0 * 1.2);
  auto& gauge = find<gui::StepGauge>("stepGauge");
  ASSERT_TRUE(wait_for([&] { return gauge.state() == gui::StepGauge::State::too_large; }));
  // The menu has an event loop of its own; this runs inside it.
  bool offered = false;
  QTimer::singleShot(0, &window(), [&] {
    auto* menu = window().findChild<QMenu*>("stepMenu");
    if (menu == nullptr) return;
    auto* automatic = menu->findChild<QAction*>("automaticStep");
    offered = automatic != nullptr && automatic->isEnabled();
    if (offered) menu->setActiveAction(automatic);
    QTest::keyClick(menu, offered ? Qt::Key_Return : Qt::Key_Escape);
  });
  gauge.click();
  EXPECT_TRUE(offered);
  EXPECT_FALSE(workbench().recipe().simulation.step_s.has_value());
  ASSERT_TRUE(wait_for([&] { return gauge.state() == gui::StepGauge::State::stable; }));
}

class BrokenKernels : public WindowTest {
 protected:
  BrokenKernels() {
    // Whichever way the tissue is laid out.
    for (const char* file : {"explicit.cl", "lattice.cl", "lattice_points.cl"})
      std::ofstream(kernels_ / file) << "kernel void stage(global float* x) { x[0] = nowhere; }\n";
    setenv("PALPATE_KERNEL_DIR", kernels_.path().c_str(), 1);
  }
  ~BrokenKernels() override {
    close_window();
    unsetenv("PALPATE_KERNEL_DIR");
  }

 private:
  TemporaryFolder kernels_;
};

TEST_F(BrokenKernels, ShowTheirLogAndTheReferenceIsOffered) {
  make_window();
  open_sample();
  workbench().build_tissue();
  ASSERT_TRUE(wait_for([this] { return find<QFrame>("messageBar").isVisible(); }));
  auto& details = find<QPlainTextEdit>("messageDetails");
  EXPECT_FALSE(details.isVisible());
  click("messageDetailsButton");
  EXPECT_TRUE(details.isVisible());
  EXPECT_TRUE(details.toPlainText().contains("nowhere")) << details.toPlainText().toStdString();
  click("messageOffer");
  ASSERT_TRUE(
      wait_for([this] { return workbench().simulation_ready() && workbench().last_frame().has_value(); }));
}

}  // namespace
}  // namespace palpate::testing
