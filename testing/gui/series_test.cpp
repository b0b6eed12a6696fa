#include "series_dialog.hpp"
#include "series_model.hpp"
#include "window_fixture.hpp"

#include "palpate/imaging/writer.hpp"

#include <QAbstractItemModelTester>
#include <QPushButton>
#include <QSortFilterProxyModel>
#include <QTreeView>

namespace palpate::testing {
namespace {

using gui::SeriesModel;

imaging::SeriesSummary summary(const char* uid, std::array<int, 3> dims, const char* date,
                               const char* scanner) {
  imaging::SeriesSummary one;
  one.path = "/scans/study";
  one.files = 7;
  one.info.format = "DICOM";
  one.info.modality = "MR";
  one.info.series_uid = uid;
  one.info.description = std::string("series ") + uid;
  one.info.date = date;
  one.info.scanner = scanner;
  one.info.geometry = core::ImageGeometry(dims, {0.5, 0.5, 2.0}, {0, 0, 0});
  one.info.spacing_provenance.fill(core::Provenance::stated);
  one.thumbnail.width_px = 8;
  one.thumbnail.height_px = 4;
  one.thumbnail.rgba.assign(8 * 4 * 4, 200);
  return one;
}

// Two studies; the first line is a localizer, which is no volume.
std::vector<imaging::SeriesSummary> three_series() {
  auto localizer = summary("1", {64, 64, 3}, "2012-02-15", "Philips EPIQ 7C");
  localizer.error_code = "no-volume";
  localizer.error_text = "Three planes that cross are no volume.";
  auto cine = summary("3", {32, 32, 1}, "2013-01-01", "");
  cine.info.frames = 20;
  cine.info.spacing_provenance.fill(core::Provenance::assumed);
  cine.thumbnail = {};
  return {localizer, summary("2", {16, 16, 9}, "2012-02-15", "Philips EPIQ 7C"), cine};
}

QString text_at(const QAbstractItemModel& model, int column, int row, int group) {
  return model.index(row, column, model.index(group, 0)).data().toString();
}

TEST(SeriesModelTest, GroupsByStudyAndKeepsTheRulesOfModels) {
  SeriesModel model(three_series());
  const QAbstractItemModelTester tester(&model, QAbstractItemModelTester::FailureReportingMode::Fatal);
  ASSERT_EQ(model.rowCount(), 2);
  EXPECT_EQ(model.index(0, 0).data().toString(), "2012-02-15 · Philips EPIQ 7C");
  EXPECT_EQ(model.index(1, 0).data().toString(), "2013-01-01");
  EXPECT_EQ(model.rowCount(model.index(0, 0)), 2);
  EXPECT_EQ(model.rowCount(model.index(1, 0)), 1);
  EXPECT_EQ(text_at(model, SeriesModel::name_column, 1, 0), "series 2");
  EXPECT_EQ(text_at(model, SeriesModel::modality_column, 1, 0), "MR");
  EXPECT_EQ(text_at(model, SeriesModel::size_column, 1, 0), "16 × 16 × 9");
  EXPECT_EQ(text_at(model, SeriesModel::spacing_column, 1, 0), "0.5 × 0.5 × 2 mm");
  EXPECT_EQ(text_at(model, SeriesModel::files_column, 1, 0), "7");
  EXPECT_EQ(text_at(model, SeriesModel::size_column, 0, 1), "32 × 32") << "a cine has no depth";
  EXPECT_EQ(text_at(model, SeriesModel::frames_column, 0, 1), "20");
  EXPECT_EQ(text_at(model, SeriesModel::spacing_column, 0, 1), "not known") << "no mm that nobody stated";
  const auto picture = [&](int row, int group) {
    return model.index(row, 0, model.index(group, 0)).data(Qt::DecorationRole);
  };
  EXPECT_FALSE(picture(1, 0).isNull());
  EXPECT_TRUE(picture(0, 1).isNull()) << "none could be decoded";
}

TEST(SeriesModelTest, WhatDoesNotOpenIsDisabledAndSaysWhy) {
  const SeriesModel model(three_series());
  const QModelIndex localizer = model.index(0, 0, model.index(0, 0));
  EXPECT_FALSE(model.opens(localizer));
  EXPECT_EQ(model.flags(localizer) & (Qt::ItemIsEnabled | Qt::ItemIsSelectable), 0);
  EXPECT_TRUE(localizer.data().toString().contains("Three planes")) << "not only in a hint";
  EXPECT_EQ(localizer.data(Qt::ToolTipRole).toString(), "Three planes that cross are no volume.");
  EXPECT_TRUE(model.opens(model.index(1, 0, model.index(0, 0))));
  EXPECT_FALSE(model.opens(model.index(0, 0))) << "a group is no series";
}

TEST(SeriesModelTest, SortsNumbersAsNumbers) {
  auto series = three_series();
  for (auto& one : series) {
    one.info.date = "2012-02-15";
    one.info.scanner.clear();
  }
  series[0].files = 100;
  series[1].files = 20;
  series[2].files = 3;
  SeriesModel model(series);
  QSortFilterProxyModel sorted;
  sorted.setSourceModel(&model);
  sorted.setSortRole(SeriesModel::sort_role);
  const QAbstractItemModelTester tester(&sorted, QAbstractItemModelTester::FailureReportingMode::Fatal);
  sorted.sort(SeriesModel::files_column);
  QStringList files;
  for (int row = 0; row < 3; ++row) files << text_at(sorted, SeriesModel::files_column, row, 0);
  EXPECT_EQ(files, (QStringList{"3", "20", "100"}));
}

TEST(SeriesDialogTest, TheFirstThatOpensIsChosenAndTheKeysWork) {
  auto* dialog = new gui::SeriesDialog(three_series(), nullptr);
  QString path, uid;
  QObject::connect(dialog, &gui::SeriesDialog::seriesChosen, [&](const QString& p, const QString& u) {
    path = p;
    uid = u;
  });
  dialog->show();
  auto* tree = dialog->findChild<QTreeView*>("seriesTree");
  ASSERT_NE(tree, nullptr);
  EXPECT_EQ(tree->currentIndex().data().toString(), "series 2") << "the localizer before it does not open";
  EXPECT_TRUE(dialog->findChild<QPushButton*>("openButton")->isEnabled());
  tree->setCurrentIndex(tree->model()->index(0, 0, tree->model()->index(1, 0)));
  QTest::keyClick(tree, Qt::Key_Return);
  EXPECT_EQ(path, "/scans/study");
  EXPECT_EQ(uid, "3");
  EXPECT_FALSE(dialog->isVisible());
}

TEST(SeriesDialogTest, WhereNothingOpensThereIsNothingToChoose) {
  auto series = three_series();
  for (auto& one : series) {
    one.error_code = "no-volume";
    one.error_text = "No volume.";
  }
  const auto dialog = std::make_unique<gui::SeriesDialog>(series, nullptr);
  dialog->show();
  EXPECT_FALSE(dialog->findChild<QPushButton*>("openButton")->isEnabled());
}

class Series : public WindowTest {};

TEST_F(Series, AFolderOfSeveralSeriesAsksWhich) {
  make_window();
  const core::Volume volume(core::ImageGeometry({8, 9, 4}, {1, 1, 2}, {0, 0, 0}),
                            std::vector<float>(8 * 9 * 4, 7.0F));
  const core::Volume other(core::ImageGeometry({6, 6, 5}, {1, 1, 2}, {0, 0, 0}),
                           std::vector<float>(6 * 6 * 5, 9.0F));
  std::filesystem::create_directory(folder() / "study");
  imaging::write_dicom_series(folder() / "study" / "a", volume);
  imaging::write_dicom_series(folder() / "study" / "b", other);
  std::filesystem::create_directory(folder() / "both");
  int number = 0;
  for (const auto& file : std::filesystem::recursive_directory_iterator(folder() / "study")) {
    if (file.is_regular_file()) {
      std::filesystem::copy_file(file.path(), folder() / "both" / (std::to_string(++number) + ".dcm"));
    }
  }
  window().open(QString::fromStdString((folder() / "both").string()));
  ASSERT_TRUE(wait_for([this] {
    const auto* dialog = window().findChild<QDialog*>("seriesDialog");
    return (dialog != nullptr && dialog->isVisible()) || find<QFrame>("messageBar").isVisible();
  }));
  ASSERT_FALSE(find<QFrame>("messageBar").isVisible());
  auto& tree = find<QTreeView>("seriesTree");
  auto* model = tree.model();
  ASSERT_EQ(model->rowCount(), 1) << "of one study";
  const QModelIndex group = model->index(0, 0);
  ASSERT_EQ(model->rowCount(group), 2);
  QModelIndex wanted;
  for (int row = 0; row < 2; ++row) {
    if (model->index(row, SeriesModel::size_column, group).data().toString() == "6 × 6 × 5")
      wanted = model->index(row, 0, group);
    // The picture is there and has its room.
    EXPECT_FALSE(model->index(row, 0, group).data(Qt::DecorationRole).value<QIcon>().isNull());
    EXPECT_GE(tree.visualRect(model->index(row, 0, group)).height(), 64);
    // What is shown of a series holds nothing of whom it is of.
    for (int column = 0; column < SeriesModel::column_count; ++column)
      EXPECT_FALSE(model->index(row, column, group).data().toString().contains("PHANTOM^"));
  }
  ASSERT_TRUE(wanted.isValid());
  tree.setCurrentIndex(wanted);
  tree.scrollTo(wanted);
  const QPoint place = tree.visualRect(wanted).center();
  QTest::mouseClick(tree.viewport(), Qt::LeftButton, Qt::NoModifier, place);
  QTest::mouseDClick(tree.viewport(), Qt::LeftButton, Qt::NoModifier, place);
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
  EXPECT_EQ(workbench().volume().dims(), (std::array<int, 3>{6, 6, 5}));
}

}  // namespace
}  // namespace palpate::testing
