// Volumes in vendors' own tags, written here by DCMTK or byte by byte.
#include "dicom_checks.hpp"

#include <gdcmReader.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

namespace {

using palpate::core::Provenance;
using palpate::core::VolumeInfo;
using palpate::core::VolumeSequence;
using palpate::imaging::read;
using palpate::imaging::ReadOptions;
using namespace palpate::testing;

class VendorVolume : public ::testing::Test {
 protected:
  std::string refusal() { return refusal_of(path_, {}, &details_); }
  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "scan.dcm";
  std::string details_;
};

TEST_F(VendorVolume, QlabCartesianIsReadByItsCreator) {
  QlabScan scan;
  scan.volumes = 2;
  scan.block = 0x21;  // anywhere but where it usually stands
  scan.write(path_);
  const VolumeSequence sequence = read(path_);
  const VolumeInfo& info = sequence.info;
  EXPECT_EQ(info.geometry.dims(), (Dims{4, 3, 2}));
  EXPECT_TRUE(info.geometry.spacing_mm().isApprox(Eigen::Vector3d(0.5, 0.6, 0.7), 1e-12));
  EXPECT_EQ(info.spacing_provenance[0], Provenance::stated);
  EXPECT_EQ(info.spacing_provenance[2], Provenance::private_tag);
  EXPECT_EQ(info.frames, 2);
  EXPECT_EQ(info.frame_times_s, (std::vector<double>{0.0, 0.05}));
  EXPECT_EQ(sequence.frames.at(1).at(3, 2, 1), 3.0F + 8.0F + 16.0F + 64.0F);
  EXPECT_EQ(info.scanner, "Philips Medical Systems iE33");
  // The three ways in use, the taken one first; no letters.
  EXPECT_EQ(info.orientation_choices, (std::vector<std::string>{"RAS", "LPI", "RPI"}));
  EXPECT_EQ(info.orientation, "RAS");
  EXPECT_TRUE(warned(info, "orientation-ambiguous"));
  EXPECT_FALSE(info.patient_axes);
  // The second library finds the private block where the maker put it.
  gdcm::Reader reader;
  reader.SetFileName(path_.c_str());
  ASSERT_TRUE(reader.Read());
  const auto* value = reader.GetFile().GetDataSet().GetDataElement(gdcm::Tag(0x3001, 0x2103)).GetByteValue();
  double z_cm = 0.0;
  ASSERT_EQ(value->GetLength(), sizeof(z_cm));
  std::memcpy(&z_cm, value->GetPointer(), sizeof(z_cm));
  EXPECT_EQ(z_cm, 0.07);
}

TEST_F(VendorVolume, QlabWithoutTypesIsReadByItsBytes) {
  QlabScan scan;
  scan.implicit = true;
  scan.slices = 0x34;  // the byte of the digit 4
  scan.write(path_);
  const VolumeInfo info = read(path_).info;
  EXPECT_EQ(info.geometry.dims(), (Dims{4, 3, 0x34}));
  EXPECT_TRUE(info.geometry.spacing_mm().isApprox(Eigen::Vector3d(0.5, 0.6, 0.7), 1e-12));
}

TEST_F(VendorVolume, TheUserChoosesAmongOrientations) {
  QlabScan{}.write(path_);
  ReadOptions options;
  options.orientation = "LPI";
  const VolumeInfo info = read(path_, options).info;
  EXPECT_EQ(info.orientation, "LPI");
  EXPECT_EQ(info.direction_provenance, Provenance::user);
  EXPECT_TRUE(info.patient_axes);
  EXPECT_FALSE(warned(info, "orientation-ambiguous"));
  EXPECT_EQ(info.geometry.direction()(2, 2), -1.0);
}

TEST_F(VendorVolume, QlabThatIsCutOffOrHasNoSliceCountIsRefused) {
  QlabScan scan;
  scan.cut = true;
  scan.write(path_);
  EXPECT_EQ(refusal().substr(0, 9), "truncated");
  ReadOptions insist;
  insist.allow_truncated = true;
  const VolumeSequence sequence = read(path_, insist);
  EXPECT_TRUE(warned(sequence.info, "truncated"));
  EXPECT_EQ(sequence.frames.at(0).at(1, 0, 0), 1.0F);
  EXPECT_EQ(sequence.frames.at(0).at(1, 0, 1), 0.0F);
  DicomMaker file("1.2.840.113543.6.6.1.3.10002", "US", "5", "1");
  file.pixels(4, 3, 1, 8, [](int, int, int) { return 1; });
  file.save(path_);
  const std::string text = refusal();
  EXPECT_EQ(text.substr(0, 11), "unsupported");
  EXPECT_NE(text.find("Philips3D"), std::string::npos) << text;
}

TEST_F(VendorVolume, AffinitySpacingComesFromItsOwnBlock) {
  write_affinity(path_, 0x35, "0.156\\0.122\\0.328", 4, 3, 5, [](int i, int, int k) { return i + 10 * k; });
  const VolumeSequence sequence = read(path_);
  const VolumeInfo& info = sequence.info;
  EXPECT_EQ(info.geometry.dims(), (Dims{4, 3, 5}));
  EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(0.156, 0.122, 0.328));
  for (const auto provenance : info.spacing_provenance) EXPECT_EQ(provenance, Provenance::private_tag);
  EXPECT_EQ(sequence.frames.at(0).at(1, 0, 4), 41.0F);
  EXPECT_EQ(info.orientation_choices.front(), "LPS");
  EXPECT_TRUE(warned(info, "orientation-ambiguous"));
  // Without three sizes it is a cine like any other.
  write_affinity(path_, 0x35, "0.156\\0\\0.328", 4, 3, 5, [](int i, int, int k) { return i + 10 * k; });
  EXPECT_EQ(read(path_).info.frames, 5);
}

TEST_F(VendorVolume, ArtemisTakesTheAspectRatioElseItsTag) {
  const auto value = [](int i, int, int k) { return i + 10 * k; };
  write_artemis(path_, "275\\275", "", 4, 3, 5, value);
  const VolumeInfo ratio = read(path_).info;
  EXPECT_EQ(ratio.geometry.dims(), (Dims{4, 3, 5}));
  EXPECT_EQ(ratio.geometry.spacing_mm(), Eigen::Vector3d::Constant(0.275));
  // Centred: half of 4, 3 and 5 voxels' extent between centres.
  EXPECT_TRUE(ratio.geometry.origin_mm().isApprox(Eigen::Vector3d(-1.5, -1.0, -2.0) * 0.275, 1e-12));
  EXPECT_EQ(ratio.origin_provenance, Provenance::derived);
  write_artemis(path_, "1\\1", "0.31", 4, 3, 5, value);
  const VolumeInfo tag = read(path_).info;
  EXPECT_EQ(tag.geometry.spacing_mm(), Eigen::Vector3d::Constant(0.31));
  EXPECT_EQ(tag.spacing_provenance[1], Provenance::private_tag);
  write_artemis(path_, "", "", 4, 3, 5, value);
  EXPECT_TRUE(read(path_).info.spacing_is_assumed());
  write_artemis(path_, "275\\275", "0.31", 4, 3, 5, value);
  EXPECT_TRUE(warned(read(path_).info, "spacing-conflict"));
}

TEST_F(VendorVolume, APrivateVolumeIsRefusedHonestly) {
  write_movie_group(path_, "Trace+3D", false);
  const std::string text = refusal();
  EXPECT_EQ(text.substr(0, 11), "unsupported");
  for (const char* word : {us_image_class, "Vivid E95", "GEMS_Ultrasound_MovieGroup_001", "3D",
                           "Nothing was guessed", "Enhanced US Volume"})
    EXPECT_NE(text.find(word), std::string::npos) << word << " in " << text;
  EXPECT_NE(details_.find("Vivid E95"), std::string::npos);
}

TEST_F(VendorVolume, APictureBesideAPrivateVolumeIsOpenedAndSaidToBeOne) {
  write_movie_group(path_, "Trace+3D", true);
  const VolumeSequence sequence = read(path_);
  EXPECT_EQ(sequence.info.geometry.dims(), (Dims{4, 3, 1}));
  EXPECT_EQ(sequence.info.frames, 2);
  EXPECT_EQ(sequence.frames.at(1).at(1, 1, 0), 105.0F);
  EXPECT_TRUE(warned(sequence.info, "private-volume"));
  write_movie_group(path_, "2D", true);
  EXPECT_FALSE(warned(read(path_).info, "private-volume"));
}

TEST_F(VendorVolume, AnyMakersLargePrivateVolumeIsToldOf) {
  const auto write_with = [&](const std::string& words, std::size_t bytes) {
    DicomMaker file(us_cine_class, "US", "8", "2");
    file.top().private_text(0x200D, 0x10, "Some Maker 045", 0x0D, words);
    file.top().private_bytes(0x200D, 0x10, "Some Maker 045", 0x0E, std::string(bytes, '\7'));
    file.pixels(4, 3, 2, 8, [](int i, int j, int) { return i + j; });
    file.save(path_);
  };
  write_with("DATATYPE_DIN_3D_ECHO", std::size_t{2} << 20);
  EXPECT_TRUE(warned(read(path_).info, "private-volume"));
  write_with("DATATYPE_DIN_2D_ECHO", std::size_t{2} << 20);
  EXPECT_FALSE(warned(read(path_).info, "private-volume"));
  write_with("DATATYPE_DIN_3D_ECHO", 64);
  EXPECT_FALSE(warned(read(path_).info, "private-volume"));
}

class Kretz : public VendorVolume {
 protected:
  /// Smooth over the size of a voxel: bent by at most `bend` a square mm along any line.
  static double field(const Eigen::Vector3d& p, int volume) {
    return 120.0 + 20.0 * volume + 40.0 * std::sin(p[0] / 9.0) * std::cos(p[1] / 11.0) + 0.9 * (p[2] - 35.0);
  }
  static KretzScan scan() {
    KretzScan made;
    made.value = field;
    return made;
  }
  /// The largest difference from the field over the voxels well inside the
  /// fan, and how many those are.
  static std::pair<double, int> compare(const VolumeSequence& sequence, const KretzScan& made, int frame) {
    const auto& volume = sequence.frames.at(static_cast<std::size_t>(frame));
    const auto& geometry = volume.geometry();
    double worst = 0.0;
    int inside = 0;
    for (int k = 0; k < volume.dims()[2]; ++k)
      for (int j = 0; j < volume.dims()[1]; ++j)
        for (int i = 0; i < volume.dims()[0]; ++i) {
          // RAS was taken: lateral to the right, elevation forward, depth up.
          const Eigen::Vector3d lps = geometry.to_lps_mm(Eigen::Vector3d(i, j, k));
          const Eigen::Vector3d point(-lps[0], -lps[1], lps[2]);
          const double sweep = std::atan2(-point[1], point[2] - made.axis_mm);
          const double forward = made.axis_mm + std::hypot(point[1], point[2] - made.axis_mm);
          const double fan = std::atan2(point[0], forward);
          const double radius = std::hypot(point[0], forward);
          const double last = made.first_mm + made.step_mm * (made.radial - 1);
          const bool in = std::abs(sweep) < 0.999 * made.half_sweep &&
                          std::abs(fan) < 0.999 * made.half_fan && radius > made.first_mm + 0.01 &&
                          radius < last - 0.01;
          const bool out = std::abs(sweep) > 1.001 * made.half_sweep ||
                           std::abs(fan) > 1.001 * made.half_fan || radius < made.first_mm - 0.01 ||
                           radius > last + 0.01;
          if (out && volume.at(i, j, k) != 0.0F) ADD_FAILURE() << "outside at " << point.transpose();
          if (!in) continue;
          ++inside;
          worst = std::max(worst, std::abs(volume.at(i, j, k) - field(point, frame)));
        }
    return {worst, inside};
  }
};

// Linear interpolation is off by at most an eighth of the squared step times
// the second derivative along it. The field bends by at most 0.5 and climbs by
// at most 4.6 a square mm and a mm; along an angle that is 0.5 r^2 + 4.6 r. At
// r = 51.5 with steps of 1 / 47 across the fan: 0.09; at 43.5 from the axis with
// 0.8 / 39 across the sweep: 0.06; along a ray of 0.5 mm: 0.02. Rounding to
// whole greys adds 0.5.
constexpr double tolerance = 0.7;

TEST_F(Kretz, BeamsBecomeVoxelsWhereTheFieldSaysThatTheyAre) {
  const KretzScan made = scan();
  made.write_dicom(path_);
  ReadOptions options;
  options.grid_spacing_mm = 0.8;
  const VolumeSequence sequence = read(path_, options);
  const VolumeInfo& info = sequence.info;
  EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d::Constant(0.8));
  const auto [worst, inside] = compare(sequence, made, 0);
  EXPECT_GT(inside, 40000);
  EXPECT_LT(worst, tolerance);
  RecordProperty("worst_grey_difference", std::to_string(worst));
  EXPECT_EQ(info.orientation_choices.front(), "RAS");
  EXPECT_TRUE(warned(info, "scan-converted"));
  EXPECT_TRUE(warned(info, "orientation-ambiguous"));
  EXPECT_EQ(info.spacing_provenance[0], Provenance::derived);
  EXPECT_EQ(info.scanner, "GE Healthcare Austria GmbH & Co OG Voluson E10");
}

TEST_F(Kretz, ARawFileGivesTheSameVolumeAtTheBeamsResolution) {
  const KretzScan made = scan();
  made.write_raw(folder_ / "scan.vol");
  path_ = folder_ / "scan.vol";
  const VolumeSequence sequence = read(path_);
  EXPECT_EQ(sequence.info.geometry.spacing_mm(), Eigen::Vector3d::Constant(0.5));
  const auto [worst, inside] = compare(sequence, made, 0);
  EXPECT_GT(inside, 150000);
  EXPECT_LT(worst, tolerance);
  ReadOptions absurd;
  absurd.grid_spacing_mm = 0.001;
  EXPECT_THROW(read(path_, absurd), palpate::core::Error);
}

TEST_F(Kretz, ASequenceGivesTheFramesThatAreAskedFor) {
  KretzScan made = scan();
  made.volumes = 3;
  made.radial = 40;
  made.write_dicom(path_, 0x40);
  ReadOptions options;
  options.grid_spacing_mm = 1.5;
  options.frame = 1;
  options.frame_count = 2;
  VolumeSequence sequence = read(path_, options);
  EXPECT_EQ(sequence.info.frames, 3);
  EXPECT_EQ(sequence.info.time_provenance, Provenance::absent);
  ASSERT_EQ(sequence.frames.size(), 2U);
  sequence.frames.insert(sequence.frames.begin(), palpate::core::Volume());
  EXPECT_LT(compare(sequence, made, 1).first, tolerance);
  EXPECT_LT(compare(sequence, made, 2).first, tolerance);
}

TEST_F(Kretz, WhatIsCompressedIsRefused) {
  KretzScan made = scan();
  made.compressed = true;
  made.write_dicom(path_);
  const std::string text = refusal();
  EXPECT_EQ(text.substr(0, 11), "unsupported");
  EXPECT_NE(text.find("compressed"), std::string::npos) << text;
}

}  // namespace
