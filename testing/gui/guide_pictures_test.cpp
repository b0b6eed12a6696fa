// The pictures of README.md and docs/user-guide.md, made by using the window
// as the guide tells it. PALPATE_PICTURES names the folder that keeps them;
// without it they go with the test.
#include "panels/side_panel.hpp"
#include "text.hpp"
#include "window_fixture.hpp"

#include <QCheckBox>
#include <QPushButton>
#include <QScreen>

#include <cstdlib>

namespace palpate::testing {
namespace {

class GuidePictures : public WindowTest {
 protected:
  void SetUp() override {
    const char* keep = std::getenv("PALPATE_PICTURES");
    target_ = keep != nullptr ? std::filesystem::path(keep) : folder().path();
    make_window();
    window().resize(1440, 900);
    window().move(0, 0);
  }

  /// What is on the screen over the window, views included.
  void take(const std::string& name) {
    // A round for what a change asks to draw, one for what that drawing asks for, one to be shown.
    for (int round = 0; round < 3; ++round) {
      for (auto* widget : window().findChildren<QWidget*>()) widget->update();
      QCoreApplication::processEvents();
      QGuiApplication::sync();
    }
    // Qt's grab is a pixel larger than asked for under some X servers.
    const QPixmap shot = QGuiApplication::primaryScreen()->grabWindow(window().winId()).copy(0, 0, 1440, 900);
    ASSERT_EQ(window().size(), QSize(1440, 900)) << name;
    const auto path = target_ / (name + ".png");
    ASSERT_TRUE(shot.save(QString::fromStdString(path.string()), "PNG", 0)) << path;
    // A window that drew nothing would pack into a few kilobytes.
    EXPECT_GT(std::filesystem::file_size(path), 20000U) << path;
  }
  bool idle() { return workbench().jobs().jobs().isEmpty(); }
  void open_shipped_sample() {
    window().open(QStringLiteral(PALPATE_SOURCE_DATA "/sample-heart.mha"));
    ASSERT_TRUE(wait_for([this] { return workbench().has_volume() && idle(); }));
  }

 private:
  std::filesystem::path target_;
};

TEST_F(GuidePictures, ABeatingHeartAndWhatIsKnownOfIt) {
  window().open(QStringLiteral(PALPATE_SOURCE_DATA "/sample-heart-beat.mha"));
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume() && idle(); }));
  auto& header = find<gui::StepHeader>("dataHeader");
  if (!header.isChecked()) header.click();
  workbench().show_frame(3);
  ASSERT_TRUE(wait_for([this] { return workbench().frame() == 3 && idle(); }));
  take("time");
}

TEST_F(GuidePictures, FromTheFileToThePulledHeart) {
  take("empty");
  open_shipped_sample();
  take("opened");
  trigger("add_adaptive");
  ASSERT_TRUE(wait_for([this] { return workbench().preview().settled(); }, 60000));
  take("filter");
  click("filterRemove1");
  click("applyFilterButton");
  ASSERT_TRUE(wait_for([this] { return workbench().estimate().has_value() && idle(); }));
  take("estimate");
  click("buildButton");
  ASSERT_TRUE(wait_for([this] { return workbench().simulation_ready() && workbench().last_frame(); }, 60000));
  trigger("tool3");
  auto& view = window().views().tissue_view();
  const QPoint wall(view.width() * 2 / 5, view.height() / 2);
  drag(view, wall, {-70, -50});
  ASSERT_TRUE(wait_for([this] {
    const auto& frame = workbench().last_frame();
    return frame->grab_origin_mm.has_value() && frame->time_s > 0.3;
  }));
  take("window");
  QTest::mouseRelease(&view, Qt::LeftButton, Qt::NoModifier, wall + QPoint(-70, -50));
  ASSERT_TRUE(wait_for([this] { return !workbench().last_frame()->grab_origin_mm.has_value(); }));
  workbench().pause();
  ASSERT_TRUE(wait_for([this] { return !workbench().playing(); }));
  click("showLinks");
  take("links");
}

TEST_F(GuidePictures, FixedPointsAndThePointThatLimitsTheStep) {
  open_shipped_sample();
  click("applyFilterButton");
  ASSERT_TRUE(wait_for([this] { return workbench().estimate().has_value() && idle(); }));
  click("buildButton");
  ASSERT_TRUE(wait_for([this] { return workbench().simulation_ready() && workbench().last_frame(); }, 60000));
  ASSERT_TRUE(wait_for([this] { return workbench().step_limit().has_value() && idle(); }, 60000));
  trigger("tool4");
  auto& view = window().views().tissue_view();
  const QPoint wall(view.width() / 2, view.height() * 5 / 8);
  drag(view, wall, {50, 0});
  QTest::mouseRelease(&view, Qt::LeftButton, Qt::NoModifier, wall + QPoint(50, 0));
  ASSERT_TRUE(wait_for([this] { return workbench().anchors() && !workbench().anchors()->empty(); }));
  click("limitButton");
  // The strip at the bottom follows a little later.
  ASSERT_TRUE(wait_for([this] {
    const auto limit = workbench().step_limit();
    return limit && limit->is_estimate && idle() &&
           find<QAbstractButton>("stepGauge").text().contains(gui::short_time(limit->step_s));
  }));
  take("anchors");
}

}  // namespace
}  // namespace palpate::testing
