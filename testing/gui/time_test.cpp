#include "filtered_frames.hpp"
#include "frame_clock.hpp"
#include "time_bar.hpp"
#include "window_fixture.hpp"

#include "palpate/imaging/phantom.hpp"
#include "palpate/imaging/writer.hpp"
#include "palpate/session/pipeline.hpp"

#include <QFile>
#include <QLabel>
#include <QPushButton>
#include <QSlider>
#include <QToolButton>

#include <algorithm>

namespace palpate::testing {
namespace {

using gui::FrameClock;

TEST(FrameClockTest, FollowsTheRecordedTimesAndDropsWhatIsOver) {
  // Frames 0.1, 0.3 and 0.2 s long; the last as long as they are on average.
  const FrameClock clock(4, {1.0, 1.1, 1.4, 1.6});
  EXPECT_TRUE(clock.rate_is_known());
  EXPECT_DOUBLE_EQ(clock.period_s(), 0.8);
  EXPECT_DOUBLE_EQ(clock.frames_per_s(), 5.0);
  EXPECT_EQ(clock.frame_at(0, 0.05, true), 0);
  EXPECT_EQ(clock.frame_at(0, 0.1, true), 1);
  EXPECT_EQ(clock.frame_at(0, 0.39, true), 1);
  EXPECT_EQ(clock.frame_at(0, 0.65, true), 3);
  EXPECT_EQ(clock.frame_at(2, 0.1, true), 2) << "it goes on from where it was";
  EXPECT_EQ(clock.frame_at(2, 0.2, true), 3);
  EXPECT_EQ(clock.frame_at(0, 0.85, true), 0) << "and begins again";
  EXPECT_EQ(clock.frame_at(0, 100.0, false), 3) << "without loop it stays at the end";
  // Half a millionth of a second: far more than sums of four doubles lose.
  EXPECT_NEAR(clock.wait_s(0, 0.05), 0.05, 5e-7);
  EXPECT_NEAR(clock.wait_s(3, 0.1), 0.1, 5e-7) << "until the first frame again";
}

TEST(FrameClockTest, WithoutTimesItSaysSoAndTakesTwentyASecond) {
  for (const auto& times :
       std::vector<std::vector<double>>{{}, {0.0, 0.0, 0.0}, {0.0, 0.2, 0.1}, {0.0, 0.1}}) {
    const FrameClock clock(3, times);
    EXPECT_FALSE(clock.rate_is_known());
    EXPECT_DOUBLE_EQ(clock.frames_per_s(), 20.0);
    EXPECT_EQ(clock.frame_at(0, 0.11, true), 2);
  }
}

TEST(FilteredFramesTest, KeepsTheLastUsedOfOneChain) {
  const auto frame = [](float value) {
    return core::Volume(core::ImageGeometry({10, 10, 1}, {1, 1, 1}, {0, 0, 0}),
                        std::vector<float>(100, value));
  };
  const std::vector<imaging::FilterStep> chain{{"median", {}}};
  gui::FilteredFrames kept;
  kept.set_budget(1000);  // two frames of 100 floats
  kept.put(chain, 0, frame(0));
  kept.put(chain, 1, frame(1));
  ASSERT_TRUE(kept.find(chain, 0));  // now the last used
  kept.put(chain, 2, frame(2));
  EXPECT_TRUE(kept.find(chain, 0));
  EXPECT_FALSE(kept.find(chain, 1)) << "the longest unused went";
  EXPECT_TRUE(kept.find(chain, 2));
  EXPECT_FALSE(kept.find({{"gaussian", {}}}, 2)) << "of another chain";
  kept.put({{"gaussian", {}}}, 2, frame(2));
  EXPECT_EQ(kept.size(), 1U);
}

class Time : public WindowTest {
 protected:
  static constexpr int count = 4;

  void open_beat(double frame_s = 0.2) {
    imaging::PhantomParameters parameters;
    parameters.size = 32;
    parameters.frames = count;
    frames_ = imaging::make_phantom(parameters).frames;
    open_frames("beat.mha", frame_s);
  }
  void open_frames(const char* name, double frame_s) {
    const auto file = folder() / name;
    imaging::write(file, frames_, frame_s, as_bytes());
    make_window();
    window().open(QString::fromStdString(file.string()));
    ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
  }
  bool shows(int frame) {
    const auto& now = workbench().volume();
    const auto& wanted = frames_.at(static_cast<std::size_t>(frame));
    return workbench().frame() == frame && std::equal(now.data(), now.data() + now.size(), wanted.data());
  }
  bool comes_to(int frame) {
    return wait_for([&] { return workbench().wanted_frame() == workbench().frame() && shows(frame); });
  }
  QSlider& slider() { return find<QSlider>("frameSlider"); }
  QString label(const char* name) { return find<QLabel>(name).text(); }

  std::vector<core::Volume> frames_;
};

TEST_F(Time, TheSliderShowsFramesAndTheirTimes) {
  open_beat();
  ASSERT_TRUE(find<QFrame>("timeBar").isVisible());
  EXPECT_EQ(slider().maximum(), count - 1);
  EXPECT_EQ(label("frameLabel"), "frame 1 of 4");
  EXPECT_EQ(label("frameTimeLabel"), "0.00 s");
  slider().setValue(2);
  ASSERT_TRUE(comes_to(2));
  EXPECT_EQ(label("frameLabel"), "frame 3 of 4");
  EXPECT_EQ(label("frameTimeLabel"), "0.40 s");
  EXPECT_EQ(workbench().recipe().input.frame, 2) << "the recipe follows, for the command line";
  // Of many that are asked for at once the last one stays.
  for (const int frame : {0, 3, 1, 3, 0, 1}) slider().setValue(frame);
  EXPECT_TRUE(comes_to(1));
}

TEST_F(Time, ButtonsAndArrowsStepAndGoRound) {
  open_beat();
  click("frameNextButton");
  ASSERT_TRUE(comes_to(1));
  click("frameBackButton");
  ASSERT_TRUE(comes_to(0));
  click("frameBackButton");
  ASSERT_TRUE(comes_to(3));
  slider().setFocus();
  QTest::keyClick(&slider(), Qt::Key_Left);
  ASSERT_TRUE(comes_to(2));
  QTest::keyClick(&slider(), Qt::Key_Right);
  ASSERT_TRUE(comes_to(3));
}

TEST_F(Time, PlaysTheScanApartFromTheSimulation) {
  open_beat(0.05);
  auto& bar = find<gui::TimeBar>("timeBar");
  key(Qt::Key_Space);
  EXPECT_FALSE(bar.playing()) << "Space is the simulation's";
  key(Qt::Key_Space, Qt::ShiftModifier);
  ASSERT_TRUE(bar.playing());
  EXPECT_FALSE(workbench().playing());
  ASSERT_TRUE(wait_for([this] { return workbench().frame() == 2; }));
  ASSERT_TRUE(wait_for([this] { return workbench().frame() < 2; })) << "it begins again";
  click("scanPlayButton");
  EXPECT_FALSE(bar.playing());
  click("loopButton");
  ASSERT_FALSE(find<QToolButton>("loopButton").isChecked());
  click("scanPlayButton");
  ASSERT_TRUE(wait_for([&] { return !bar.playing(); }));
  EXPECT_EQ(workbench().wanted_frame(), count - 1) << "without loop it ends at the last frame";
  EXPECT_EQ(workbench().frame(), count - 1);
}

TEST_F(Time, WithoutTimesItSaysSo) {
  QFile file(QString::fromStdString((folder() / "untimed.nrrd").string()));
  ASSERT_TRUE(file.open(QIODevice::WriteOnly));
  file.write(
      "NRRD0004\ntype: uint8\ndimension: 4\nspace: left-posterior-superior\nsizes: 6 5 4 3\n"
      "space directions: (1,0,0) (0,1,0) (0,0,1) none\nkinds: domain domain domain list\nencoding: raw\n\n");
  QByteArray voxels;
  for (int n = 0; n < 6 * 5 * 4 * 3; ++n) voxels.append(static_cast<char>(n % 100));
  file.write(voxels);
  file.close();
  make_window();
  window().open(file.fileName());
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
  ASSERT_EQ(workbench().frame_count(), 3);
  ASSERT_TRUE(workbench().info().frame_times_s.empty());
  EXPECT_TRUE(label("frameTimeLabel").contains("time not known"));
  EXPECT_TRUE(label("frameTimeLabel").contains("20 frames/s"));
}

TEST_F(Time, AScanOfOneFrameHasNoTimeBar) {
  make_window();
  open_sample();
  EXPECT_FALSE(find<QFrame>("timeBar").isVisible());
}

TEST_F(Time, TissueStaysWithTheFrameItWasBuiltFrom) {
  open_beat();
  slider().setValue(1);
  ASSERT_TRUE(comes_to(1));
  build_tissue();
  EXPECT_EQ(workbench().tissue_frame(), 1);
  EXPECT_FALSE(find<QPushButton>("buildFrameButton").isVisible());
  const auto points = workbench().tissue()->statistics.points;
  slider().setValue(3);
  ASSERT_TRUE(comes_to(3));
  EXPECT_TRUE(workbench().has_tissue());
  EXPECT_EQ(workbench().tissue()->statistics.points, points);
  EXPECT_EQ(label("frameStateLabel"), "tissue is of frame 2");
  click("buildFrameButton");
  ASSERT_TRUE(wait_for([this] { return workbench().tissue_frame() == 3; }, 60000));
  EXPECT_FALSE(find<QPushButton>("buildFrameButton").isVisible());
}

TEST_F(Time, TheChainOfFiltersFollowsWhereItRests) {
  open_beat();
  const std::vector<imaging::FilterStep> chain{{"median", {{"radius_voxels", 1}}}};
  workbench().apply_filters(chain);
  ASSERT_TRUE(wait_for([this] { return workbench().is_filtered(); }));
  slider().setValue(2);
  ASSERT_TRUE(comes_to(2));
  ASSERT_TRUE(wait_for([this] { return workbench().frame_is_filtered(); }));
  const auto expected = session::filter_volume(frames_[2], chain).volume;
  const auto& now = workbench().filtered();
  ASSERT_EQ(now.size(), expected.size());
  EXPECT_TRUE(std::equal(now.data(), now.data() + now.size(), expected.data()));
  // The frame before was filtered already: it is there with its picture.
  slider().setValue(0);
  ASSERT_TRUE(comes_to(0));
  EXPECT_TRUE(workbench().frame_is_filtered());
}

TEST_F(Time, APictureThatMovesFillsTheCentre) {
  for (int frame = 0; frame < count; ++frame)
    frames_.emplace_back(core::ImageGeometry({24, 16, 1}, {0.5, 0.5, 1.0}, {0, 0, 0}),
                         std::vector<float>(24 * 16, static_cast<float>(10 * frame + 1)));
  open_frames("cine.mha", 0.04);
  ASSERT_EQ(workbench().frame_count(), count);
  auto& views = window().views();
  EXPECT_TRUE(views.view(gui::ViewGrid::axial).isVisible());
  for (const auto hidden : {gui::ViewGrid::three_d, gui::ViewGrid::sagittal, gui::ViewGrid::coronal})
    EXPECT_FALSE(views.view(hidden).isVisible());
  // There are no slices to step through: the arrows step frames.
  views.view(gui::ViewGrid::axial).setFocus();
  QTest::keyClick(&views.view(gui::ViewGrid::axial), Qt::Key_Right);
  ASSERT_TRUE(comes_to(1));
  QTest::keyClick(&views.view(gui::ViewGrid::axial), Qt::Key_Left);
  ASSERT_TRUE(comes_to(0));
  // One slice makes no tissue; that is said before anybody presses.
  EXPECT_FALSE(find<QPushButton>("buildButton").isEnabled());
  EXPECT_TRUE(find<QWidget>("TissuePanel").findChild<QLabel*>("noteLabel")->text().contains("single slice"));
  // A volume brings all views back.
  window().open(sample_path());
  ASSERT_TRUE(wait_for([this] { return workbench().frame_count() == 1; }));
  EXPECT_TRUE(views.view(gui::ViewGrid::three_d).isVisible());
  EXPECT_TRUE(find<QPushButton>("buildButton").isEnabled());
}

}  // namespace
}  // namespace palpate::testing
