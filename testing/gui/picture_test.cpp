#include "panels/side_panel.hpp"
#include "window_fixture.hpp"

#include <QComboBox>
#include <QDialog>
#include <QFileInfo>
#include <QImage>
#include <QLabel>
#include <QLineEdit>
#include <QListWidget>
#include <QSet>
#include <QSpinBox>

namespace palpate::testing {
namespace {

class Pictures : public WindowTest {
 protected:
  void SetUp() override {
    make_window();
    open_sample();
  }
  void open_dialog() {
    key(Qt::Key_P, Qt::ControlModifier | Qt::ShiftModifier);
    ASSERT_TRUE(wait_for([this] { return window().findChild<QDialog*>("pictureDialog") != nullptr; }));
  }
};

TEST_F(Pictures, IsSavedAtTheSizeThatWasAskedFor) {
  build_tissue();
  open_dialog();
  const QString path = QString::fromStdString((folder() / "picture.png").string());
  EXPECT_FALSE(find<QLineEdit>("pathEdit").text().contains("sample")) << "a scan's name may be a patient's";
  find<QLineEdit>("pathEdit").setText(path);
  find<QSpinBox>("widthSpin").setValue(642);
  find<QSpinBox>("heightSpin").setValue(481);
  click("saveButton");
  ASSERT_TRUE(wait_for([this] {
    return find<gui::StepHeader>("pictureHeader").done() || find<QFrame>("messageBar").isVisible();
  }));
  const QImage picture(path);
  ASSERT_FALSE(picture.isNull()) << find<QLabel>("messageText").text().toStdString();
  EXPECT_EQ(picture.size(), QSize(642, 481));
  QSet<QRgb> colours;
  for (int y = 0; y < picture.height(); y += 3) {
    for (int x = 0; x < picture.width(); x += 3) colours.insert(picture.pixel(x, y));
  }
  EXPECT_GT(colours.size(), 100) << "speckle and a shaded surface hold many colours";
}

TEST_F(Pictures, TheDialogListsEveryTextAndPreviews) {
  open_dialog();
  auto& list = find<QListWidget>("textList");
  QSet<QString> listed;
  for (int row = 0; row < list.count(); ++row) listed.insert(list.item(row)->text());
  visualization::PictureRequest request;
  for (const auto& text :
       visualization::burned_in_text(workbench().content(), window().views().picture_settings(), request)) {
    EXPECT_TRUE(listed.contains(QString::fromStdString(text))) << text;
  }
  for (const QString& text : listed) EXPECT_FALSE(text.contains("sample")) << "no file name is burned in";
  // The note names the size once the preview was drawn.
  ASSERT_TRUE(wait_for([this] { return find<QLabel>("previewNote").text().contains("1600"); }));
}

TEST_F(Pictures, AFolderThatIsNotThereIsSaid) {
  open_dialog();
  find<QLineEdit>("pathEdit").setText(QString::fromStdString((folder() / "nowhere" / "a.png").string()));
  find<QSpinBox>("widthSpin").setValue(64);
  find<QSpinBox>("heightSpin").setValue(64);
  click("saveButton");
  ASSERT_TRUE(wait_for([this] { return find<QFrame>("messageBar").isVisible(); }));
  EXPECT_FALSE(find<gui::StepHeader>("pictureHeader").done());
  EXPECT_TRUE(find<QAbstractButton>("messageCopyButton").isVisible());
}

}  // namespace
}  // namespace palpate::testing
