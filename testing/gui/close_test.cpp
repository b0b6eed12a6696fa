#include "window_fixture.hpp"

#include <QElapsedTimer>

namespace palpate::testing {
namespace {

// A job looks at its cancel token several times a second; 5 s is far above
// that, and far below what any of these jobs would take on a slow machine.
constexpr int quickly_ms = 5000;

class Closing : public WindowTest {
 protected:
  void SetUp() override { make_window(); }
  void expect_quick_close() {
    QElapsedTimer clock;
    clock.start();
    close_window();
    QCoreApplication::processEvents();  // late deliveries find nobody
    EXPECT_LT(clock.elapsed(), quickly_ms);
    EXPECT_FALSE(has_window());
  }
};

TEST_F(Closing, WhileReading) {
  window().open(noise_volume("large.mha", 200));
  ASSERT_TRUE(wait_for([this] { return workbench().jobs().busy(gui::JobLane::open); }));
  expect_quick_close();
}

TEST_F(Closing, WhileBuilding) {
  window().open(noise_volume("noise.mha", 128));
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
  workbench().build_tissue();
  ASSERT_TRUE(wait_for([this] {
    const auto jobs = workbench().jobs().jobs();
    return !jobs.isEmpty() && jobs.front().fraction > 0.0;
  }));
  expect_quick_close();
}

TEST_F(Closing, WhileFiltering) {
  window().open(noise_volume("noise.mha", 160));
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
  workbench().apply_filters({{"median", {{"radius_voxels", 3.0}}}});
  ASSERT_TRUE(wait_for([this] {
    const auto jobs = workbench().jobs().jobs();
    return !jobs.isEmpty() && jobs.front().running;
  }));
  expect_quick_close();
}

TEST_F(Closing, WhilePlayingWithTheTissueHeld) {
  open_sample();
  build_tissue();
  trigger("tool3");
  auto& view = window().views().tissue_view();
  drag(view, view.rect().center(), {60, 0});
  ASSERT_TRUE(wait_for([this] { return workbench().playing(); }));
  expect_quick_close();
}

}  // namespace
}  // namespace palpate::testing
