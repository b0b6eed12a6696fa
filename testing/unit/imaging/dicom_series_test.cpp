// Slices of classic series and the volumes that they make or do not make.
// Written by DCMTK here; every expected number follows from it by hand.
#include "dicom_checks.hpp"

#include <gtest/gtest.h>

namespace {

using palpate::core::Provenance;
using palpate::core::VolumeInfo;
using palpate::core::VolumeSequence;
using palpate::imaging::read;
using namespace palpate::testing;

class ClassicSeries : public ::testing::Test {
 protected:
  /// Slices whose voxels all hold `value`, at z.
  ClassicSlice slice(double z, int value, int number) {
    ClassicSlice made;
    made.position = "0\\0\\" + std::to_string(z);
    made.uid = std::to_string(number);
    made.value = [value](int, int, int) { return value; };
    return made;
  }
  void write(const ClassicSlice& made) { made.write(folder_ / ("slice" + std::to_string(++files_))); }
  void write_row(const std::vector<double>& places) {
    for (std::size_t n = 0; n < places.size(); ++n)
      write(slice(places[n], static_cast<int>(100 * (n + 1)), static_cast<int>(n + 1)));
  }
  TemporaryFolder folder_;
  int files_ = 0;
};

TEST_F(ClassicSeries, ATiltedGantryKeepsItsSlant) {
  // A tilt whose tangent is 1/2: axes (1,0,0) and (0,2,-1)/sqrt(5), steps of (0,0,5).
  for (int n = 0; n < 4; ++n) {
    ClassicSlice made = slice(5.0 * n, n, 9 - n);
    made.orientation = "1\\0\\0\\0\\0.894427191\\-0.447213595";
    write(made);
  }
  const VolumeInfo info = read(folder_.path()).info;
  EXPECT_EQ(info.geometry.dims()[2], 4);
  // Cosines of nine digits, over 3 steps of 5 mm.
  EXPECT_LT((step(info, 2) - Eigen::Vector3d(0, 0, 5)).norm(), 1e-7);
  EXPECT_NEAR(info.geometry.spacing_mm()[2], 5.0, 1e-7);
  const std::string text = warning_text(info, "gantry-tilt");
  EXPECT_NE(text.find("26.56"), std::string::npos) << text;  // atan(1/2) in degrees
}

TEST_F(ClassicSeries, UnevenSlicesAreResampledToTheSmallestGap) {
  write_row({0, 5, 10, 20});
  const VolumeSequence sequence = read(folder_.path());
  const VolumeInfo& info = sequence.info;
  EXPECT_EQ(info.geometry.dims()[2], 5);
  EXPECT_DOUBLE_EQ(info.geometry.spacing_mm()[2], 5.0);
  EXPECT_EQ(info.spacing_provenance[2], Provenance::derived);
  // 100, 200, 300 and 400 at 0, 5, 10 and 20: 350 half way at 15.
  const float expected[] = {100, 200, 300, 350, 400};
  for (int k = 0; k < 5; ++k) EXPECT_EQ(sequence.frames.at(0).at(2, 1, k), expected[k]) << k;
  EXPECT_NE(warning_text(info, "uneven-slices").find("5, 5, 10 mm"), std::string::npos);
}

TEST_F(ClassicSeries, GapsThatAreNoMultiplesAreResampledToo) {
  write_row({0, 3, 7});  // 7 mm in two steps of 3.5
  const VolumeSequence sequence = read(folder_.path());
  EXPECT_EQ(sequence.info.geometry.dims()[2], 3);
  EXPECT_DOUBLE_EQ(sequence.info.geometry.spacing_mm()[2], 3.5);
  EXPECT_FLOAT_EQ(sequence.frames.at(0).at(0, 0, 1), 212.5F);  // 0.5 of 4 mm beyond 200
  EXPECT_EQ(sequence.frames.at(0).at(0, 0, 2), 300.0F);
}

TEST_F(ClassicSeries, AMissingChunkIsRefusedWithItsGap) {
  write_row({0, 2, 4, 30});
  const std::string text = refusal_of(folder_.path());
  EXPECT_EQ(text.substr(0, 9), "no-volume");
  EXPECT_NE(text.find("26 mm lie between slice 3 and slice 4"), std::string::npos) << text;
}

TEST_F(ClassicSeries, RoundedPositionsAreEvenSlices) {
  write_row({0, 0.6, 1.3, 1.9, 2.5});  // 0.625 mm with one digit
  const VolumeInfo info = read(folder_.path()).info;
  EXPECT_EQ(info.geometry.dims()[2], 5);
  EXPECT_DOUBLE_EQ(info.geometry.spacing_mm()[2], 0.625);
}

TEST_F(ClassicSeries, CopiesAreDroppedAndRivalsRefused) {
  write_row({0, 1, 2});
  write(slice(1, 200, 17));  // the second again, under another number
  const VolumeInfo info = read(folder_.path()).info;
  EXPECT_EQ(info.geometry.dims()[2], 3);
  EXPECT_EQ(info.frames, 1);
  EXPECT_NE(warning_text(info, "duplicate-slices").find("1 slice is a copy"), std::string::npos);
  write(slice(1, 205, 18));  // and one that differs, and nothing says why
  const std::string text = refusal_of(folder_.path());
  EXPECT_EQ(text.substr(0, 9), "no-volume");
  EXPECT_NE(text.find("between 1 and 2 different slices"), std::string::npos) << text;
}

TEST_F(ClassicSeries, AFileThatWasCopiedIsLeftOut) {
  write_row({0, 1, 2});
  std::filesystem::copy_file(folder_ / "slice2", folder_ / "slice2 (copy)");
  const VolumeInfo three = read(folder_.path()).info;
  EXPECT_EQ(three.geometry.dims()[2], 3);
  EXPECT_TRUE(warned(three, "duplicate-slices"));
  for (const char* name : {"slice1", "slice3"}) std::filesystem::remove(folder_ / name);
  const VolumeInfo one = read(folder_.path()).info;
  EXPECT_EQ(one.geometry.dims()[2], 1);
  EXPECT_EQ(one.frames, 1);
  EXPECT_TRUE(warned(one, "duplicate-slices"));
}

TEST_F(ClassicSeries, PlacesMayDifferALittleFromTimeToTime) {
  for (int t = 0; t < 3; ++t)
    for (int k = 0; k < 2; ++k) {
      ClassicSlice made = slice(3.6 * k + 0.005 * t, 10 * k + t, 1 + 2 * t + k);
      made.extra = {{temporal_position, std::to_string(t + 1)}};
      write(made);
    }
  const VolumeInfo info = read(folder_.path()).info;
  EXPECT_EQ(info.frames, 3);
  EXPECT_EQ(info.geometry.dims()[2], 2);
  EXPECT_NEAR(info.geometry.spacing_mm()[2], 3.6, 1e-6);  // of the first time; six digits are written
}

TEST_F(ClassicSeries, BlocksOfNumbersAreTimesAndSaidToBe) {
  for (int t = 0; t < 2; ++t)
    for (int k = 0; k < 3; ++k) write(slice(4.0 * k, 10 * k + t, 1 + k + 40 * t));
  const VolumeSequence sequence = read(folder_.path());
  EXPECT_EQ(sequence.info.frames, 2);
  EXPECT_EQ(sequence.info.geometry.dims()[2], 3);
  EXPECT_TRUE(sequence.info.frame_times_s.empty());
  EXPECT_EQ(sequence.info.time_provenance, Provenance::absent);
  EXPECT_TRUE(warned(sequence.info, "assumed-times"));
  EXPECT_EQ(sequence.frames.at(1).at(0, 0, 2), 21.0F);
}

TEST_F(ClassicSeries, NumbersWithoutAnOrderAreNoTimes) {
  const int numbers[2][3] = {{1, 3, 4}, {2, 6, 5}};
  for (int t = 0; t < 2; ++t)
    for (int k = 0; k < 3; ++k) write(slice(4.0 * k, 10 * k + t, numbers[t][k]));
  EXPECT_EQ(refusal_of(folder_.path()).substr(0, 9), "no-volume");
}

TEST_F(ClassicSeries, TwoEqualSetsAreOneVolume) {
  for (int t = 0; t < 2; ++t)
    for (int k = 0; k < 3; ++k) write(slice(4.0 * k, 10 * k, 1 + k + 40 * t));
  const VolumeInfo info = read(folder_.path()).info;
  EXPECT_EQ(info.frames, 1);
  EXPECT_NE(warning_text(info, "duplicate-slices").find("3 slices are copies"), std::string::npos);
}

TEST_F(ClassicSeries, TriggerTimesAreTimes) {
  for (int t = 0; t < 3; ++t)
    for (int k = 0; k < 2; ++k) {
      ClassicSlice made = slice(8.0 * k, 10 * k + t, 1 + 3 * k + t);
      made.extra = {{trigger_time, std::to_string(50 * t + 10)}};
      write(made);
    }
  const VolumeSequence sequence = read(folder_.path());
  EXPECT_EQ(sequence.info.frames, 3);
  ASSERT_EQ(sequence.info.frame_times_s.size(), 3U);
  EXPECT_NEAR(sequence.info.frame_times_s[1], 0.05, 1e-12);
  EXPECT_NEAR(sequence.info.frame_times_s[2], 0.1, 1e-12);
  EXPECT_EQ(sequence.info.time_provenance, Provenance::stated);
  EXPECT_EQ(sequence.frames.at(2).at(0, 0, 1), 12.0F);
}

TEST_F(ClassicSeries, ClockTimesAreDerivedTimes) {
  // Slices of one time are taken one after another, and over midnight's minute.
  for (int t = 0; t < 2; ++t)
    for (int k = 0; k < 2; ++k) {
      ClassicSlice made = slice(8.0 * k, 10 * k + t, 7 - 2 * t - k);
      made.extra = {
          {acquisition_time, std::string("1200") + (t == 0 ? "00." : "02.") + (k == 0 ? "00" : "50")}};
      write(made);
    }
  const VolumeSequence sequence = read(folder_.path());
  EXPECT_EQ(sequence.info.frame_times_s, (Times{0.0, 2.0}));
  EXPECT_EQ(sequence.info.time_provenance, Provenance::derived);
  EXPECT_EQ(sequence.frames.at(1).at(0, 0, 0), 1.0F);
}

TEST_F(ClassicSeries, ATimeThatLacksASliceIsLeftOut) {
  for (int t = 0; t < 3; ++t)
    for (int k = 0; k < 3; ++k) {
      if (t == 1 && k == 2) continue;
      ClassicSlice made = slice(8.0 * k, 10 * k + t, 1 + 3 * t + k);
      made.extra = {{temporal_position, std::to_string(t + 1)}};
      write(made);
    }
  const VolumeSequence sequence = read(folder_.path());
  EXPECT_EQ(sequence.info.frames, 2);
  EXPECT_EQ(sequence.frames.at(1).at(0, 0, 1), 12.0F);
  EXPECT_NE(warning_text(sequence.info, "incomplete-times").find("1 of 3"), std::string::npos);
}

TEST_F(ClassicSeries, EchoesAreFramesButNoTimes) {
  for (int echo = 0; echo < 2; ++echo)
    for (int k = 0; k < 2; ++k) {
      ClassicSlice made = slice(8.0 * k, 10 * k + echo, 1 + 2 * k + echo);
      made.extra = {{echo_time, echo == 0 ? "30" : "90"}};
      write(made);
    }
  const VolumeInfo info = read(folder_.path()).info;
  EXPECT_EQ(info.frames, 2);
  EXPECT_TRUE(info.frame_times_s.empty());
  EXPECT_NE(warning_text(info, "frames-not-time").find("echo time"), std::string::npos);
}

TEST_F(ClassicSeries, WhatIsNoVolumeIsNamed) {
  write(slice(0, 1, 1));
  ClassicSlice sagittal = slice(0, 2, 2);
  sagittal.orientation = "0\\1\\0\\0\\0\\-1";
  write(sagittal);
  ClassicSlice coronal = slice(0, 3, 3);
  coronal.orientation = "1\\0\\0\\0\\0\\-1";
  write(coronal);
  const std::string localizer = refusal_of(folder_.path());
  EXPECT_EQ(localizer.substr(0, 9), "no-volume");
  for (const char* word : {"localizer", "1 axial", "1 sagittal", "1 coronal"})
    EXPECT_NE(localizer.find(word), std::string::npos) << localizer;
}

/// One series may hold stacks in several directions, as plans of an examination do.
TEST_F(ClassicSeries, StacksOfOneSeriesAreChosenByTheirNumber) {
  for (int k = 0; k < 3; ++k) write(slice(4.0 * k, 10 * k, 1 + k));
  for (int k = 0; k < 2; ++k) {
    ClassicSlice sagittal = slice(0, 10 * k, 11 + k);
    sagittal.position = std::to_string(5 * k) + "\\0\\0";
    sagittal.orientation = "0\\1\\0\\0\\0\\-1";
    write(sagittal);
  }
  const std::string several = refusal_of(folder_.path());
  EXPECT_EQ(several.substr(0, 14), "several-series") << several;
  EXPECT_NE(several.find("#1 (MR, 3 files"), std::string::npos) << several;
  EXPECT_NE(several.find("#2 (MR, 2 files"), std::string::npos) << several;

  const auto listed = palpate::imaging::list_series(folder_.path());
  ASSERT_EQ(listed.size(), 2U);
  for (const auto& summary : listed) {
    palpate::imaging::ReadOptions options;
    options.series_uid = summary.info.series_uid;
    const VolumeInfo info = read(folder_.path(), options).info;
    EXPECT_EQ(info.series_uid, options.series_uid);
    const bool axial = info.geometry.dims()[2] == 3;
    EXPECT_EQ(info.geometry.dims()[2], axial ? 3 : 2);
    EXPECT_DOUBLE_EQ(info.geometry.spacing_mm()[2], axial ? 4.0 : 5.0);
  }
}

TEST_F(ClassicSeries, SizesAndPixelsMustAgree) {
  write(slice(0, 1, 1));
  ClassicSlice other = slice(1, 2, 2);
  other.columns = 5;
  write(other);
  const std::string sizes = refusal_of(folder_.path());
  EXPECT_NE(sizes.find("1 axial of 5 x 3"), std::string::npos) << sizes;
  other.columns = 4;
  other.spacing = "2\\2";
  other.write(folder_ / "slice2");
  const std::string pixels = refusal_of(folder_.path());
  EXPECT_NE(pixels.find("pixels of different sizes"), std::string::npos) << pixels;
}

TEST_F(ClassicSeries, SlicesBesideEachOtherAreNoVolume) {
  write(slice(0, 1, 1));
  ClassicSlice beside = slice(1, 2, 2);
  beside.position = "90\\0\\1";
  write(beside);
  EXPECT_NE(refusal_of(folder_.path()).find("beside one another"), std::string::npos);
}

TEST_F(ClassicSeries, OneSliceIsAPictureWithItsPlace) {
  ClassicSlice made = slice(7, 1, 1);
  made.orientation = "0\\1\\0\\0\\0\\-1";
  write(made);
  const VolumeInfo info = read(folder_.path()).info;
  EXPECT_EQ(info.geometry.dims(), (Dims{4, 3, 1}));
  EXPECT_EQ(info.geometry.origin_mm(), Eigen::Vector3d(0, 0, 7));
  EXPECT_EQ(info.orientation, "PIR");
  EXPECT_TRUE(info.patient_axes);
}

TEST_F(ClassicSeries, NearlyRightAxesAreRepairedAndOthersRefused) {
  ClassicSlice made = slice(0, 1, 1);
  made.orientation = "1\\0.01\\0\\0\\1\\0";
  const auto path = folder_ / "skew.dcm";
  made.write(path);
  const VolumeInfo info = read(path).info;
  // Both turn by half of the 0.01 rad between them, to first order.
  EXPECT_NEAR(info.geometry.direction()(1, 0), 0.005, 1e-4);
  EXPECT_NEAR(info.geometry.direction()(0, 1), -0.005, 1e-4);
  EXPECT_NE(warning_text(info, "repaired-direction").find("0.01"), std::string::npos);
  made.orientation = "1\\0.5\\0\\0\\1\\0";
  made.write(path);
  const std::string text = refusal_of(path);
  EXPECT_EQ(text.substr(0, 10), "bad-header");
  EXPECT_NE(text.find("0.5"), std::string::npos) << text;
}

}  // namespace
