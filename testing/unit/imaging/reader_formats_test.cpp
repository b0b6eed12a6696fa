// Small files of every format, written byte by byte here, and what must come of them.
#include "reader_files.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using palpate::core::Provenance;
using palpate::core::VolumeSequence;
using palpate::imaging::read;
using palpate::imaging::ReadOptions;
using namespace palpate::testing;

std::string error_code(const std::filesystem::path& path, const ReadOptions& options = {}) {
  try {
    read(path, options);
  } catch (const palpate::core::Error& error) {
    EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos) << error.what();
    return error.code();
  }
  return "none";
}

bool warned(const VolumeSequence& sequence, const std::string& code) {
  for (const auto& warning : sequence.info.warnings)
    if (warning.code == code) return true;
  return false;
}

class ReaderFormats : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "scan.mha";
};

template <typename T>
struct Typed {
  static VolumeSequence round_trip(const std::filesystem::path& path, const char* type) {
    // The ends of the type's range that a float holds exactly, and small numbers.
    const std::vector<T> values{
        0, 1, 2, 3, std::numeric_limits<T>::is_signed ? static_cast<T>(-4) : static_cast<T>(4), 5, 6, 100};
    write_mha(path, "2 2 2", type, bytes_of(values));
    VolumeSequence sequence = read(path);
    for (std::size_t n = 0; n < values.size(); ++n)
      EXPECT_EQ(sequence.frames.at(0).data()[n], static_cast<float>(values[n])) << type;
    return sequence;
  }
};

TEST_F(ReaderFormats, EveryPixelTypeOfMetaImage) {
  EXPECT_EQ(Typed<std::uint8_t>::round_trip(file_, "MET_UCHAR").info.pixel_type, "uint8");
  EXPECT_EQ(Typed<std::int8_t>::round_trip(file_, "MET_CHAR").info.pixel_type, "int8");
  EXPECT_EQ(Typed<std::uint16_t>::round_trip(file_, "MET_USHORT").info.pixel_type, "uint16");
  EXPECT_EQ(Typed<std::int16_t>::round_trip(file_, "MET_SHORT").info.pixel_type, "int16");
  EXPECT_EQ(Typed<std::uint32_t>::round_trip(file_, "MET_UINT").info.pixel_type, "uint32");
  EXPECT_EQ(Typed<std::int32_t>::round_trip(file_, "MET_INT").info.pixel_type, "int32");
  EXPECT_EQ(Typed<float>::round_trip(file_, "MET_FLOAT").info.pixel_type, "float32");
  EXPECT_EQ(Typed<double>::round_trip(file_, "MET_DOUBLE").info.pixel_type, "float64");
}

TEST_F(ReaderFormats, FlippedAndObliqueDirectionsKeepEveryVoxelsPlace) {
  // Rows of TransformMatrix are the axes: i along -x, j and k turned by 30 degrees about x.
  const double c = std::sqrt(3.0) / 2.0;
  write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, '\1'),
            "TransformMatrix = -1 0 0 0 0.86602540378443865 0.5 0 -0.5 0.86602540378443865\n"
            "Offset = 10 20 30\nElementSpacing = 1 2 3\n");
  const auto geometry = read(file_).info.geometry;
  const Eigen::Vector3d expected(10.0 - 1.0, 20.0 + 2.0 * c - 3.0 * 0.5, 30.0 + 2.0 * 0.5 + 3.0 * c);
  // Sixteen digits in the header and a few operations: rounding only.
  EXPECT_LT((geometry.to_lps_mm(Eigen::Vector3d(1, 1, 1)) - expected).norm(), 1e-12);
}

TEST_F(ReaderFormats, ColourBecomesRec601LumaAndSaysSo) {
  write_mha(file_, "2 1 1", "MET_UCHAR", std::string("\xC8\x64\x32\x00\x00\xFF", 6),
            "ElementNumberOfChannels = 3\n");
  const auto sequence = read(file_);
  // Half a unit in the last place of a float near 124 is 4e-6.
  EXPECT_NEAR(sequence.frames.at(0).data()[0], 0.299 * 200 + 0.587 * 100 + 0.114 * 50, 1e-5);
  EXPECT_NEAR(sequence.frames.at(0).data()[1], 0.114 * 255, 1e-5);
  EXPECT_TRUE(warned(sequence, "colour-to-grey"));
  EXPECT_EQ(sequence.info.components, 3);
}

TEST_F(ReaderFormats, FourthAxisIsTimeAndOneFrameCanBeRead) {
  write_mha(file_, "2 1 1 3", "MET_UCHAR", std::string("\0\1\2\3\4\5", 6), "ElementSpacing = 1 1 1 0.25\n");
  const auto all = read(file_);
  ASSERT_EQ(all.frames.size(), 3U);
  EXPECT_EQ(all.info.frame_times_s, (std::vector<double>{0.0, 0.25, 0.5}));
  ReadOptions options;
  options.frame = 2;
  const auto one = read(file_, options);
  ASSERT_EQ(one.frames.size(), 1U);
  EXPECT_EQ(one.first_frame, 2);
  EXPECT_EQ(one.frames[0].data()[0], 4.0F);
  EXPECT_EQ(one.info.frames, 3);
  options.frame = 3;
  EXPECT_THROW(read(file_, options), palpate::core::Error);
}

TEST_F(ReaderFormats, TrackedUltrasoundIsTimeAndItsSpacingUnknown) {
  write_mha(file_, "2 1 2", "MET_UCHAR", "abcd",
            "ElementSpacing = 1 1 1\nSeq_Frame0000_Timestamp = 5.5\nSeq_Frame0001_Timestamp = 5.75\n");
  const auto sequence = read(file_);
  EXPECT_EQ(sequence.info.geometry.dims(), (std::array<int, 3>{2, 1, 1}));
  EXPECT_EQ(sequence.info.frame_times_s, (std::vector<double>{0.0, 0.25}));
  EXPECT_EQ(sequence.info.spacing_provenance[0], Provenance::assumed);
  EXPECT_TRUE(warned(sequence, "assumed-spacing"));
}

TEST_F(ReaderFormats, SaysWhereSpacingComesFromAndTakesTheUsers) {
  write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, 'x'));
  EXPECT_TRUE(warned(read(file_), "assumed-spacing"));
  ReadOptions options;
  options.spacing_mm = {0.5, 0.5, 2.0};
  const auto sequence = read(file_, options);
  EXPECT_EQ(sequence.info.geometry.spacing_mm(), Eigen::Vector3d(0.5, 0.5, 2.0));
  EXPECT_EQ(sequence.info.spacing_provenance[2], Provenance::user);
  EXPECT_FALSE(warned(sequence, "assumed-spacing"));
}

TEST_F(ReaderFormats, VoxelsThatAreNoNumbersBecomeTheSmallest) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  write_mha(file_, "2 2 1", "MET_FLOAT", bytes_of(std::vector<float>{nan, 3.0F, infinite, -2.0F}));
  const auto sequence = read(file_);
  EXPECT_EQ(sequence.frames.at(0).data()[0], -2.0F);
  EXPECT_EQ(sequence.frames.at(0).data()[2], -2.0F);
  EXPECT_EQ(sequence.info.max, 3.0);
  EXPECT_TRUE(warned(sequence, "non-finite-voxels"));
}

TEST_F(ReaderFormats, ShearedAxesAreKeptWithAWarning) {
  write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, 'x'),
            "TransformMatrix = 1 0 0 0 1 0 0 0.6 0.8\nElementSpacing = 1 1 1\n");
  const auto sequence = read(file_);
  EXPECT_TRUE(warned(sequence, "sheared-axes"));
  EXPECT_NEAR(sequence.info.geometry.direction()(1, 2), 0.6, 1e-12);
  write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, 'x'), "TransformMatrix = 1 0 0 0 1 0 0 1 0\n");
  EXPECT_EQ(error_code(file_), "bad-header");
}

TEST_F(ReaderFormats, RefusesMetaImagesThatDoNotAddUp) {
  write_mha(file_, "4 4 4", "MET_UCHAR", std::string(63, 'x'));
  EXPECT_EQ(error_code(file_), "truncated");
  ReadOptions options;
  options.allow_truncated = true;
  const auto cut = read(file_, options);
  EXPECT_TRUE(warned(cut, "truncated"));
  EXPECT_EQ(cut.frames.at(0).at(3, 3, 3), 0.0F);
  EXPECT_EQ(cut.frames.at(0).at(2, 3, 3), static_cast<float>('x'));
  write_mha(file_, "0 0 93", "MET_UCHAR", "");
  EXPECT_EQ(error_code(file_), "no-image");
  for (const char* dims : {"4 -4 4", "4 4 banana", "99999999999 1 1"}) {
    write_mha(file_, dims, "MET_UCHAR", std::string(64, 'x'));
    EXPECT_EQ(error_code(file_), "bad-header") << dims;
  }
  write_mha(file_, "2147483647 2147483647 2147483647", "MET_UCHAR", "x");
  EXPECT_EQ(error_code(file_), "truncated");
  write_mha(file_, "2147483647 2147483647 2147483647", "MET_UCHAR", "x",
            "CompressedData = True\nCompressedDataSize = 1\n");
  EXPECT_EQ(error_code(file_), "too-large");
  for (const char* line : {"ElementSpacing = 1 0 1\n", "ElementSpacing = 1 -1 1\n",
                           "ElementSpacing = 1 nan 1\n", "ElementNumberOfChannels = 0\n"}) {
    write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, 'x'), line);
    EXPECT_EQ(error_code(file_), "bad-header") << line;
  }
  for (const char* axes : {"0", "-1", "11", "x"}) {
    write_bytes(file_, "ObjectType = Image\nNDims = " + std::string(axes) +
                           "\nDimSize = 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\nx");
    EXPECT_EQ(error_code(file_), "bad-header") << axes;
  }
}

TEST_F(ReaderFormats, FollowsNoDataFileOutOfItsFolder) {
  const auto header = folder_ / "inner" / "scan.mhd";
  std::filesystem::create_directory(folder_ / "inner");
  write_bytes(folder_ / "secret.raw", std::string(8, 's'));
  const auto naming = [&](const std::string& name) {
    write_bytes(
        header,
        "ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = " + name +
            "\n");
    return error_code(header);
  };
  EXPECT_EQ(naming("../secret.raw"), "bad-header");
  EXPECT_EQ(naming((folder_ / "secret.raw").string()), "bad-header");
  std::filesystem::create_symlink("../secret.raw", folder_ / "inner" / "link.raw");
  EXPECT_EQ(naming("link.raw"), "bad-header");
  EXPECT_EQ(naming("scan.mhd"), "bad-header");
  EXPECT_EQ(naming("missing.raw"), "not-found");
  EXPECT_EQ(naming(std::string(300, 'A') + "%d.raw 1 4 1"), "unsupported");
  write_bytes(folder_ / "inner" / "own.raw", std::string(8, 's'));
  EXPECT_EQ(naming("own.raw"), "none");
}

TEST_F(ReaderFormats, NrrdWithTimeAsAListAndAsAnAxis) {
  const auto path = folder_ / "scan.nrrd";
  write_bytes(path,
              "NRRD0004\ntype: uint8\ndimension: 4\nspace: left-posterior-superior\nsizes: 2 2 1 2\nkinds: "
              "list domain domain domain\n"
              "space directions: none (2,0,0) (0,2,0) (0,0,2)\nspace origin: (1,2,3)\nencoding: raw\n\n" +
                  std::string("\1\2\3\4\5\6\7\x8", 8));
  const auto sequence = read(path);
  ASSERT_EQ(sequence.frames.size(), 2U);
  EXPECT_EQ(sequence.frames[1].data()[1], 4.0F);
  EXPECT_EQ(sequence.info.geometry.spacing_mm(), Eigen::Vector3d(2, 2, 2));
  EXPECT_EQ(sequence.info.origin_provenance, Provenance::stated);
  write_bytes(path, "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n\nshort");
  EXPECT_EQ(error_code(path), "truncated");
  write_bytes(path, "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 0 4\nencoding: raw\n\n");
  EXPECT_EQ(error_code(path), "bad-header");
  write_bytes(path, "NRRD0004\ntype: uint8\ndimension: 1\nsizes: 4\nencoding: raw\ndata file: ../x.raw\n\n");
  EXPECT_EQ(error_code(path), "bad-header");
}

TEST_F(ReaderFormats, NrrdOfAnotherSpaceIsTurnedToLps) {
  const auto path = folder_ / "scan.nrrd";
  write_bytes(path,
              "NRRD0004\ntype: uint8\ndimension: 3\nspace: right-anterior-superior\nsizes: 2 1 1\n"
              "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (10,20,30)\nencoding: raw\n\nab");
  EXPECT_EQ(read(path).info.geometry.to_lps_mm(Eigen::Vector3d(1, 0, 0)), Eigen::Vector3d(-11, -20, 30));
}

TEST_F(ReaderFormats, NiftiWithTimesAndItsRefusals) {
  const auto path = folder_ / "scan.nii";
  NiftiBytes header({2, 1, 1, 3}, 4, 16);
  header.put<float>(92, 40.0F);
  write_bytes(path, header.bytes() + bytes_of(std::vector<std::int16_t>{1, 2, 3, 4, 5, -6}));
  const auto sequence = read(path);
  ASSERT_EQ(sequence.frames.size(), 3U);
  EXPECT_EQ(sequence.frames[2].data()[1], -6.0F);
  ASSERT_EQ(sequence.info.frame_times_s.size(), 3U);
  EXPECT_NEAR(sequence.info.frame_times_s[2], 0.08, 1e-12);
  write_bytes(path, header.bytes() + "ab");
  EXPECT_EQ(error_code(path), "truncated");
  write_bytes(path, NiftiBytes({2, -1, 1}, 4, 16).bytes());
  EXPECT_EQ(error_code(path), "bad-header");
  write_bytes(path, NiftiBytes({32767, 32767, 32767}, 64, 64).bytes());
  EXPECT_EQ(error_code(path), "too-large");
  write_bytes(path, NiftiBytes({1, 1, 1}, 4, 16).put<std::int32_t>(0, 540).bytes());
  EXPECT_EQ(error_code(path), "unsupported");
}

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
  EXPECT_EQ(error_code(folder_.path(), options), "no-volume");
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
