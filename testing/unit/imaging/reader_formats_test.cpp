// Small files of DICOM, written byte by byte here, and what is no scan at all.
#include "format_support.hpp"

#include <algorithm>

namespace {

using palpate::core::Provenance;
using palpate::imaging::read;
using palpate::imaging::ReadOptions;
using namespace palpate::testing;

class ReaderFormats : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "scan.mha";
};

TEST_F(ReaderFormats, UltrasoundFramesAreTimeAndRegionsGiveMillimetres) {
  const auto path = folder_ / "cine.dcm";
  SmallImage image;
  image.sop = "1.2.840.10008.5.1.4.1.1.3.1";
  image.frames = "2";
  image.frame_time = "40";
  image.regions = SmallImage::region(0.05);
  image.pixels += std::string(8, '\x9');
  image.write(path);
  const auto sequence = read(path);
  EXPECT_EQ(sequence.info.geometry.dims(), (std::array<int, 3>{4, 2, 1}));
  ASSERT_EQ(sequence.frames.size(), 2U);
  EXPECT_EQ(sequence.frames[0].at(3, 1, 0), 7.0F);
  EXPECT_EQ(sequence.frames[1].at(0, 0, 0), 9.0F);
  EXPECT_EQ(sequence.info.frame_times_s, (std::vector<double>{0.0, 0.04}));
  EXPECT_DOUBLE_EQ(sequence.info.geometry.spacing_mm()[0], 0.5);
  EXPECT_EQ(sequence.info.spacing_provenance[0], Provenance::stated);
  EXPECT_EQ(sequence.info.time_provenance, Provenance::stated);
  EXPECT_EQ(sequence.info.modality, "US");
  image.regions += SmallImage::region(0.08);
  image.write(path);
  const auto two = read(path);
  EXPECT_TRUE(warned(two, "several-regions"));
  EXPECT_TRUE(warned(two, "assumed-spacing"));
  image.frames = "1A";
  image.write(path);
  EXPECT_EQ(error_code(path), "bad-header");
  image.frames = "3";
  image.write(path);
  EXPECT_EQ(error_code(path), "truncated");
}

TEST_F(ReaderFormats, ASeriesIsSortedByPlaceAndOtherSeriesAreChosenFrom) {
  SmallImage image;
  image.sop = "1.2.840.10008.5.1.4.1.1.4";
  image.modality = "MR";
  image.spacing = "2\\3";
  image.orientation = "1\\0\\0\\0\\1\\0";
  for (const int place : {2, 0, 1}) {
    image.instance = std::to_string(9 - place);
    image.position = "5\\6\\" + std::to_string(7 + 4 * place);
    image.pixels.assign(8, static_cast<char>(place));
    image.write(folder_ / ("a" + image.instance));
  }
  const auto sequence = read(folder_.path());
  EXPECT_EQ(sequence.info.geometry.dims(), (std::array<int, 3>{4, 2, 3}));
  EXPECT_EQ(sequence.info.geometry.spacing_mm(), Eigen::Vector3d(3, 2, 4));
  EXPECT_EQ(sequence.info.geometry.origin_mm(), Eigen::Vector3d(5, 6, 7));
  EXPECT_EQ(sequence.info.spacing_provenance[2], Provenance::derived);
  for (int k = 0; k < 3; ++k) EXPECT_EQ(sequence.frames.at(0).at(0, 0, k), static_cast<float>(k));
  image.series = "1.2.4";
  image.write(folder_ / "b");
  EXPECT_EQ(error_code(folder_.path()), "several-series");
  ReadOptions options;
  options.series_uid = "1.2.4";
  EXPECT_EQ(read(folder_.path(), options).info.geometry.dims()[2], 1);
  options.series_uid = "1.2.5";
  EXPECT_EQ(error_code(folder_.path(), options), "not-found");
  image.series = "1.2.3";
  image.instance = "20";
  image.orientation = "0\\1\\0\\0\\0\\1";
  image.write(folder_ / "c");
  options.series_uid = "1.2.3";
  // Now the series holds two stacks: neither is taken unasked.
  EXPECT_EQ(error_code(folder_.path(), options), "several-series");
  options.series_uid = "1.2.3#1";
  EXPECT_EQ(read(folder_.path(), options).info.geometry.dims()[2], 3);
  options.series_uid = "1.2.3#2";
  EXPECT_EQ(read(folder_.path(), options).info.geometry.dims()[2], 1);
}

TEST_F(ReaderFormats, NamesWhatIsNoScan) {
  EXPECT_EQ(error_code(folder_ / "nothing.mha"), "not-found");
  write_bytes(folder_ / "notes.txt", "no scan");
  EXPECT_EQ(error_code(folder_ / "notes.txt"), "unsupported");
  EXPECT_EQ(error_code(folder_.path()), "no-image");
  write_bytes(folder_ / "empty.dcm", "");
  EXPECT_EQ(error_code(folder_ / "empty.dcm"), "unsupported");
  write_mha(file_, "2 1 1", "MET_UCHAR", "ab");
  const auto reports = palpate::imaging::inspect({folder_.path(), folder_ / "gone"});
  ASSERT_EQ(reports.size(), 4U);
  EXPECT_EQ(std::count_if(reports.begin(), reports.end(), [](const auto& report) { return report.ok; }), 1);
}

}  // namespace
