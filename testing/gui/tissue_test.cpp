#include "panels/side_panel.hpp"
#include "text.hpp"
#include "window_fixture.hpp"

#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QSlider>
#include <QSpinBox>

#include <algorithm>
#include <fstream>

namespace palpate::testing {
namespace {

class TissueStep : public WindowTest {
 protected:
  void SetUp() override {
    make_window();
    open_sample();
    ASSERT_TRUE(wait_for([this] { return workbench().estimate().has_value(); }));
  }
  QString text(const char* name) { return find<QLabel>(name).text(); }
};

TEST_F(TissueStep, PointsAreCountedAndTheRestIsMarkedAsEstimated) {
  // Independent count: voxels at or over the threshold, without dropping pieces.
  find<QSpinBox>("minComponentSpin").setValue(1);
  find<QDoubleSpinBox>("thresholdSpin");
  find<QCheckBox>("thresholdAuto").setChecked(false);
  find<QDoubleSpinBox>("thresholdSpin").setValue(60);
  ASSERT_TRUE(wait_for([this] { return workbench().estimate().has_value(); }));
  const auto& volume = workbench().volume();
  const auto bright =
      std::count_if(volume.data(), volume.data() + volume.size(), [](float v) { return v >= 60.0F; });
  EXPECT_EQ(text("pointsValue"), gui::grouped(static_cast<qulonglong>(bright)));
  EXPECT_TRUE(text("memoryValue").startsWith(QStringLiteral("≈ ")));
  EXPECT_TRUE(text("stepValue").startsWith(QStringLiteral("≈ ")));
  if (workbench().estimate()->tissue.sampled) {
    EXPECT_TRUE(text("linksValue").startsWith(QStringLiteral("≈ ")));
    EXPECT_TRUE(text("componentsValue").startsWith(QStringLiteral("≈ ")));
  }
}

TEST_F(TissueStep, BuildingShowsTheRealNumbersAndOpensTheNextStep) {
  build_tissue();
  const auto& statistics = workbench().tissue()->statistics;
  EXPECT_EQ(text("pointsValue"), gui::grouped(statistics.points));
  EXPECT_EQ(text("linksValue"), gui::grouped(statistics.links));
  for (const char* name : {"pointsValue", "linksValue", "componentsValue", "memoryValue", "stepValue"}) {
    EXPECT_FALSE(text(name).contains(QStringLiteral("≈"))) << name;
  }
  EXPECT_TRUE(find<gui::StepHeader>("tissueHeader").done());
  EXPECT_TRUE(find<gui::StepHeader>("simulateHeader").isChecked());
  ASSERT_NE(workbench().surface().mesh, nullptr);
  EXPECT_FALSE(workbench().surface().mesh->empty());
}

TEST_F(TissueStep, AChangeIsEstimatedAgainAndSaysWhatItReplaces) {
  build_tissue();
  find<gui::StepHeader>("tissueHeader").click();
  auto* note = find<QWidget>("TissuePanel").findChild<QLabel*>("noteLabel");
  ASSERT_NE(note, nullptr);
  EXPECT_FALSE(note->isVisible());
  const QString built = text("pointsValue");
  find<QSpinBox>("strideSpin").setValue(2);
  EXPECT_TRUE(note->isVisible());
  EXPECT_FALSE(note->text().isEmpty());
  ASSERT_TRUE(wait_for([this] { return workbench().estimate().has_value(); }));
  EXPECT_NE(text("pointsValue"), built);
  EXPECT_TRUE(text("stepValue").startsWith(QStringLiteral("≈ ")));
  EXPECT_TRUE(workbench().has_tissue()) << "nothing is dropped before the user builds";
}

TEST_F(TissueStep, MovingTheSliderTurnsTheAutomaticThresholdOff) {
  EXPECT_TRUE(find<QCheckBox>("thresholdAuto").isChecked());
  EXPECT_FALSE(workbench().recipe().tissue.threshold_low.has_value());
  find<QSlider>("thresholdSlider").setValue(700);
  EXPECT_FALSE(find<QCheckBox>("thresholdAuto").isChecked());
  ASSERT_TRUE(workbench().recipe().tissue.threshold_low.has_value());
  const auto& range = workbench().volume().range();
  // The field beside it shows whole numbers.
  EXPECT_NEAR(*workbench().recipe().tissue.threshold_low, range.min + 0.7 * (range.max - range.min), 0.51);
}

TEST_F(TissueStep, AFilterChangesTheVolumeAndDropsTheTissue) {
  build_tissue();
  find<gui::StepHeader>("filterHeader").click();
  auto* note = find<QWidget>("FilterPanel").findChild<QLabel*>("noteLabel");
  EXPECT_TRUE(note->isVisible()) << "it says beforehand what it drops";
  trigger("add_median");
  click("applyFilterButton");
  ASSERT_TRUE(wait_for([this] { return !workbench().has_tissue(); }));
  EXPECT_EQ(workbench().recipe().filters.size(), 1U);
  EXPECT_NE(workbench().filtered().data(), workbench().volume().data());
  EXPECT_FALSE(find<gui::StepHeader>("tissueHeader").done());
  EXPECT_TRUE(find<gui::StepHeader>("tissueHeader").isChecked());
}

TEST_F(TissueStep, AMeshFileTakesThePlaceOfTheScansSurface) {
  // Two triangles in the scan, in a file that says which way its axes point.
  const auto path = folder() / "patch.obj";
  std::ofstream(path) << "# SPACE=RAS\nv 0 0 0\nv 10 0 0\nv 0 10 0\nv 10 10 2\nf 1 2 3\nf 2 4 3\n";
  workbench().set_surface_mesh(QString::fromStdString(path.string()), surface::MeshSpace::automatic);
  EXPECT_EQ(find<QComboBox>("surfaceCombo").currentIndex(), 1);
  build_tissue();
  EXPECT_EQ(workbench().surface().mesh->triangles.size(), 2U);
  const QString label = find<QLabel>("meshLabel").text();
  EXPECT_TRUE(label.contains("patch.obj") && label.contains("RAS, stated")) << label.toStdString();
  // RAS in the file, LPS here: x and y change their sign.
  EXPECT_EQ(workbench().surface().mesh->vertices_mm[1], Eigen::Vector3f(-10, 0, 0));
  workbench().set_surface_mesh({}, surface::MeshSpace::automatic);
  EXPECT_EQ(find<QComboBox>("surfaceCombo").currentIndex(), 0);
  EXPECT_FALSE(find<QLabel>("meshLabel").isVisibleTo(&window()));
}

TEST_F(TissueStep, AThresholdOverEverythingSaysSo) {
  find<QCheckBox>("thresholdAuto").setChecked(false);
  model::TissueParameters none = workbench().recipe().tissue;
  none.threshold_low = 1e6;
  workbench().set_tissue_parameters(none);
  workbench().build_tissue();
  ASSERT_TRUE(wait_for([this] { return find<QFrame>("messageBar").isVisible(); }));
  EXPECT_FALSE(workbench().has_tissue());
}

TEST_F(TissueStep, ABuildThatIsStoppedLeavesNothing) {
  window().open(noise_volume("noise.mha", 128));
  ASSERT_TRUE(wait_for([this] { return workbench().input_name() == "noise.mha"; }));
  workbench().build_tissue();
  ASSERT_TRUE(wait_for([this] {
    const auto* stop = window().findChild<QAbstractButton*>("cancelJob");
    return stop != nullptr && stop->isVisible();
  }));
  click("cancelJob");
  EXPECT_FALSE(workbench().jobs().busy(gui::JobLane::tissue)) << "the line goes at once";
  // The worker takes jobs in order: when this one is done the stopped one has come to its end.
  bool done = false;
  workbench().jobs().start(
      gui::JobLane::devices, {},
      [&](const core::Progress&) -> gui::JobTracker::Delivery { return [&] { done = true; }; }, {});
  ASSERT_TRUE(wait_for([&] { return done; }));
  EXPECT_FALSE(workbench().has_tissue());
  EXPECT_FALSE(find<QFrame>("messageBar").isVisible()) << "what the user stopped is no error";
}

}  // namespace
}  // namespace palpate::testing
