#include "panels/side_panel.hpp"
#include "window_fixture.hpp"

#include "palpate/imaging/phantom.hpp"
#include "palpate/imaging/writer.hpp"

#include <QAbstractSlider>
#include <QAbstractSpinBox>
#include <QComboBox>
#include <QDialog>
#include <QDoubleSpinBox>
#include <QFile>
#include <QLabel>
#include <QListWidget>
#include <QMimeData>
#include <QPushButton>
#include <QSpinBox>
#include <QStackedWidget>
#include <QToolButton>

#include <algorithm>

namespace palpate::testing {
namespace {

using gui::StepHeader;

class Opening : public WindowTest {
 protected:
  void SetUp() override { make_window(); }
  bool message_shown() { return find<QFrame>("messageBar").isVisible(); }
  QString message() { return find<QLabel>("messageText").text(); }
};

TEST_F(Opening, AnEmptyWindowOffersWhatToOpen) {
  EXPECT_EQ(find<QStackedWidget>("centre").currentWidget()->objectName(), "emptyState");
  for (const char* name : {"emptyOpenButton", "emptyFolderButton", "emptySampleButton"}) {
    EXPECT_TRUE(find<QPushButton>(name).isVisible()) << name;
  }
  EXPECT_FALSE(find<QAction>("actionSavePicture").isEnabled());
  EXPECT_FALSE(find<QAction>("actionPlayPause").isEnabled());
  EXPECT_FALSE(find<QWidget>("recentBox").isVisible());
}

// Nothing that is worked with may be nameless to a screen reader or without a hint.
TEST_F(Opening, EveryControlHasANameAndAHint) {
  int checked = 0;
  for (auto* widget : window().findChildren<QWidget*>()) {
    const bool control = qobject_cast<QAbstractButton*>(widget) != nullptr ||
                         qobject_cast<QAbstractSpinBox*>(widget) != nullptr ||
                         qobject_cast<QComboBox*>(widget) != nullptr ||
                         qobject_cast<QAbstractSlider*>(widget) != nullptr;
    if (!control || widget->objectName().isEmpty() || widget->objectName().startsWith("qt_")) continue;
    const auto* button = qobject_cast<QAbstractButton*>(widget);
    EXPECT_FALSE(widget->accessibleName().isEmpty() && (button == nullptr || button->text().isEmpty()))
        << widget->objectName().toStdString() << " has no name";
    // A step's hint is its result, which comes with the data.
    if (qobject_cast<StepHeader*>(widget) == nullptr) {
      EXPECT_FALSE(widget->toolTip().isEmpty()) << widget->objectName().toStdString() << " has no hint";
    }
    ++checked;
  }
  EXPECT_GT(checked, 40);
}

TEST_F(Opening, TheSampleFillsTheViewsAndTheFirstStep) {
  open_sample();
  EXPECT_EQ(find<QStackedWidget>("centre").currentWidget()->objectName(), "viewGrid");
  EXPECT_TRUE(find<StepHeader>("dataHeader").done());
  EXPECT_TRUE(find<StepHeader>("dataHeader").result().startsWith("sample heart.mha"));
  EXPECT_TRUE(find<StepHeader>("filterHeader").isChecked()) << "the next step opens by itself";
  ASSERT_TRUE(wait_for([this] { return find<QSlider>("axialSlider").maximum() > 0; }));
  // Each slider spans the image axis whose direction is nearest to the plane's normal.
  const auto& geometry = workbench().volume().geometry();
  const auto last = [&](int lps_axis) {
    return geometry.dims()[static_cast<std::size_t>(geometry.axis_closest_to(lps_axis))] - 1;
  };
  ASSERT_TRUE(wait_for([&] { return find<QSlider>("sagittalSlider").maximum() == last(0); }));
  EXPECT_EQ(find<QSlider>("coronalSlider").maximum(), last(1));
  EXPECT_EQ(find<QSlider>("axialSlider").maximum(), last(2));
  EXPECT_FALSE(message_shown());
}

TEST_F(Opening, AFileThatIsNoScanSaysSoAndCostsNothing) {
  open_sample();
  const auto bad = folder() / "broken.mha";
  QFile file(QString::fromStdString(bad.string()));
  ASSERT_TRUE(file.open(QIODevice::WriteOnly));
  file.write(
      "ObjectType = Image\nNDims = 3\nDimSize = 9 9 9\nElementType = MET_UCHAR\nElementDataFile = "
      "LOCAL\nabc");
  file.close();
  window().open(file.fileName());
  ASSERT_TRUE(wait_for([this] { return message_shown(); }));
  EXPECT_GT(message().size(), 20);
  EXPECT_TRUE(workbench().has_volume()) << "the scan that was open stays";
  EXPECT_EQ(workbench().input_name(), "sample heart.mha");
  EXPECT_EQ(window().recent_files().paths().filter("broken").size(), 0);
  click("messageClose");
  EXPECT_FALSE(message_shown());
}

TEST_F(Opening, WhatWasOpenedIsRemembered) {
  const QString scan = noise_volume("second.mha", 12);
  window().open(scan);
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
  EXPECT_EQ(window().recent_files().paths(), QStringList{scan});
  const QString third = noise_volume("third.mha", 13);
  window().open(third);
  ASSERT_TRUE(wait_for([this] { return workbench().input_name() == "third.mha"; }));
  EXPECT_EQ(window().recent_files().paths(), (QStringList{third, scan}));
  // Ctrl+2 is the one before, in the next window too.
  close_window();
  make_window();
  EXPECT_EQ(find<QListWidget>("recentList").count(), 2);
  key(Qt::Key_2, Qt::ControlModifier);
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
  EXPECT_EQ(workbench().input_name(), "second.mha");
}

TEST_F(Opening, AFileDroppedOnTheWindowOpens) {
  const QString scan = noise_volume("dropped.mha", 12);
  QMimeData data;
  data.setUrls({QUrl::fromLocalFile(scan)});
  QDragEnterEvent enter({50, 50}, Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
  QApplication::sendEvent(&window(), &enter);
  EXPECT_TRUE(enter.isAccepted());
  QDropEvent drop({50, 50}, Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
  QApplication::sendEvent(&window(), &drop);
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
  EXPECT_EQ(workbench().input_name(), "dropped.mha");
}

}  // namespace
}  // namespace palpate::testing
