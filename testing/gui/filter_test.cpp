#include "filter_history.hpp"
#include "panels/filter_panel.hpp"
#include "panels/side_panel.hpp"
#include "text.hpp"
#include "window_fixture.hpp"

#include "palpate/imaging/speckle.hpp"

#include <QCheckBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QPushButton>
#include <QToolButton>

#include <algorithm>

namespace palpate::testing {
namespace {

using imaging::FilterStep;

class FilterStage : public WindowTest {
 protected:
  void SetUp() override {
    make_window();
    open_sample();
  }
  QLabel& note() { return *find<QWidget>("FilterPanel").findChild<QLabel*>("noteLabel"); }
  gui::SliceWidget& axial() { return find<gui::SliceWidget>("axialView"); }
  bool settle() {
    return wait_for([this] { return workbench().preview().settled(); });
  }
  void apply() {
    find<QPushButton>("applyFilterButton").click();
    ASSERT_TRUE(wait_for([this] { return !workbench().jobs().busy(gui::JobLane::filter); }));
  }
  void open_filters() {
    auto& header = find<gui::StepHeader>("filterHeader");
    if (!header.isChecked()) header.click();
  }
  /// The picture of a view, as it is drawn now.
  static QImage picture(gui::GlView& view) { return view.grabFramebuffer(); }
};

void expect_same_voxels(const core::Volume& a, const core::Volume& b) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_TRUE(std::equal(a.data(), a.data() + a.size(), b.data()));
}

TEST_F(FilterStage, AChainIsBuiltReorderedSwitchedAndApplied) {
  trigger("add_median");
  trigger("add_gaussian");
  find<QDoubleSpinBox>("filter1_radius_voxels").setValue(2);
  find<QDoubleSpinBox>("filter2_sigma_mm").setValue(1.5);
  EXPECT_EQ(find<QDoubleSpinBox>("filter1_radius_voxels").suffix(), QStringLiteral(" voxels"));
  EXPECT_EQ(find<QDoubleSpinBox>("filter2_sigma_mm").suffix(), QStringLiteral(" mm"));
  EXPECT_FALSE(find<QToolButton>("filterUp1").isEnabled());
  EXPECT_FALSE(find<QToolButton>("filterDown2").isEnabled());
  find<QToolButton>("filterUp2").click();
  // The parameters went with their filters.
  EXPECT_EQ(find<QDoubleSpinBox>("filter1_sigma_mm").value(), 1.5);
  EXPECT_EQ(find<QDoubleSpinBox>("filter2_radius_voxels").value(), 2.0);
  trigger("add_mean");
  find<QCheckBox>("filterOn1").setChecked(false);
  find<QToolButton>("filterRemove3").click();
  apply();
  const std::vector<FilterStep> expected{{"median", {{"radius_voxels", 2.0}}}};
  EXPECT_EQ(workbench().recipe().filters, expected);
  expect_same_voxels(workbench().filtered(), imaging::apply_filters(workbench().volume(), expected).volume);
  auto& header = find<gui::StepHeader>("filterHeader");
  EXPECT_TRUE(header.done());
  EXPECT_EQ(header.result(), QStringLiteral("Median, 2 voxels"));
  EXPECT_TRUE(find<gui::StepHeader>("tissueHeader").isChecked());
  open_filters();
  EXPECT_FALSE(find<QCheckBox>("filterOn1").isChecked()) << "what is off stays for later";
  EXPECT_FALSE(find<QPushButton>("applyFilterButton").isEnabled()) << "it was applied";
}

TEST_F(FilterStage, ThePreviewFiltersTheSlicesThatAreSeenAndNothingElse) {
  const QImage before = picture(axial());
  trigger("add_median");
  ASSERT_TRUE(workbench().preview().active());
  ASSERT_TRUE(settle());
  const int axis = axial().view().axis();
  const auto slice = workbench().preview().slice(axis, axial().slice());
  ASSERT_TRUE(slice.has_value());
  expect_same_voxels(*slice,
                     imaging::filter_slice(workbench().volume(), {{"median", {}}}, axis, axial().slice()));
  EXPECT_NE(picture(axial()), before);
  EXPECT_EQ(workbench().filtered().data(), workbench().volume().data()) << "nothing was applied";
  EXPECT_TRUE(find<QLabel>("previewLabel").isVisible());

  // Another slice, another parameter: both follow.
  axial().step_slices(3);
  EXPECT_FALSE(workbench().preview().settled());
  ASSERT_TRUE(settle());
  EXPECT_TRUE(workbench().preview().slice(axis, axial().slice()).has_value());
  find<QDoubleSpinBox>("filter1_radius_voxels").setValue(3);
  EXPECT_FALSE(workbench().preview().settled());
  ASSERT_TRUE(settle());
  expect_same_voxels(*workbench().preview().slice(axis, axial().slice()),
                     imaging::filter_slice(workbench().volume(), {{"median", {{"radius_voxels", 3.0}}}}, axis,
                                           axial().slice()));

  // The preview ends with the step.
  find<gui::StepHeader>("tissueHeader").click();
  EXPECT_FALSE(workbench().preview().active());
  open_filters();
  EXPECT_TRUE(workbench().preview().active());
}

TEST_F(FilterStage, CompareHeldDownShowsTheScanWithoutFilters) {
  trigger("add_gaussian");
  apply();
  open_filters();
  auto& compare = find<QPushButton>("compareButton");
  ASSERT_TRUE(compare.isEnabled());
  EXPECT_EQ(workbench().content().volume.data(), workbench().filtered().data());
  QTest::mousePress(&compare, Qt::LeftButton);
  EXPECT_TRUE(workbench().comparing());
  EXPECT_EQ(workbench().content().volume.data(), workbench().volume().data());
  QTest::mouseRelease(&compare, Qt::LeftButton);
  EXPECT_FALSE(workbench().comparing());
  EXPECT_EQ(workbench().content().volume.data(), workbench().filtered().data());
}

TEST_F(FilterStage, UndoAndRedoBringTheSameVolumesBack) {
  EXPECT_FALSE(find<QAction>("actionUndo").isEnabled());
  trigger("add_median");
  apply();
  const core::Volume median = workbench().filtered();
  open_filters();
  trigger("add_gaussian");
  apply();
  const core::Volume both = workbench().filtered();
  const auto applied = workbench().recipe().filters;
  ASSERT_TRUE(find<QAction>("actionUndo").isEnabled());

  trigger("actionUndo");
  EXPECT_EQ(workbench().filtered().data(), median.data()) << "kept, not computed again";
  EXPECT_EQ(workbench().recipe().filters.size(), 1U);
  EXPECT_EQ(window().findChild<QWidget*>("filterCard2"), nullptr) << "the panel follows";
  trigger("actionUndo");
  EXPECT_EQ(workbench().filtered().data(), workbench().volume().data());
  EXPECT_TRUE(workbench().recipe().filters.empty());
  EXPECT_FALSE(find<gui::StepHeader>("filterHeader").done());
  EXPECT_FALSE(workbench().speckle().has_value());
  EXPECT_FALSE(find<QAction>("actionUndo").isEnabled());

  trigger("actionRedo");
  trigger("actionRedo");
  EXPECT_EQ(workbench().filtered().data(), both.data());
  EXPECT_EQ(workbench().recipe().filters, applied);
  EXPECT_TRUE(workbench().speckle().has_value());
  EXPECT_FALSE(find<QAction>("actionRedo").isEnabled());
}

TEST_F(FilterStage, AFilterIsUndoneAfterThePullsAndTakesTheTissueAlong) {
  trigger("add_median");
  apply();
  build_tissue();
  ASSERT_TRUE(wait_for([this] { return workbench().simulation_ready(); }));
  EXPECT_TRUE(workbench().undoes_filter());
  EXPECT_TRUE(find<QAction>("actionUndo").text().contains(QStringLiteral("filter")));
  // A reset is a step of the simulation's own.
  trigger("actionStep");
  ASSERT_TRUE(
      wait_for([this] { return workbench().last_frame() && workbench().last_frame()->time_s > 0.0; }));
  trigger("actionReset");
  ASSERT_TRUE(wait_for([this] { return workbench().last_frame()->can_undo; }));
  EXPECT_FALSE(workbench().undoes_filter());
  trigger("actionUndo");
  ASSERT_TRUE(wait_for([this] { return !workbench().last_frame()->can_undo; }));
  EXPECT_TRUE(workbench().has_tissue());
  EXPECT_TRUE(workbench().is_filtered());
  trigger("actionUndo");
  EXPECT_FALSE(workbench().is_filtered());
  EXPECT_FALSE(workbench().has_tissue());
}

TEST_F(FilterStage, SpeckleIsMeasuredAndWhatIsNotStableIsSaid) {
  trigger("add_gradient-diffusion");
  find<QDoubleSpinBox>("filter1_time_step").setValue(5.0);
  apply();
  ASSERT_TRUE(workbench().speckle().has_value());
  const auto before = imaging::measure_speckle(workbench().volume());
  EXPECT_EQ(workbench().speckle()->before.snr, before.snr);
  EXPECT_GT(workbench().speckle()->after.snr, before.snr);
  open_filters();
  EXPECT_TRUE(find<QLabel>("speckleLabel").text().contains(gui::short_number(before.snr)));
  auto& bar = find<QWidget>("messageBar");
  EXPECT_TRUE(bar.isVisible());
  EXPECT_TRUE(find<QLabel>("messageText").text().contains(QStringLiteral("time step")));
}

TEST_F(FilterStage, APreviewThatCannotBeDoneSaysWhy) {
  // A narrow voxel: 20 mm are more than a hundred of them.
  workbench().state_spacing(std::array<double, 3>{0.05, 0.05, 0.05});
  trigger("add_gaussian");
  find<QDoubleSpinBox>("filter1_sigma_mm").setValue(20.0);
  ASSERT_TRUE(
      wait_for([this] { return find<QLabel>("previewLabel").text().contains(QStringLiteral("at most")); }));
  find<QDoubleSpinBox>("filter1_sigma_mm").setValue(0.05);
  ASSERT_TRUE(settle());
  EXPECT_FALSE(find<QLabel>("previewLabel").text().contains(QStringLiteral("at most")));
}

core::Volume small_volume(float value) {
  const core::ImageGeometry geometry({10, 10, 10}, Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero());
  return {geometry, std::vector<float>(1000, value)};
}

TEST(FilterHistory, KeepsWithinItsBudgetButTheLastStep) {
  gui::FilterHistory history;
  history.set_budget(3 * 4000);
  for (int n = 0; n < 6; ++n)
    history.put({{{"median", {{"radius_voxels", 1.0 + n}}}}, 0, small_volume(static_cast<float>(n)), {}});
  EXPECT_EQ(history.held_bytes(), 3U * 4000U);
  gui::AppliedFilters now{{}, 0, small_volume(9.0F), {}};
  now = history.undo(now);
  EXPECT_EQ(now.volume.at(0, 0, 0), 5.0F);
  EXPECT_TRUE(history.can_redo());
  history.put(now);
  EXPECT_FALSE(history.can_redo()) << "another way was taken";
  history.set_budget(10);
  history.put({{}, 0, small_volume(7.0F), {}});
  EXPECT_TRUE(history.can_undo()) << "the last step back is always there";
}

}  // namespace
}  // namespace palpate::testing
