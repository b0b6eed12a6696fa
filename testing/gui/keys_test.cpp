#include "window_fixture.hpp"

#include <QLabel>
#include <QSlider>
#include <QWheelEvent>

namespace palpate::testing {
namespace {

class Keys : public WindowTest {
 protected:
  void SetUp() override {
    make_window();
    open_sample();
    // A view takes part once it was drawn.
    ASSERT_TRUE(wait_for([this] { return find<QSlider>("axialSlider").maximum() > 0; }));
  }
  gui::SliceWidget& axial() {
    return dynamic_cast<gui::SliceWidget&>(window().views().view(gui::ViewGrid::axial));
  }
  /// What the axial view shows under a place of its widget, in LPS mm.
  Eigen::Vector3d shown_at(const QPoint& place) {
    const QPointF pixel = viewport(axial(), place);
    return axial().view().place_at(pixel.x(), pixel.y());
  }
  static QPoint centre_of(const QWidget& widget) { return widget.rect().center(); }
  void wheel(QWidget& widget, int notches) {
    const QPointF place = centre_of(widget);
    QWheelEvent event(place, widget.mapToGlobal(place.toPoint()), {}, {0, 120 * notches}, Qt::NoButton,
                      Qt::NoModifier, Qt::NoScrollPhase, false);
    QApplication::sendEvent(&widget, &event);
  }
};

TEST_F(Keys, NumbersChooseTheTool) {
  key(Qt::Key_3);
  EXPECT_EQ(window().view_state().tool(), gui::Tool::grab);
  EXPECT_TRUE(find<QAction>("tool3").isChecked());
  key(Qt::Key_2);
  EXPECT_EQ(window().view_state().tool(), gui::Tool::window_level);
  key(Qt::Key_1);
  EXPECT_EQ(window().view_state().tool(), gui::Tool::navigate);
}

TEST_F(Keys, WheelAndArrowsStepSlices) {
  const int start = axial().slice();
  wheel(axial(), 1);
  EXPECT_EQ(axial().slice(), start + 1);
  wheel(axial(), -2);
  EXPECT_EQ(axial().slice(), start - 1);
  QTest::keyClick(&axial(), Qt::Key_Right);
  EXPECT_EQ(axial().slice(), start);
  QTest::keyClick(&axial(), Qt::Key_Left);
  EXPECT_EQ(axial().slice(), start - 1);
  ASSERT_TRUE(wait_for([&] { return find<QSlider>("axialSlider").value() == start - 1; }));
  find<QSlider>("axialSlider").setValue(2);
  EXPECT_EQ(axial().slice(), 2);
}

TEST_F(Keys, NavigateAndShiftMoveTheCrosshair) {
  const QPoint place = centre_of(axial()) + QPoint(30, 20);
  const Eigen::Vector3d expected = shown_at(place);
  QTest::mouseClick(&axial(), Qt::LeftButton, Qt::NoModifier, place);
  EXPECT_LT((window().view_state().settings().crosshair_mm - expected).norm(), 1e-6);
  const QPoint other = centre_of(axial()) - QPoint(40, 10);
  const Eigen::Vector3d second = shown_at(other);
  QMouseEvent move(QEvent::MouseMove, other, axial().mapToGlobal(other), Qt::NoButton, Qt::NoButton,
                   Qt::ShiftModifier);
  QApplication::sendEvent(&axial(), &move);
  EXPECT_LT((window().view_state().settings().crosshair_mm - second).norm(), 1e-6);
}

TEST_F(Keys, RightDragZoomsMiddleAndShiftDragPanAndRFits) {
  const double fitted = axial().view().zoom_percent();
  drag(axial(), centre_of(axial()), {0, -80}, Qt::RightButton);
  QTest::mouseRelease(&axial(), Qt::RightButton, Qt::NoModifier, centre_of(axial()));
  EXPECT_GT(axial().view().zoom_percent(), fitted * 1.2);
  for (const auto& [button, modifier] :
       {std::pair{Qt::MiddleButton, Qt::KeyboardModifiers(Qt::NoModifier)},
        std::pair{Qt::LeftButton, Qt::KeyboardModifiers(Qt::ShiftModifier)}}) {
    const Eigen::Vector3d before = shown_at({50, 50});
    const Eigen::Vector3d crosshair = window().view_state().settings().crosshair_mm;
    drag(axial(), centre_of(axial()), {40, 0}, button, modifier);
    QTest::mouseRelease(&axial(), button, modifier, centre_of(axial()));
    // What lay under place 50 lies under place 90 now; far under a pixel's size.
    EXPECT_LT((shown_at({90, 50}) - before).norm(), 1e-3);
    EXPECT_EQ(window().view_state().settings().crosshair_mm, crosshair);
  }
  axial().setFocus();
  QCursor::setPos(axial().mapToGlobal(centre_of(axial())));
  ASSERT_TRUE(wait_for([this] { return axial().underMouse(); }));
  key(Qt::Key_R);
  ASSERT_TRUE(wait_for([&] { return std::abs(axial().view().zoom_percent() - fitted) < 1e-6; }));
}

TEST_F(Keys, WindowAndLevelFollowTheDrag) {
  trigger("tool2");
  const auto before = window().view_state().settings();
  drag(axial(), centre_of(axial()), {50, 0});
  QTest::mouseRelease(&axial(), Qt::LeftButton, Qt::NoModifier, centre_of(axial()));
  const auto wider = window().view_state().settings();
  EXPECT_GT(wider.window, before.window);
  EXPECT_EQ(wider.level, before.level);
  drag(axial(), centre_of(axial()), {0, 50});
  QTest::mouseRelease(&axial(), Qt::LeftButton, Qt::NoModifier, centre_of(axial()));
  EXPECT_NE(window().view_state().settings().level, wider.level);
  EXPECT_EQ(window().view_state().settings().window, wider.window);
}

TEST_F(Keys, DoubleClickShowsOneViewAndBack) {
  QTest::mouseDClick(&axial(), Qt::LeftButton);
  EXPECT_TRUE(axial().isVisible());
  EXPECT_FALSE(window().views().tissue_view().isVisible());
  QTest::mouseDClick(&axial(), Qt::LeftButton);
  EXPECT_TRUE(window().views().tissue_view().isVisible());
  trigger("actionSideBySide");
  EXPECT_FALSE(window().views().view(gui::ViewGrid::coronal).isVisible());
  trigger("actionFourUp");
  EXPECT_TRUE(window().views().view(gui::ViewGrid::coronal).isVisible());
}

TEST_F(Keys, F1ShowsTheKeysOfTheTool) {
  auto& help = find<QFrame>("helpOverlay");
  EXPECT_FALSE(help.isVisible());
  key(Qt::Key_3);
  key(Qt::Key_F1);
  EXPECT_TRUE(help.isVisible());
  EXPECT_TRUE(help.findChild<QLabel*>()->text().contains("Grab"));
  key(Qt::Key_F1);
  EXPECT_FALSE(help.isVisible());
}

TEST_F(Keys, TheValueUnderTheCursorIsTold) {
  const QPoint place = centre_of(axial());
  QMouseEvent move(QEvent::MouseMove, place, axial().mapToGlobal(place), Qt::NoButton, Qt::NoButton,
                   Qt::NoModifier);
  QApplication::sendEvent(&axial(), &move);
  const QString text = find<QLabel>("cursorLabel").text();
  EXPECT_TRUE(text.startsWith("voxel ")) << text.toStdString();
  const auto ijk = workbench().volume().geometry().to_ijk(shown_at(place));
  const float value =
      workbench().volume().at(static_cast<int>(std::lround(ijk.x())), static_cast<int>(std::lround(ijk.y())),
                              static_cast<int>(std::lround(ijk.z())));
  EXPECT_TRUE(text.endsWith(QStringLiteral("value %1").arg(value)))
      << text.toStdString() << " is not of " << value;
}

}  // namespace
}  // namespace palpate::testing
