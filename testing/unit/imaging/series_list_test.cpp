// A folder is told by its headers and one picture of each series.
#include "reader_files.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

namespace {

using palpate::core::Error;
using palpate::core::Provenance;
using palpate::imaging::inspect_headers;
using palpate::imaging::list_series;
using palpate::imaging::SeriesSummary;
using namespace palpate::testing;

class SeriesList : public ::testing::Test {
 protected:
  void TearDown() override { unsetenv("PALPATE_READER"); }
  void pretend(const std::string& script) {
    write_bytes(folder_ / "fake", "#!/bin/sh\n" + script + "\n");
    std::filesystem::permissions(folder_ / "fake", std::filesystem::perms::owner_all);
    setenv("PALPATE_READER", (folder_ / "fake").c_str(), 1);
  }
  static std::string real() { return (program_folder() / "palpate-reader").string(); }
  /// Slices of 4 x 2 pixels, `gap_mm` apart.
  void slices(const std::filesystem::path& folder, const std::string& series, int count, double gap_mm) {
    std::filesystem::create_directories(folder);
    for (int n = 0; n < count; ++n) {
      SmallImage image;
      image.sop = "1.2.840.10008.5.1.4.1.1.4";
      image.modality = "MR";
      image.series = series;
      image.instance = std::to_string(n + 1);
      image.position = "0\\0\\" + std::to_string(gap_mm * n);
      image.orientation = "1\\0\\0\\0\\1\\0";
      image.spacing = "0.5\\0.5";
      image.write(folder / (series + "-" + std::to_string(n) + ".dcm"));
    }
  }
  const SeriesSummary* find(const std::vector<SeriesSummary>& all, const std::string& name) {
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const auto& one) { return one.path.filename() == name; });
    return found == all.end() ? nullptr : &*found;
  }

  TemporaryFolder folder_;
  std::filesystem::path scans_ = folder_ / "scans";
};

TEST_F(SeriesList, TellsEverySeriesAndOtherScanOnce) {
  slices(scans_ / "mr", "1.2.3", 3, 2.0);
  slices(scans_ / "mr", "1.2.4", 5, 1.0);
  write_mha(scans_ / "cube.mha", "2 3 4", "MET_UCHAR", std::string(24, 'a'), "ElementSpacing = 1 2 3\n");
  write_bytes(scans_ / "notes.txt", "no scan");
  write_bytes(scans_ / "broken.mha", "NDims = 0\n");
  const auto all = list_series(scans_);
  ASSERT_EQ(all.size(), 4U);
  EXPECT_TRUE(
      std::is_sorted(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.path < b.path; }));
  const auto* broken = find(all, "broken.mha");
  ASSERT_NE(broken, nullptr);
  EXPECT_EQ(broken->error_code, "bad-header");
  const auto* cube = find(all, "cube.mha");
  ASSERT_NE(cube, nullptr);
  EXPECT_EQ(cube->error_code, "");
  EXPECT_EQ(cube->files, 1U);
  EXPECT_EQ(cube->info.geometry.dims(), (std::array<int, 3>{2, 3, 4}));
  EXPECT_EQ(cube->info.spacing_provenance[0], Provenance::stated);
  std::vector<std::size_t> files;
  for (const auto& one : all) {
    if (one.path != scans_ / "mr") continue;
    EXPECT_EQ(one.info.modality, "MR");
    EXPECT_EQ(one.info.geometry.dims()[2], static_cast<int>(one.files));
    EXPECT_EQ(one.info.max, 0.0) << "pixels were read";
    files.push_back(one.files);
    // What it names is what read() takes.
    palpate::imaging::ReadOptions options;
    options.series_uid = one.info.series_uid;
    EXPECT_EQ(palpate::imaging::read(one.path, options).info.geometry, one.info.geometry);
  }
  std::sort(files.begin(), files.end());
  EXPECT_EQ(files, (std::vector<std::size_t>{3, 5}));
}

TEST_F(SeriesList, TheThumbnailIsTheMiddleSliceWithSquarePixels) {
  // 256 x 64 voxels of 1 x 2 mm, three slices of which the middle one rises along i.
  std::filesystem::create_directories(scans_);
  std::string voxels;
  for (int k = 0; k < 3; ++k)
    for (int j = 0; j < 64; ++j)
      for (int i = 0; i < 256; ++i) voxels.push_back(k == 1 ? static_cast<char>(i) : '\7');
  write_mha(scans_ / "ramp.mha", "256 64 3", "MET_UCHAR", voxels, "ElementSpacing = 1 2 1\n");
  const auto all = list_series(scans_);
  ASSERT_EQ(all.size(), 1U);
  const auto& picture = all[0].thumbnail;
  EXPECT_EQ(picture.width_px, 128);
  EXPECT_EQ(picture.height_px, 64);  // 128 mm of 256
  ASSERT_EQ(picture.rgba.size(), 128U * 64U * 4U);
  for (int x = 0; x < 128; ++x) {
    const auto* pixel = &picture.rgba[static_cast<std::size_t>(4 * (128 * 32 + x))];
    // Dark to bright from the 0.5 to the 99.5 percentile of 0..255: 2 x + 0.5, stretched by 255 / 253.
    EXPECT_NEAR(pixel[0], 2.0 * x + 0.5, 3.0) << x;
    EXPECT_EQ(pixel[0], pixel[1]);
    EXPECT_EQ(pixel[0], pixel[2]);
    EXPECT_EQ(pixel[3], 255);
  }
}

TEST_F(SeriesList, ABrokenFileNeverStopsIt) {
  std::filesystem::create_directories(scans_);
  for (int n = 0; n < 6; ++n)
    write_mha(scans_ / ("scan" + std::to_string(n) + ".mha"), "2 2 1", "MET_UCHAR", "abcd");
  // A reader that tells of each in turn, and dies at two of them.
  pretend(R"(tail -n +2 <&3 | tr '\0' '\n' > )" + (folder_ / "paths").string() + R"(
while read -r path; do
  case $path in *scan2*|*scan4*) kill -SEGV $$;; esac
  echo "{\"item\":{\"error\":{\"code\":\"no-image\",\"text\":\"$path\"}}}" >&4
done < )" +
          (folder_ / "paths").string() + R"(
echo '{"result":{}}' >&4)");
  const auto all = list_series(scans_);
  ASSERT_EQ(all.size(), 6U);
  for (const auto& one : all) {
    const std::string name = one.path.filename().string();
    EXPECT_EQ(one.error_code, name == "scan2.mha" || name == "scan4.mha" ? "reader-crashed" : "no-image")
        << name;
    EXPECT_NE(one.error_text.find(name), std::string::npos) << one.error_text;
  }
}

TEST_F(SeriesList, APictureThatEndsItsReaderCostsOnlyItself) {
  std::filesystem::create_directories(scans_);
  write_mha(scans_ / "a.mha", "2 2 1", "MET_UCHAR", "abcd");
  write_mha(scans_ / "b.mha", "2 2 1", "MET_UCHAR", "abcd");
  const std::string volume =
      R"({"item":{"volume":{"format":"x","modality":"","sop_class":"","series_uid":"","description":"","date":"",)"
      R"("scanner":"","frames":1,"frame_times_s":[],"dims":[2,2,1],"spacing_mm":[1,1,1],"origin_mm":[0,0,0],)"
      R"("direction":[1,0,0,0,1,0,0,0,1],"components":1,"pixel_type":"uint8","min":0,"max":0,"mean":0,)"
      R"("provenance":{"spacing":["stated","stated","stated"],"origin":"absent","direction":"absent",)"
      R"("time":"absent"},"patient_axes":false,"orientation":"LPS","orientation_choices":[],"warnings":[]}}})";
  const std::string risk = R"({"risk":"a.mha holds pixels that cannot be decoded."})";
  pretend("case $1 in --describe) ;; *) exec " + real() +
          " \"$@\";; esac\nif grep -aq a.mha /proc/self/fd/3; then echo '" + volume + "' >&4; echo '" + risk +
          "' >&4; kill -ABRT $$; fi\nexec " + real() + " \"$@\"");
  const auto all = list_series(scans_);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].info.geometry.dims(), (std::array<int, 3>{2, 2, 1}));
  EXPECT_EQ(all[0].error_code, "unsupported");
  EXPECT_EQ(all[0].error_text, "a.mha holds pixels that cannot be decoded.");
  EXPECT_EQ(all[0].thumbnail.width_px, 0);
  EXPECT_EQ(all[1].error_code, "");
  EXPECT_EQ(all[1].thumbnail.width_px, 2);
}

TEST_F(SeriesList, NoPixelsAreNeeded) {
  // A native file without its last pixels would be refused as truncated; one whose frames are
  // compressed in a way that nobody knows has a header all the same.
  slices(scans_, "1.2.3", 2, 1.0);
  const auto reports = inspect_headers({scans_});
  ASSERT_EQ(reports.size(), 1U);
  ASSERT_TRUE(reports[0].ok) << reports[0].error_text;
  EXPECT_EQ(reports[0].volumes.at(0).geometry.dims(), (std::array<int, 3>{4, 2, 2}));
  EXPECT_EQ(reports[0].volumes.at(0).max, 0.0);
}

TEST_F(SeriesList, ThousandsOfSlicesAreOneSeries) {
  const int count = repetitions(300, 2000);
  slices(scans_, "1.2.3", count, 0.5);
  std::vector<double> told;
  const auto all = list_series(scans_, {[&](double done, const std::string&) { told.push_back(done); }, {}});
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].files, static_cast<std::size_t>(count));
  EXPECT_EQ(all[0].info.geometry.dims()[2], count);
  EXPECT_DOUBLE_EQ(all[0].info.geometry.spacing_mm()[2], 0.5);
  EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
  EXPECT_EQ(told.back(), 1.0);
}

TEST_F(SeriesList, TheRangeOfManyFramesIsTakenSomeAtATime) {
  // 128 MB in the (sparse) file and 512 MB as voxels: more than the reader may use at once.
  const auto scan = folder_ / "beat.mha";
  write_mha(scan, "200 200 100 32", "MET_UCHAR", "");
  const auto header = std::filesystem::file_size(scan);
  std::filesystem::resize_file(scan, header + 200 * 200 * 100 * 32 - 1);
  std::ofstream(scan, std::ios::binary | std::ios::app).put('\100');
  palpate::imaging::ReaderLimits limits;
  limits.memory_bytes = std::size_t{360} << 20;
  try {
    palpate::imaging::read(scan, {}, {}, limits);
    FAIL() << "it fits after all";
  } catch (const Error& error) {
    EXPECT_THAT(error.code(), ::testing::AnyOf("too-large", "reader-memory"));
  }
  const auto reports = palpate::imaging::inspect({scan}, {}, {}, limits);
  ASSERT_EQ(reports.size(), 1U);
  ASSERT_TRUE(reports[0].ok) << reports[0].error_text;
  const auto& info = reports[0].volumes.at(0);
  EXPECT_EQ(info.frames, 32);
  EXPECT_EQ(info.min, 0.0);
  EXPECT_EQ(info.max, 64.0);  // the last voxel of the last frame
  EXPECT_DOUBLE_EQ(info.mean, 64.0 / (200.0 * 200.0 * 100.0 * 32.0));
}

TEST_F(SeriesList, CanBeCancelledAndSaysWhatIsNotThere) {
  slices(scans_, "1.2.3", 2, 1.0);
  const palpate::core::CancelToken cancel;
  const palpate::core::Progress progress([&](double, const std::string&) { cancel.cancel(); }, cancel);
  try {
    list_series(scans_, progress);
    FAIL() << "it was listed";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), palpate::core::ErrorKind::cancelled);
  }
  try {
    list_series(folder_ / "nowhere");
    FAIL() << "it was listed";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), "not-found");
  }
}

}  // namespace
