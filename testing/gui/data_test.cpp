#include "panels/data_panel.hpp"
#include "panels/side_panel.hpp"
#include "provenance_badge.hpp"
#include "scanner_memory.hpp"
#include "stated_geometry.hpp"
#include "text.hpp"
#include "window_fixture.hpp"

#include "palpate/imaging/reader.hpp"
#include "palpate/imaging/writer.hpp"
#include "palpate/testing/dicom_scans.hpp"

#include <QAbstractSpinBox>
#include <QClipboard>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QFile>
#include <QFileInfo>
#include <QGuiApplication>
#include <QLabel>
#include <QPushButton>
#include <QRegularExpression>

#include <algorithm>

namespace palpate::testing {
namespace {

using core::Provenance;
using gui::ProvenanceBadge;

constexpr Provenance all_provenances[] = {Provenance::stated,  Provenance::private_tag, Provenance::derived,
                                          Provenance::assumed, Provenance::user,        Provenance::absent};

TEST(ProvenanceBadgeTest, EachHasAWordAndAHintOfItsOwn) {
  QStringList words, hints;
  for (const auto provenance : all_provenances) {
    ProvenanceBadge badge;
    badge.show_provenance("Spacing", provenance);
    words << badge.word();
    hints << badge.toolTip();
    EXPECT_TRUE(badge.toolTip().startsWith("Spacing: "));
    EXPECT_EQ(badge.accessibleName(), badge.toolTip()) << "for a screen reader too";
  }
  EXPECT_EQ(words, (QStringList{"stated", "private", "derived", "assumed", "user", "absent"}));
  EXPECT_EQ(hints.removeDuplicates(), 0);
}

// In black and white and without the word they are still told apart.
TEST(ProvenanceBadgeTest, EachHasAShapeOfItsOwn) {
  std::vector<QImage> marks;
  for (const auto provenance : all_provenances) {
    ProvenanceBadge badge;
    badge.show_provenance("Spacing", provenance);
    badge.resize(badge.sizeHint());
    const QImage drawn = badge.grab().toImage().copy(5, 4, 10, 10).convertToFormat(QImage::Format_Grayscale8);
    const int ground = qGray(drawn.pixel(0, 0));
    QImage mark(drawn.size(), QImage::Format_Grayscale8);
    for (int y = 0; y < drawn.height(); ++y)
      for (int x = 0; x < drawn.width(); ++x)
        mark.scanLine(y)[x] = qGray(drawn.pixel(x, y)) > ground + 60 ? 255 : 0;
    for (const auto& other : marks) EXPECT_NE(mark, other) << core::to_string(provenance);
    marks.push_back(mark);
  }
}

TEST(ProvenanceBadgeTest, OfSeveralAxesTheLeastCertainIsShown) {
  ProvenanceBadge badge;
  badge.show_axes("Spacing", {Provenance::stated, Provenance::stated, Provenance::derived});
  EXPECT_EQ(badge.word(), "derived");
  EXPECT_TRUE(badge.toolTip().contains("k: worked out")) << badge.toolTip().toStdString();
  EXPECT_EQ(gui::least_certain({Provenance::user, Provenance::assumed, Provenance::stated}),
            Provenance::assumed);
  EXPECT_EQ(gui::least_certain({}), Provenance::absent);
}

TEST(OrientationTest, WordsNameEachAxisOnce) {
  EXPECT_TRUE(gui::is_orientation("RAS"));
  EXPECT_TRUE(gui::is_orientation("PIR"));
  for (const char* wrong : {"", "RA", "RRS", "RAX", "RASS", "LRS"})
    EXPECT_FALSE(gui::is_orientation(wrong)) << wrong;
  EXPECT_EQ(gui::describe_orientation("RAS"), "i → right, j → front, k → head");
  EXPECT_EQ(gui::describe_orientation("PIL"), "i → back, j → feet, k → left");
  core::VolumeInfo info;
  info.orientation_choices = {"LAI", "RPI"};
  const auto offered = gui::orientations_to_offer(info);
  EXPECT_EQ(offered.mid(0, 2), (QStringList{"LAI", "RPI"})) << "what is in use comes first";
  EXPECT_EQ(offered.count("LAI"), 1);
  for (const auto& word : offered) EXPECT_TRUE(gui::is_orientation(word)) << word.toStdString();
}

core::VolumeInfo scanner(const char* name, const char* format = "DICOM") {
  core::VolumeInfo info;
  info.scanner = name;
  info.format = format;
  return info;
}

TEST(ScannerMemoryTest, RemembersPerScannerAndFormat) {
  const TemporaryFolder folder;
  const QString file = QString::fromStdString((folder / "memory.ini").string());
  {
    QSettings settings(file, QSettings::IniFormat);
    gui::ScannerMemory memory(settings);
    EXPECT_TRUE(memory.orientation(scanner("Philips EPIQ 7C")).isEmpty());
    memory.remember(scanner("Philips EPIQ 7C"), "RAS");
    memory.remember(scanner("GE/Vingmed=100% [E9]"), "LPI");
    memory.remember(scanner(""), "RAS");
    memory.remember(scanner("Philips EPIQ 7C", "NRRD"), "nonsense");
  }
  QSettings settings(file, QSettings::IniFormat);
  gui::ScannerMemory memory(settings);
  EXPECT_EQ(memory.orientation(scanner("Philips EPIQ 7C")), "RAS");
  EXPECT_EQ(memory.orientation(scanner("GE/Vingmed=100% [E9]")), "LPI");
  EXPECT_TRUE(memory.orientation(scanner("")).isEmpty()) << "that would be everybody's";
  EXPECT_TRUE(memory.orientation(scanner("Philips EPIQ 7C", "NRRD")).isEmpty());
  memory.forget(scanner("Philips EPIQ 7C"));
  EXPECT_TRUE(memory.orientation(scanner("Philips EPIQ 7C")).isEmpty());
  core::VolumeInfo settled = scanner("Philips EPIQ 7C");
  EXPECT_TRUE(gui::ScannerMemory::is_open_question(settled));
  settled.patient_axes = true;
  EXPECT_FALSE(gui::ScannerMemory::is_open_question(settled)) << "what a file states is not overruled";
}

QString write_without_spacing(const std::filesystem::path& folder) {
  QFile file(QString::fromStdString((folder / "bare.mha").string()));
  if (!file.open(QIODevice::WriteOnly)) throw std::runtime_error("the folder cannot be written to");
  file.write(
      "ObjectType = Image\nNDims = 3\nDimSize = 12 10 8\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n");
  QByteArray voxels;
  for (int n = 0; n < 12 * 10 * 8; ++n) voxels.append(static_cast<char>(n % 200));
  file.write(voxels);
  return file.fileName();
}

// Laying out anew is the same as reading again with the same statements.
TEST(StatedGeometryTest, SaysWhatAReadingWithTheSameOptionsSays) {
  const TemporaryFolder folder;
  const std::filesystem::path bare = write_without_spacing(folder / "").toStdString();
  const core::Volume turned(core::ImageGeometry({7, 6, 5}, {0.5, 0.7, 1.5}, {3, -4, 5},
                                                (Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, 1, 0).finished()),
                            std::vector<float>(7 * 6 * 5, 3.0F));
  imaging::write(folder / "turned.nrrd", {turned});
  for (const std::filesystem::path& path : {bare, folder / "turned.nrrd"}) {
    const auto file = imaging::read(path);
    for (const char* orientation : {"", "file", "RAS", "PIR"}) {
      for (const auto& spacing :
           {std::optional<std::array<double, 3>>(), std::optional<std::array<double, 3>>({0.4, 0.5, 0.25})}) {
        imaging::ReadOptions options;
        options.orientation = orientation;
        options.spacing_mm = spacing;
        const auto again = imaging::read(path, options);
        const auto info = gui::restated(file.info, spacing, orientation);
        EXPECT_EQ(info.geometry, again.info.geometry) << path << ' ' << orientation;
        EXPECT_EQ(info.orientation, again.info.orientation);
        EXPECT_EQ(info.patient_axes, again.info.patient_axes);
        EXPECT_EQ(info.spacing_provenance, again.info.spacing_provenance);
        EXPECT_EQ(info.direction_provenance, again.info.direction_provenance);
        const auto codes = [](const core::VolumeInfo& of) {
          QStringList list;
          for (const auto& warning : of.warnings) list << QString::fromStdString(warning.code);
          return list;
        };
        EXPECT_EQ(codes(info), codes(again.info)) << path << ' ' << orientation;
        const auto volume = gui::laid_out(file.frames.front(), info.geometry);
        EXPECT_EQ(volume.geometry(), info.geometry);
        EXPECT_EQ(volume.data(), file.frames.front().data()) << "no voxel is copied";
      }
    }
  }
}

class Data : public WindowTest {
 protected:
  void open(const QString& path) {
    make_window();
    window().open(path);
    ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
    find<gui::StepHeader>("dataHeader").click();
  }
  QString label(const char* name) { return find<QLabel>(name).text(); }
  QString badge(const char* name) { return find<ProvenanceBadge>(name).word(); }
  void hover_axial() {
    auto& view = window().views().view(gui::ViewGrid::axial);
    const QPoint place = view.rect().center();
    QMouseEvent move(QEvent::MouseMove, place, view.mapToGlobal(place), Qt::NoButton, Qt::NoButton,
                     Qt::NoModifier);
    QApplication::sendEvent(&view, &move);
  }
  /// Every text of the window that holds a length in millimetres, but for the
  /// fields in which the user states them.
  QStringList millimetres() {
    static const QRegularExpression mm(QStringLiteral("\\bmm\\b"));
    QStringList found;
    for (auto* widget : window().findChildren<QWidget*>()) {
      if (widget->objectName() == "warningsLabel") continue;  // says what was assumed
      if (widget->objectName().startsWith("spacing") && qobject_cast<QDoubleSpinBox*>(widget) != nullptr)
        continue;
      QString text;
      if (auto* shown = qobject_cast<QLabel*>(widget)) text = shown->text();
      if (auto* header = qobject_cast<gui::StepHeader*>(widget)) text = header->result();
      if (auto* spin = qobject_cast<QDoubleSpinBox*>(widget)) text = spin->text();
      if (mm.match(text).hasMatch()) found << widget->objectName() + ": " + text;
    }
    return found;
  }
};

TEST_F(Data, WhatTheFileStatesIsShownWithWhereItCameFrom) {
  open(sample_path());
  EXPECT_EQ(badge("spacingBadge"), "stated");
  EXPECT_EQ(badge("originBadge"), "stated");
  EXPECT_EQ(badge("directionBadge"), "stated");
  EXPECT_FALSE(find<ProvenanceBadge>("timesBadge").isVisible()) << "one frame has no times";
  EXPECT_EQ(label("directionValue"), "LPS");
  EXPECT_EQ(label("orientationMeaning"), "i → left, j → back, k → head");
  EXPECT_TRUE(label("spacingValue").endsWith(" mm"));
  EXPECT_FALSE(find<QWidget>("spacingBox").isVisible());
}

TEST_F(Data, WhileTheSpacingIsAssumedNothingIsInMillimetres) {
  open(write_without_spacing(folder() / ""));
  ASSERT_TRUE(workbench().info().spacing_is_assumed());
  hover_axial();
  EXPECT_TRUE(label("cursorLabel").startsWith("voxel "));
  EXPECT_EQ(badge("spacingBadge"), "assumed");
  EXPECT_TRUE(find<QWidget>("spacingBox").isVisible()) << "the fields to state it stand open";
  build_tissue();
  hover_axial();
  EXPECT_EQ(millimetres().join('\n').toStdString(), "");
  find<gui::StepHeader>("dataHeader").click();
  EXPECT_TRUE(find<QDoubleSpinBox>("radiusSpin").text().endsWith(" voxels"));

  find<QDoubleSpinBox>("spacingX").setValue(0.25);
  find<QDoubleSpinBox>("spacingY").setValue(0.25);
  find<QDoubleSpinBox>("spacingZ").setValue(0.5);
  EXPECT_TRUE(find<gui::DataPanel>("DataPanel").findChild<QLabel*>("noteLabel")->isVisible())
      << "it says before what is dropped";
  click("applySpacingButton");
  EXPECT_FALSE(workbench().has_tissue()) << "it was built of other lengths";
  EXPECT_EQ(workbench().volume().geometry().spacing_mm(), Eigen::Vector3d(0.25, 0.25, 0.5));
  EXPECT_EQ(badge("spacingBadge"), "user");
  EXPECT_EQ(label("spacingValue"), "0.25 × 0.25 × 0.5 mm");
  hover_axial();
  EXPECT_TRUE(label("cursorLabel").contains(" mm"));
  EXPECT_TRUE(find<QDoubleSpinBox>("radiusSpin").text().endsWith(" mm"));
  EXPECT_EQ(workbench().recipe().input.spacing_mm, (std::array<double, 3>{0.25, 0.25, 0.5}));
  click("fileSpacingButton");
  EXPECT_EQ(badge("spacingBadge"), "assumed");
  EXPECT_FALSE(workbench().recipe().input.spacing_mm.has_value());
}

TEST_F(Data, AnOrientationIsChosenAndTakenBack) {
  open(sample_path());
  auto& combo = find<QComboBox>("orientationCombo");
  EXPECT_EQ(combo.currentText(), "As the file says: LPS");
  const auto choose = [&](int index) {
    combo.setCurrentIndex(index);
    emit combo.activated(index);
  };
  const int ras = combo.findData("RAS");
  ASSERT_GE(ras, 0);
  choose(ras);
  EXPECT_EQ(workbench().volume().geometry().direction(),
            Eigen::Vector3d(-1, -1, 1).asDiagonal().toDenseMatrix());
  EXPECT_EQ(badge("directionBadge"), "user");
  EXPECT_EQ(label("orientationMeaning"), "i → right, j → front, k → head");
  EXPECT_EQ(combo.currentData().toString(), "RAS");
  EXPECT_EQ(workbench().recipe().input.orientation, "RAS");
  choose(0);
  EXPECT_EQ(badge("directionBadge"), "stated");
  EXPECT_EQ(workbench().volume().geometry().direction(), Eigen::Matrix3d::Identity());
  // The wheel over a combo that has not the focus scrolls the panel instead.
  find<QPushButton>("openScanButton").setFocus();
  QWheelEvent wheel(QPointF(5, 5), combo.mapToGlobal(QPoint(5, 5)), {}, {0, -120}, Qt::NoButton,
                    Qt::NoModifier, Qt::NoScrollPhase, false);
  QApplication::sendEvent(&combo, &wheel);
  EXPECT_EQ(combo.currentIndex(), 0);
}

/// Files of this kind leave open how the patient lay; so does each of the three.
TEST_F(Data, AnOrientationIsRememberedForItsScanner) {
  const auto scan = [this](int number) {
    QlabScan made;
    made.columns = made.rows = made.slices = 8;
    made.value = [number](int i, int j, int k, int) { return 10 * number + i + j + k; };
    const auto path = folder() / ("scan" + std::to_string(number) + ".dcm");
    made.write(path);
    return QString::fromStdString(path.string());
  };
  const auto opened = [this](const QString& path) {
    window().open(path);
    ASSERT_TRUE(wait_for([&] { return workbench().input_name() == QFileInfo(path).fileName(); }));
  };
  open(scan(1));
  EXPECT_FALSE(workbench().info().patient_axes);
  EXPECT_EQ(workbench().info().orientation, "RAS");
  auto& combo = find<QComboBox>("orientationCombo");
  const int other = combo.findData("RPI");
  ASSERT_GE(other, 0);
  combo.setCurrentIndex(other);
  emit combo.activated(other);
  EXPECT_EQ(workbench().info().orientation, "RPI");
  EXPECT_TRUE(workbench().info().patient_axes);

  opened(scan(2));
  EXPECT_EQ(workbench().info().orientation, "RPI");
  EXPECT_TRUE(label("messageText").contains("as you chose last time"));
  click("messageAction");
  EXPECT_EQ(workbench().info().orientation, "RAS");
  EXPECT_FALSE(workbench().info().patient_axes);

  opened(scan(3));
  EXPECT_EQ(workbench().info().orientation, "RAS") << "what was taken back is not remembered";
}

TEST_F(Data, WarningsAreInWordsAndTheirCodesInDetails) {
  open(write_without_spacing(folder() / ""));
  const QString before = label("warningsLabel");
  EXPECT_TRUE(before.contains("how large a voxel is")) << before.toStdString();
  EXPECT_FALSE(before.contains("assumed-spacing"));
  click("warningDetailsButton");
  EXPECT_TRUE(label("warningsLabel").contains("[assumed-spacing]"));
  click("copyReportButton");
  const QString report = QGuiApplication::clipboard()->text();
  EXPECT_TRUE(report.contains("assumed-spacing")) << report.toStdString();
  EXPECT_TRUE(report.contains("size: 12 10 8, 1 frames"));
  EXPECT_FALSE(report.contains("bare.mha")) << "a file's name may hold a patient's";
}

TEST_F(Data, AReportHoldsNothingOfThePatient) {
  core::VolumeInfo info = scanner("Philips EPIQ 7C");
  info.description = "Doe John";
  info.date = "2012-02-15";
  const QString report = gui::geometry_report(info);
  EXPECT_TRUE(report.contains("Philips EPIQ 7C"));
  EXPECT_FALSE(report.contains("Doe"));
  EXPECT_FALSE(report.contains("2012"));
}

}  // namespace
}  // namespace palpate::testing
