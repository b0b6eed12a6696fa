// Where and when the voxels of ultrasound pictures and of enhanced objects are.
// The scans are written by DCMTK here; every expected number follows from what
// is written, by hand.
#include "dicom_checks.hpp"

#include "palpate/imaging/writer.hpp"

#include <gdcmReader.h>
#include <gdcmSequenceOfItems.h>
#include <gtest/gtest.h>

#include <cstring>

namespace {

using palpate::core::Provenance;
using palpate::core::VolumeInfo;
using palpate::core::VolumeSequence;
using palpate::imaging::read;
using palpate::imaging::ReadOptions;
using namespace palpate::testing;

class DicomGeometry : public ::testing::Test {
 protected:
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

TEST_F(DicomGeometry, WhatThisProgramWritesComesBackInItsPlace) {
  const Eigen::Matrix3d axes =
      (Eigen::Matrix3d() << 0, 0, -1, 1, 0, 0, 0, -1, 0).finished();  // i to P, j to I, k to R
  const palpate::core::ImageGeometry geometry({4, 3, 5}, {0.5, 0.6, 0.7}, {10, -20, 30}, axes);
  std::vector<float> voxels(60);
  for (std::size_t n = 0; n < voxels.size(); ++n) voxels[n] = static_cast<float>(n);
  palpate::imaging::WriteOptions options;
  options.frame_times_s = {0.0, 0.03};
  const palpate::core::Volume volume(geometry, voxels);
  const auto path = folder_ / "written.dcm";
  palpate::imaging::write(path, {volume, volume}, 0.0, options);
  const VolumeSequence back = read(path);
  // Positions are written with 10 digits at least.
  EXPECT_TRUE(back.info.geometry.ijk_to_lps_mm().isApprox(geometry.ijk_to_lps_mm(), 1e-9));
  EXPECT_TRUE(back.info.patient_axes);
  EXPECT_EQ(back.info.frame_times_s, options.frame_times_s);
  ASSERT_EQ(back.frames.size(), 2U);
  EXPECT_EQ(back.frames[1].at(3, 2, 4), 59.0F);
  options.dicom.patient_axes = false;
  palpate::imaging::write(path, {volume, volume}, 0.0, options);
  const VolumeInfo probe = read(path).info;
  EXPECT_FALSE(probe.patient_axes);
  EXPECT_TRUE(warned(probe, "orientation-ambiguous"));
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

TEST_F(DicomGeometry, TimesAreNotMergedIntoSlicesWherePositionsLack) {
  EnhancedScan scan = volume();
  scan.volume_planes = false;
  scan.times_s = {0.0, 0.05};
  scan.order = {5, 1, 0, 4, 2, 3};
  const auto path = folder_ / "unplaced.dcm";
  scan.write(path);
  const VolumeSequence sequence = read(path);
  EXPECT_EQ(sequence.info.geometry.dims(), (Dims{4, 3, 3}));
  EXPECT_EQ(sequence.info.frames, 2);
  EXPECT_EQ(sequence.info.frame_times_s, scan.times_s);
  EXPECT_TRUE(sequence.info.spacing_is_assumed());
  EXPECT_EQ(sequence.info.direction_provenance, Provenance::absent);
  EXPECT_TRUE(warned(sequence.info, "assumed-slices"));
  for (int k = 0; k < 3; ++k)
    EXPECT_EQ(sequence.frames.at(1).at(0, 0, k), 64.0F + 16.0F * static_cast<float>(k));
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
  const std::string text = refusal_of(path);
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

}  // namespace
