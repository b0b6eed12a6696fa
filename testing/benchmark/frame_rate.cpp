// How fast the window draws while the sample heart is pulled. The numbers go
// to the test's log; only far too slow fails, because machines differ.
#include "window_fixture.hpp"

#include <QElapsedTimer>

#include <cstdio>
#include <ctime>

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
  /// Goes round in a circle with the button held, a move every 16 ms, for three seconds.
  void circle(const char* what) {
    auto& view = window().views().tissue_view();
    int drawn = 0;
    const auto counting = QObject::connect(&view, &gui::GlView::rendered, &view, [&] { ++drawn; });
    QTimer mouse;
    mouse.setTimerType(Qt::PreciseTimer);
    QElapsedTimer clock;
    clock.start();
    const std::clock_t work = std::clock();
    QObject::connect(&mouse, &QTimer::timeout, &view, [&] {
      const double angle = 4.0 * static_cast<double>(clock.elapsed()) / 1000.0;
      const QPointF place =
          QPointF(wall()) + QPointF(-40.0 + 15.0 * std::cos(angle), -30.0 + 15.0 * std::sin(angle));
      QMouseEvent move(QEvent::MouseMove, place, view.mapToGlobal(place.toPoint()), Qt::NoButton,
                       Qt::LeftButton, Qt::NoModifier);
      QApplication::sendEvent(&view, &move);
    });
    mouse.start(16);
    constexpr int measured_ms = 3000;
    EXPECT_FALSE(wait_for([] { return false; }, measured_ms));
    QObject::disconnect(counting);
    const double work_ms = 1000.0 * static_cast<double>(std::clock() - work) / CLOCKS_PER_SEC;
    const double seconds = static_cast<double>(clock.elapsed()) / 1000.0;
    const auto& frame = *workbench().last_frame();
    std::printf(
        "%s, %d x %d: %.1f pictures/s, %.1f ms of processor each, %.2f ms/step, %.2f x real time, %s\n", what,
        window().width(), window().height(), drawn / seconds, work_ms / std::max(1, drawn), frame.ms_per_step,
        frame.realtime_factor, qPrintable(view.renderer_name()));
    // A twentieth of a usual screen: below that the hand loses the tissue.
    EXPECT_GT(drawn / seconds, 3.0);
  }
  QPoint wall() {
    auto& view = window().views().tissue_view();
    return {view.width() * 2 / 5, view.height() / 2};
  }
};

TEST_F(FrameRate, WhileTheViewIsTurned) {
  drag(window().views().tissue_view(), wall(), {-40, -30});
  circle("turned");
}

TEST_F(FrameRate, WhileTheSampleIsPulled) {
  trigger("tool3");
  drag(window().views().tissue_view(), wall(), {-40, -30});
  ASSERT_TRUE(wait_for([this] { return workbench().last_frame()->grab_origin_mm.has_value(); }));
  circle("pulled");
}

}  // namespace
}  // namespace palpate::testing
