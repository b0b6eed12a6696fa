// Where and when the voxels of DICOM scans are. The scans are written by DCMTK
// here; every expected number follows from what is written, by hand.
#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/dicom_scans.hpp"
#include "palpate/testing/support.hpp"

#include <gdcmReader.h>
#include <gdcmSequenceOfItems.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace {

using palpate::core::Provenance;
using palpate::core::VolumeInfo;
using palpate::core::VolumeSequence;
using palpate::imaging::read;
using palpate::imaging::ReadOptions;
using namespace palpate::testing;

using Dims = std::array<int, 3>;
using Times = std::vector<double>;

constexpr Tag frame_time{0x0018, 0x1063}, frame_time_vector{0x0018, 0x1065}, cine_rate{0x0018, 0x0040};
constexpr Tag trigger_time{0x0018, 0x1060}, acquisition_time{0x0008, 0x0032}, echo_time{0x0018, 0x0081};
constexpr Tag temporal_position{0x0020, 0x0100}, instance_number{0x0020, 0x0013};

bool warned(const VolumeInfo& info, const std::string& code) {
  return std::any_of(info.warnings.begin(), info.warnings.end(),
                     [&](const auto& warning) { return warning.code == code; });
}
std::string warning_text(const VolumeInfo& info, const std::string& code) {
  for (const auto& warning : info.warnings)
    if (warning.code == code) return warning.text;
  return "no such warning";
}

class DicomGeometry : public ::testing::Test {
 protected:
  /// The text of the error, its code first.
  std::string refusal(const std::filesystem::path& path, const ReadOptions& options = {}) {
    try {
      read(path, options);
    } catch (const palpate::core::Error& error) {
      EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos) << error.what();
      return error.code() + ": " + error.what();
    }
    return "none";
  }
  /// A step between voxel centres, in LPS mm.
  static Eigen::Vector3d step(const VolumeInfo& info, int axis) {
    return info.geometry.to_lps_mm(Eigen::Vector3d::Unit(axis)) -
           info.geometry.to_lps_mm(Eigen::Vector3d::Zero());
  }
  TemporaryFolder folder_;
};

class UltrasoundPicture : public DicomGeometry {
 protected:
  VolumeInfo open(const std::vector<UsRegion>& regions, const std::string& pixel_spacing = {},
                  const std::vector<std::pair<Tag, std::string>>& tags = {}, int frames = 0) {
    DicomMaker file(frames > 0 ? us_cine_class : us_image_class, "US", "1", "1");
    for (const auto& region : regions) add_region(file.top(), region);
    if (!pixel_spacing.empty()) file.top().text({0x0028, 0x0030}, pixel_spacing);
    for (const auto& [tag, text] : tags) file.top().text(tag, text);
    file.pixels(4, 3, frames, 8, [](int i, int j, int frame) { return i + 4 * j + 20 * frame; });
    const auto path = folder_ / "picture.dcm";
    file.save(path);
    return read(path).info;
  }
};

TEST_F(UltrasoundPicture, ARegionInCentimetresGivesMillimetresInBothDirections) {
  const VolumeInfo info = open({{0.05, 0.06}});
  EXPECT_NEAR(info.geometry.spacing_mm()[0], 0.5, 1e-12);
  EXPECT_NEAR(info.geometry.spacing_mm()[1], 0.6, 1e-12);
  EXPECT_EQ(info.spacing_provenance[0], Provenance::stated);
  EXPECT_EQ(info.spacing_provenance[1], Provenance::stated);
  EXPECT_FALSE(warned(info, "assumed-spacing"));
  // The second library finds what was written.
  gdcm::Reader reader;
  reader.SetFileName((folder_ / "picture.dcm").c_str());
  ASSERT_TRUE(reader.Read());
  const auto regions = reader.GetFile().GetDataSet().GetDataElement(gdcm::Tag(0x0018, 0x6011)).GetValueAsSQ();
  ASSERT_EQ(regions->GetNumberOfItems(), 1U);
  const auto* delta =
      regions->GetItem(1).GetNestedDataSet().GetDataElement(gdcm::Tag(0x0018, 0x602E)).GetByteValue();
  double value = 0.0;
  ASSERT_EQ(delta->GetLength(), sizeof(value));
  std::memcpy(&value, delta->GetPointer(), sizeof(value));
  EXPECT_EQ(value, 0.06);
}

TEST_F(UltrasoundPicture, OnlyPlacesInCentimetresCount) {
  // A spectrum and an M-mode beside the tissue, of other scales.
  const VolumeInfo mixed = open({{0.05, 0.05}, {0.01, 2.0, 3, 4}, {0.02, 0.09, 2, 3}});
  EXPECT_NEAR(mixed.geometry.spacing_mm()[0], 0.5, 1e-12);
  EXPECT_FALSE(warned(mixed, "several-regions"));
  EXPECT_FALSE(warned(open({{0.05, 0.05}, {0.05, 0.05}}), "several-regions"));
  const VolumeInfo seconds = open({{0.05, 0.05, 1, 4}});
  EXPECT_EQ(seconds.spacing_provenance[0], Provenance::assumed);
  EXPECT_EQ(seconds.geometry.spacing_mm()[0], 1.0);
  const VolumeInfo zero = open({{0.0, 0.05}});
  EXPECT_EQ(zero.spacing_provenance[0], Provenance::assumed);
  // Which way a region's axis points says nothing of its scale.
  EXPECT_NEAR(open({{-0.05, 0.05}}).geometry.spacing_mm()[0], 0.5, 1e-12);
}

TEST_F(UltrasoundPicture, RegionsOfDifferentScaleGiveNoMillimetres) {
  const VolumeInfo info = open({{0.05, 0.05}, {0.08, 0.08}}, "0.5\\0.5");
  EXPECT_TRUE(warned(info, "several-regions"));
  EXPECT_TRUE(warned(info, "assumed-spacing"));
  EXPECT_TRUE(info.spacing_is_assumed());
  EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d::Ones());
}

TEST_F(UltrasoundPicture, TheRegionWinsOverPixelSpacingAndSaysSo) {
  const VolumeInfo differ = open({{0.05, 0.05}}, "0.3\\0.3");
  EXPECT_NEAR(differ.geometry.spacing_mm()[0], 0.5, 1e-12);
  EXPECT_NE(warning_text(differ, "spacing-conflict").find("0.3"), std::string::npos);
  EXPECT_FALSE(warned(open({{0.05, 0.05}}, "0.5\\0.5"), "spacing-conflict"));
  // Pixel Spacing gives the distance of rows first.
  const VolumeInfo alone = open({}, "0.3\\0.4");
  EXPECT_EQ(alone.geometry.spacing_mm()[0], 0.4);
  EXPECT_EQ(alone.geometry.spacing_mm()[1], 0.3);
  EXPECT_EQ(alone.spacing_provenance[0], Provenance::stated);
}

TEST_F(UltrasoundPicture, SizesAtTheDetectorAreDerivedAndAbsurdOnesAreNone) {
  const VolumeInfo detector = open({}, "", {{{0x0018, 0x1164}, "0.2\\0.2"}});
  EXPECT_EQ(detector.spacing_provenance[0], Provenance::derived);
  EXPECT_EQ(detector.geometry.spacing_mm()[0], 0.2);
  for (const char* absurd : {"0\\0", "-0.3\\0.3", "nan\\nan", "1e-12\\1e-12", "1e9\\1e9"}) {
    const VolumeInfo info = open({}, absurd);
    EXPECT_EQ(info.spacing_provenance[0], Provenance::assumed) << absurd;
    EXPECT_EQ(info.geometry.spacing_mm()[0], 1.0) << absurd;
  }
}

TEST_F(UltrasoundPicture, FramesAreTimeByTheirOwnClock) {
  const VolumeInfo even = open({}, "", {{frame_time, "40"}}, 3);
  EXPECT_EQ(even.geometry.dims(), (Dims{4, 3, 1}));
  EXPECT_EQ(even.frames, 3);
  EXPECT_EQ(even.frame_times_s, (Times{0.0, 0.04, 0.08}));
  EXPECT_EQ(even.time_provenance, Provenance::stated);
  const VolumeInfo steps = open({}, "", {{frame_time_vector, "0\\40\\60\\50\\40"}}, 5);
  EXPECT_EQ(steps.frame_times_s, (Times{0.0, 0.04, 0.1, 0.15, 0.19}));
  const VolumeInfo cumulative = open({}, "", {{frame_time_vector, "0\\40\\80\\120\\160"}}, 5);
  EXPECT_EQ(cumulative.frame_times_s, (Times{0.0, 0.04, 0.08, 0.12, 0.16}));
  EXPECT_TRUE(warned(cumulative, "cumulative-frame-times"));
  DicomMaker both(us_cine_class, "US", "1", "1");
  both.top().text(frame_time, "10").text(frame_time_vector, "0\\40\\60");
  both.top().attribute({0x0028, 0x0009}, frame_time);
  both.pixels(4, 3, 3, 8, [](int, int, int) { return 1; });
  both.save(folder_ / "both.dcm");
  EXPECT_EQ(read(folder_ / "both.dcm").info.frame_times_s, (Times{0.0, 0.01, 0.02}));
  const VolumeInfo rate = open({}, "", {{cine_rate, "25"}}, 3);
  EXPECT_EQ(rate.frame_times_s, (Times{0.0, 0.04, 0.08}));
  EXPECT_EQ(rate.time_provenance, Provenance::derived);
}

TEST_F(UltrasoundPicture, NoTimesAreInvented) {
  const VolumeInfo wrong = open({}, "", {{frame_time_vector, "0\\40"}}, 3);
  EXPECT_TRUE(wrong.frame_times_s.empty());
  EXPECT_EQ(wrong.time_provenance, Provenance::absent);
  EXPECT_TRUE(warned(wrong, "bad-frame-times"));
  const VolumeInfo backwards = open({}, "", {{frame_time_vector, "0\\40\\-40"}}, 3);
  EXPECT_TRUE(backwards.frame_times_s.empty());
  EXPECT_TRUE(open({}, "", {{frame_time, "0"}}, 3).frame_times_s.empty());
  const VolumeInfo none = open({}, "", {}, 3);
  EXPECT_TRUE(none.frame_times_s.empty());
  EXPECT_EQ(none.time_provenance, Provenance::absent);
  EXPECT_EQ(none.geometry.dims()[2], 1);
}

/// An ultrasound volume of 3 slices and perhaps 2 times in a shuffled order.
EnhancedScan volume() {
  EnhancedScan scan;
  scan.slices = 3;
  scan.row_spacing = 0.6;
  scan.column_spacing = 0.5;
  scan.step = {0, 0, 0.7};
  scan.origin = {1, 2, 3};
  return scan;
}

TEST_F(DicomGeometry, AnEnhancedVolumeIsPutTogetherFromItsPositions) {
  EnhancedScan scan = volume();
  scan.order = {2, 0, 1};
  const auto path = folder_ / "volume.dcm";
  scan.write(path);
  const VolumeSequence sequence = read(path);
  const VolumeInfo& info = sequence.info;
  EXPECT_EQ(info.geometry.dims(), (Dims{4, 3, 3}));
  // Positions, not the thickness of 99 mm that the file gives as well.
  EXPECT_TRUE(info.geometry.spacing_mm().isApprox(Eigen::Vector3d(0.5, 0.6, 0.7), 1e-12));
  EXPECT_EQ(info.geometry.origin_mm(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(info.spacing_provenance[2], Provenance::derived);
  EXPECT_EQ(info.spacing_provenance[0], Provenance::stated);
  for (int k = 0; k < 3; ++k)
    EXPECT_EQ(sequence.frames.at(0).at(1, 2, k), static_cast<float>(1 + 8 + 16 * k));
  // The probe's axes are not the patient's.
  EXPECT_FALSE(info.patient_axes);
  EXPECT_TRUE(warned(info, "orientation-ambiguous"));
  ASSERT_FALSE(info.orientation_choices.empty());
  EXPECT_EQ(info.orientation_choices.front(), info.orientation);
}

TEST_F(DicomGeometry, AnEnhancedSequenceIsSortedByPlaceAndTime) {
  EnhancedScan scan = volume();
  scan.times_s = {0.0, 0.05, 0.1};
  scan.order = {8, 1, 5, 0, 7, 3, 2, 6, 4};
  const auto path = folder_ / "sequence.dcm";
  scan.write(path);
  const VolumeSequence sequence = read(path);
  EXPECT_EQ(sequence.info.frames, 3);
  EXPECT_EQ(sequence.info.geometry.dims(), (Dims{4, 3, 3}));
  EXPECT_EQ(sequence.info.frame_times_s, scan.times_s);
  EXPECT_EQ(sequence.info.time_provenance, Provenance::stated);
  for (int t = 0; t < 3; ++t)
    for (int k = 0; k < 3; ++k)
      EXPECT_EQ(sequence.frames.at(static_cast<std::size_t>(t)).at(3, 1, k),
                static_cast<float>(3 + 4 + 16 * k + 64 * t));
  ReadOptions one;
  one.frame = 2;
  const VolumeSequence last = read(path, one);
  ASSERT_EQ(last.frames.size(), 1U);
  EXPECT_EQ(last.first_frame, 2);
  EXPECT_EQ(last.frames[0].at(0, 0, 1), 16.0F + 128.0F);
  // The second library sees the frames in the order that was written.
  gdcm::Reader reader;
  reader.SetFileName(path.c_str());
  ASSERT_TRUE(reader.Read());
  const auto groups = reader.GetFile().GetDataSet().GetDataElement(gdcm::Tag(0x5200, 0x9230)).GetValueAsSQ();
  ASSERT_EQ(groups->GetNumberOfItems(), 9U);
  const auto position = groups->GetItem(1)
                            .GetNestedDataSet()
                            .GetDataElement(gdcm::Tag(0x0020, 0x930E))
                            .GetValueAsSQ()
                            ->GetItem(1)
                            .GetNestedDataSet()
                            .GetDataElement(gdcm::Tag(0x0020, 0x9301));
  double z = 0.0;
  std::memcpy(&z, position.GetByteValue()->GetPointer() + 2 * sizeof(z), sizeof(z));
  EXPECT_DOUBLE_EQ(z, 3 + 2 * 0.7);
}

TEST_F(DicomGeometry, LettersNeedAPatientTransformWithItsSource) {
  EnhancedScan scan = volume();
  scan.patient_planes = true;
  scan.axes = {0, 1, 0, 0, 0, -1};
  scan.step = {-0.7, 0, 0};
  const auto path = folder_ / "patient.dcm";
  scan.write(path);
  EXPECT_FALSE(read(path).info.patient_axes) << "nothing says where the patient positions come from";
  scan.patient_source = "TABLE";
  scan.write(path);
  const VolumeInfo info = read(path).info;
  EXPECT_TRUE(info.patient_axes);
  EXPECT_FALSE(warned(info, "orientation-ambiguous"));
  EXPECT_EQ(info.orientation, "PIR");
  EXPECT_EQ(step(info, 2), Eigen::Vector3d(-0.7, 0, 0));
  scan.patient_source.clear();
  scan.geometry = "PATIENT";
  scan.write(path);
  EXPECT_TRUE(read(path).info.patient_axes);
  scan.geometry = "APEX";
  scan.patient_source = "ESTIMATED";
  scan.write(path);
  EXPECT_TRUE(warned(read(path).info, "estimated-orientation"));
}

TEST_F(DicomGeometry, TissueIsTakenWhereAVolumeHoldsFlowAsWell) {
  EnhancedScan scan = volume();
  scan.data_types = {"FLOW_VELOCITY", "TISSUE_INTENSITY"};
  const auto path = folder_ / "flow.dcm";
  scan.write(path);
  const VolumeSequence sequence = read(path);
  EXPECT_EQ(sequence.info.geometry.dims(), (Dims{4, 3, 3}));
  EXPECT_EQ(sequence.info.frames, 1);
  // The maker adds 1 to the values of the second kind.
  EXPECT_EQ(sequence.frames.at(0).at(0, 0, 2), 33.0F);
  EXPECT_NE(warning_text(sequence.info, "data-types").find("FLOW_VELOCITY"), std::string::npos);
}

TEST_F(DicomGeometry, SeveralStacksAreNeverMerged) {
  EnhancedScan scan = volume();
  scan.sop_class = mr_enhanced_class;
  scan.modality = "MR";
  scan.volume_planes = false;
  scan.patient_planes = true;
  scan.stacks = {"1", "2"};
  const auto path = folder_ / "stacks.dcm";
  scan.write(path);
  const std::string text = refusal(path);
  EXPECT_EQ(text.substr(0, 9), "no-volume");
  EXPECT_NE(text.find("3 axial of 4 x 3"), std::string::npos) << text;
  EXPECT_NE(text.find("stack 2"), std::string::npos) << text;
}

TEST_F(DicomGeometry, AnEnhancedMagneticResonanceScanGoesByItsTemporalIndex) {
  EnhancedScan scan = volume();
  scan.sop_class = mr_enhanced_class;
  scan.modality = "MR";
  scan.volume_planes = false;
  scan.patient_planes = true;
  scan.offsets_in_seconds = false;
  scan.times_s = {0.0, 1.0};
  scan.order = {5, 0, 4, 1, 3, 2};
  const auto path = folder_ / "mr.dcm";
  scan.write(path);
  const VolumeSequence sequence = read(path);
  EXPECT_EQ(sequence.info.frames, 2);
  EXPECT_TRUE(sequence.info.patient_axes);
  EXPECT_TRUE(sequence.info.frame_times_s.empty()) << "an index is no time";
  EXPECT_EQ(sequence.frames.at(1).at(0, 0, 2), 64.0F + 32.0F);
}

class ClassicSeries : public DicomGeometry {
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
  const std::string text = refusal(folder_.path());
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
  const std::string text = refusal(folder_.path());
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
  EXPECT_EQ(refusal(folder_.path()).substr(0, 9), "no-volume");
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
  const std::string localizer = refusal(folder_.path());
  EXPECT_EQ(localizer.substr(0, 9), "no-volume");
  for (const char* word : {"localizer", "1 axial", "1 sagittal", "1 coronal"})
    EXPECT_NE(localizer.find(word), std::string::npos) << localizer;
}

TEST_F(ClassicSeries, SizesAndPixelsMustAgree) {
  write(slice(0, 1, 1));
  ClassicSlice other = slice(1, 2, 2);
  other.columns = 5;
  write(other);
  const std::string sizes = refusal(folder_.path());
  EXPECT_NE(sizes.find("1 axial of 5 x 3"), std::string::npos) << sizes;
  other.columns = 4;
  other.spacing = "2\\2";
  other.write(folder_ / "slice2");
  const std::string pixels = refusal(folder_.path());
  EXPECT_NE(pixels.find("pixels of different sizes"), std::string::npos) << pixels;
}

TEST_F(ClassicSeries, SlicesBesideEachOtherAreNoVolume) {
  write(slice(0, 1, 1));
  ClassicSlice beside = slice(1, 2, 2);
  beside.position = "90\\0\\1";
  write(beside);
  EXPECT_NE(refusal(folder_.path()).find("beside one another"), std::string::npos);
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
  const std::string text = refusal(path);
  EXPECT_EQ(text.substr(0, 10), "bad-header");
  EXPECT_NE(text.find("0.5"), std::string::npos) << text;
}

}  // namespace
