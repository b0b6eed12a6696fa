// How fast the window draws while the sample heart is pulled. The numbers go
// to the test's log; only far too slow fails, because machines differ.
#include "window_fixture.hpp"

#include <QElapsedTimer>

#include <cstdio>

namespace palpate::testing {
namespace {

class FrameRate : public WindowTest {
 protected:
  void SetUp() override {
    make_window();
    window().open(QStringLiteral(PALPATE_SOURCE_DATA "/sample-heart.mha"));
    ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
    build_tissue();
  }
};

TEST_F(FrameRate, WhileTheSampleIsPulled) {
  trigger("tool3");
  auto& view = window().views().tissue_view();
  const QPoint wall(view.width() * 2 / 5, view.height() / 2);
  drag(view, wall, {-40, -30});
  ASSERT_TRUE(wait_for([this] { return workbench().last_frame()->grab_origin_mm.has_value(); }));
  int drawn = 0;
  QObject::connect(&view, &gui::GlView::rendered, &view, [&] { ++drawn; });
  int arrived = 0;
  QObject::connect(&workbench(), &gui::Workbench::frameArrived, &view, [&] { ++arrived; });
  // The mouse goes round in a circle, a move every 16 ms.
  QTimer mouse;
  mouse.setTimerType(Qt::PreciseTimer);
  QElapsedTimer clock;
  clock.start();
  QObject::connect(&mouse, &QTimer::timeout, &view, [&] {
    const double angle = 4.0 * static_cast<double>(clock.elapsed()) / 1000.0;
    const QPointF place =
        QPointF(wall) + QPointF(-40.0 + 15.0 * std::cos(angle), -30.0 + 15.0 * std::sin(angle));
    QMouseEvent move(QEvent::MouseMove, place, view.mapToGlobal(place.toPoint()), Qt::NoButton,
                     Qt::LeftButton, Qt::NoModifier);
    QApplication::sendEvent(&view, &move);
  });
  mouse.start(16);
  constexpr int measured_ms = 3000;
  ASSERT_FALSE(wait_for([] { return false; }, measured_ms));
  const double seconds = static_cast<double>(clock.elapsed()) / 1000.0;
  mouse.stop();
  QTest::mouseRelease(&view, Qt::LeftButton, Qt::NoModifier, wall);
  const auto& frame = *workbench().last_frame();
  std::printf("pulled, %d x %d: %.1f pictures/s, %.1f frames/s, %.2f ms/step, %.2f x real time, %s\n",
              window().width(), window().height(), drawn / seconds, arrived / seconds, frame.ms_per_step,
              frame.realtime_factor, qPrintable(view.renderer_name()));
  // A twentieth of a usual screen: below that the hand loses the tissue.
  EXPECT_GT(drawn / seconds, 3.0);
}

}  // namespace
}  // namespace palpate::testing
