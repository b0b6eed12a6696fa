// Real scans: known sizes, and a verdict for every file of the test data.
#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>

namespace {

using palpate::core::VolumeInfo;
using palpate::imaging::inspect;

struct Expected {
  std::string path;
  std::array<int, 3> dims;
  int frames;
  Eigen::Vector3d spacing_mm;
  double min, max, mean;
};

class RealScan : public ::testing::TestWithParam<Expected> {};

TEST_P(RealScan, HasTheSizeSpacingAndRangeOfItsIndex) {
  const Expected& expected = GetParam();
  PALPATE_TEST_SCAN(path, expected.path);
  const VolumeInfo info = palpate::imaging::read(path).info;
  EXPECT_EQ(info.geometry.dims(), expected.dims);
  EXPECT_EQ(info.frames, expected.frames);
  // The index gives six digits.
  EXPECT_LT((info.geometry.spacing_mm() - expected.spacing_mm).norm(), 1e-5 * expected.spacing_mm.norm());
  const auto near = [](double value) { return 1e-5 * std::abs(value) + 1e-9; };
  EXPECT_NEAR(info.min, expected.min, near(expected.min));
  EXPECT_NEAR(info.max, expected.max, near(expected.max));
  EXPECT_NEAR(info.mean, expected.mean, near(expected.mean));
}

INSTANTIATE_TEST_SUITE_P(
    Index, RealScan,
    ::testing::Values(
        Expected{"pluslib/SpinePhantomFreehandReconstructed.mha",
                 {147, 106, 104},
                 1,
                 {0.5, 0.5, 0.5},
                 0,
                 251,
                 19.743},
        Expected{"pluslib/vtkVolumeReconstructorFloatType1OutputCompare.mha",
                 {145, 47, 100},
                 1,
                 {0.5, 0.5, 0.5},
                 0,
                 249.748,
                 4.84109},
        Expected{"pluslib/NwirePhantomFreehandReconstructed.mha",
                 {101, 104, 74},
                 1,
                 {0.5, 0.5, 0.5},
                 0,
                 248,
                 0.496519},
        Expected{"pluslib/SpinePhantomFreehand.igs.mha", {820, 616, 1}, 21, {1, 1, 1}, 0, 251, 35.9961},
        Expected{"pluslib/NrrdSample.igs.nrrd", {256, 256, 1}, 1, {1, 1, 1}, 0, 183, 42.4956},
        // Luma of the index's channel means: 0.299 * 240.911 + 0.587 * 243.132 + 0.114 * 245.684.
        Expected{"pluslib/ColorNrrdSample.igs.nrrd", {1152, 648, 1}, 1, {1, 1, 1}, 0, 255, 242.7589},
        Expected{"nibabel/anatomical.nii", {33, 41, 25}, 1, {2, 2, 2}, -610, 30393, 8401.07},
        Expected{"nibabel/example4d.nii.gz", {128, 96, 24}, 2, {2, 2, 2.2}, 0, 1162, 172.908},
        Expected{"pydicom-data/JPGLosslessP14SV1_1s_1f_8b.dcm",
                 {1024, 768, 1},
                 1,
                 {0.254767, 0.254767, 1},
                 0,
                 255,
                 17.2578},
        Expected{"dwv/multiframe-test1.dcm", {256, 256, 1}, 16, {1, 1, 1}, 0, 252, 32.2647},
        Expected{"pydicom-data/eCT_Supplemental.dcm",
                 {512, 512, 2},
                 1,
                 {0.388672, 0.388672, 10},
                 -1024,
                 172,
                 -643.962},
        Expected{"pydicom/rtdose.dcm", {10, 10, 15}, 1, {10, 10, 5}, 795000, 1.254e6, 1.01327e6},
        // The big-endian twin holds the same doses.
        Expected{"pydicom/rtdose_expb.dcm", {10, 10, 15}, 1, {10, 10, 5}, 795000, 1.254e6, 1.01327e6},
        Expected{"orthanc/Issue94.dcm", {169, 169, 1}, 1, {4, 4, 1}, 0, 15596.4, 329.578},
        Expected{"series/sagittal_mr", {256, 256, 4}, 1, {1, 1, 1}, 0, 254, 127.017},
        Expected{"series/noniso_mr", {64, 28, 4}, 1, {6.39996, 4, 0.5}, 33.4438, 96.468, 51.6037},
        Expected{"series/gantry_tilt_ct", {512, 512, 4}, 1, {0.417969, 0.417969, 5}, -1024, -770, -897.068},
        // Two times of four slices, 3.6 mm apart; a plain reader interleaves them.
        Expected{"series/multitime_mr", {64, 64, 4}, 2, {3, 3, 3.6}, 0, 254, 127.229},
        Expected{"series/oblique_brain_mr", {256, 256, 6}, 1, {1, 1, 9}, 0, 1398, 150.282},
        Expected{"series/ct_3slice", {512, 512, 3}, 1, {0.810547, 0.810547, 1}, -3024, 1381, -954.884}));

TEST(RealScans, UltrasoundCalibrationAndFrameTime) {
  PALPATE_TEST_SCAN(path, "pydicom/examples_ybr_color.dcm");
  const VolumeInfo info = palpate::imaging::read(path).info;
  EXPECT_EQ(info.geometry.dims(), (std::array<int, 3>{320, 240, 1}));
  ASSERT_EQ(info.frame_times_s.size(), 30U);
  EXPECT_DOUBLE_EQ(info.frame_times_s[1], 0.033333);
  EXPECT_NEAR(info.geometry.spacing_mm()[0], 0.51049705594778061, 1e-15);
  EXPECT_EQ(info.sop_class, "1.2.840.10008.5.1.4.1.1.3.1");
}

TEST(RealScans, ATiltedGantryKeepsItsSlant) {
  PALPATE_TEST_SCAN(path, "series/gantry_tilt_ct");
  const VolumeInfo info = palpate::imaging::read(path).info;
  // The slices' positions differ in z alone, by 5 mm.
  const auto& geometry = info.geometry;
  EXPECT_LT((geometry.to_lps_mm({0, 0, 1}) - geometry.to_lps_mm({0, 0, 0}) - Eigen::Vector3d(0, 0, 5)).norm(),
            1e-3);
  ASSERT_FALSE(info.warnings.empty());
  EXPECT_EQ(info.warnings[0].code, "gantry-tilt");
}

TEST(RealScans, EveryFileEndsWithAVerdict) {
  PALPATE_TEST_SCAN(index, "INDEX.md");
  palpate::imaging::ReaderLimits limits;
  limits.memory_bytes = std::size_t{2} << 30;
  limits.time_s = 20.0;
  const auto folder = index.parent_path();
  const auto reports = inspect({folder}, {}, {}, limits);
  std::map<std::string, std::string> verdicts;
  for (const auto& report : reports) {
    EXPECT_TRUE(report.ok || (!report.error_code.empty() &&
                              report.error_text.find(report.path.filename().string()) != std::string::npos))
        << report.path << ": " << report.error_text;
    verdicts[report.path.lexically_relative(folder).string()] = report.ok ? "ok" : report.error_code;
    if (!report.ok) continue;
    const VolumeInfo& info = report.volumes.at(0);
    EXPECT_TRUE(std::isfinite(info.min) && std::isfinite(info.max) && info.min <= info.mean &&
                info.mean <= info.max)
        << report.path;
  }
  EXPECT_GT(reports.size(), 80U);
  const std::map<std::string, std::string> known{
      {"pydicom/rtdose_1frame.dcm", "reader-crashed"},  // GDCM aborts on these
      {"pydicom-data/liver_rle.dcm", "reader-crashed"},
      {"pydicom/MR_truncated.dcm", "truncated"},
      {"pydicom/badVR.dcm", "bad-header"},
      {"orthanc/2026-05-26-oob-monochrome-46341.dcm", "truncated"},
      {"orthanc/Issue22-NoPixelData.dcm", "no-image"},
      {"pluslib/MetaImageSequenceIOTest1.igs.mhd", "not-found"},
      {"pluslib/ReferenceToRASCalibration.igs.mha", "no-image"},
      {"nibabel/nifti1.hdr", "not-found"},
      {"constructed/i01_nifti_trunc.nii", "truncated"},
      {"constructed/m03_ndims_zero.mha", "bad-header"},
      {"constructed/m11_truncated_raw.mha", "truncated"},
      {"constructed/m23_path_traversal.mhd", "bad-header"},
      {"constructed/m29_nan_float_pixels.mha", "ok"},
      {"constructed/n03_nrrd_trunc_gzip.nrrd", "truncated"},
      {"mesh/Bunny.stl", "unsupported"},
      {"series/rle_mr", "ok"},
      {"INDEX.md", "unsupported"}};
  for (const auto& [path, verdict] : known) EXPECT_EQ(verdicts[path], verdict) << path;
}

}  // namespace
