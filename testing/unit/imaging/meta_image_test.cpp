// MetaImage: files written byte by byte here, and what must come of them.
#include "format_support.hpp"

#include <Eigen/LU>

#include <cmath>
#include <limits>

namespace {

using palpate::core::Provenance;
using palpate::core::VolumeSequence;
using palpate::imaging::read;
using palpate::imaging::ReadOptions;
using namespace palpate::testing;

class MetaImage : public ::testing::Test {
 protected:
  /// A header with its voxels elsewhere; `data` is what ElementDataFile says.
  std::filesystem::path detached(const std::string& dims, const std::string& data,
                                 const std::string& extra = {}) {
    const auto axes = 1 + std::count(dims.begin(), dims.end(), ' ');
    write_bytes(header_, "ObjectType = Image\nNDims = " + std::to_string(axes) + "\n" + extra + "DimSize = " +
                             dims + "\nElementType = MET_UCHAR\nElementDataFile = " + data + "\n");
    return header_;
  }
  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "scan.mha";
  std::filesystem::path header_ = folder_ / "scan.mhd";
};

template <typename T>
std::string type_read_back(const std::filesystem::path& path, const char* type) {
  const std::vector<T> values{
      0, 1, 2, 3, std::numeric_limits<T>::is_signed ? static_cast<T>(-4) : static_cast<T>(4), 5, 6, 100};
  const std::vector<float> expected(values.begin(), values.end());
  write_mha(path, "2 2 2", type, bytes_of(values));
  EXPECT_EQ(voxels_of(read(path)), expected) << type;
  std::string header = "NDims = 3\nDimSize = 2 2 2\nElementByteOrderMSB = True\nElementType = ";
  write_bytes(path, header + type + "\nElementDataFile = LOCAL\n" + big_endian_bytes(values));
  const VolumeSequence sequence = read(path);
  EXPECT_EQ(voxels_of(sequence), expected) << type << ", high byte first";
  return sequence.info.pixel_type;
}

TEST_F(MetaImage, EveryTypeInBothByteOrders) {
  EXPECT_EQ(type_read_back<std::uint8_t>(file_, "MET_UCHAR"), "uint8");
  EXPECT_EQ(type_read_back<std::int8_t>(file_, "MET_CHAR"), "int8");
  EXPECT_EQ(type_read_back<std::uint16_t>(file_, "MET_USHORT"), "uint16");
  EXPECT_EQ(type_read_back<std::int16_t>(file_, "MET_SHORT"), "int16");
  EXPECT_EQ(type_read_back<std::uint32_t>(file_, "MET_UINT"), "uint32");
  EXPECT_EQ(type_read_back<std::int32_t>(file_, "MET_INT"), "int32");
  EXPECT_EQ(type_read_back<std::uint32_t>(file_, "MET_ULONG"), "uint32");
  EXPECT_EQ(type_read_back<std::int32_t>(file_, "MET_LONG"), "int32");
  EXPECT_EQ(type_read_back<std::uint64_t>(file_, "MET_ULONG_LONG"), "uint64");
  EXPECT_EQ(type_read_back<std::int64_t>(file_, "MET_LONG_LONG"), "int64");
  EXPECT_EQ(type_read_back<float>(file_, "MET_FLOAT"), "float32");
  EXPECT_EQ(type_read_back<double>(file_, "MET_DOUBLE"), "float64");
  write_mha(file_, "2 2 2", "MET_UCHAR_ARRAY", counted_bytes(8));
  EXPECT_EQ(error_code(file_), "unsupported");
}

TEST_F(MetaImage, FlippedAndObliqueDirectionsKeepEveryVoxelsPlace) {
  // Rows of TransformMatrix are the axes: i along -x, j and k turned by 30 degrees about x.
  const double c = std::sqrt(3.0) / 2.0;
  write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, '\1'),
            "TransformMatrix = -1 0 0 0 0.86602540378443865 0.5 0 -0.5 0.86602540378443865\n"
            "Offset = 10 20 30\nElementSpacing = 1 2 3\nCenterOfRotation = 7 8 9\n");
  const auto info = read(file_).info;
  const Eigen::Vector3d expected(10.0 - 1.0, 20.0 + 2.0 * c - 3.0 * 0.5, 30.0 + 2.0 * 0.5 + 3.0 * c);
  // Sixteen digits in the header and a few operations: rounding only.
  EXPECT_LT((info.geometry.to_lps_mm(Eigen::Vector3d(1, 1, 1)) - expected).norm(), 1e-12);
  EXPECT_TRUE(info.patient_axes);
  EXPECT_EQ(info.direction_provenance, Provenance::stated);
}

TEST_F(MetaImage, SynonymsUnitsAndWhatIsNotSaid) {
  for (const char* key : {"Offset", "Origin", "Position"}) {
    write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8),
              std::string(key) + " = 1 2 3\nRotation = 0 1 0 -1 0 0 0 0 1\nElementSize = 4 5 6\n");
    const auto info = read(file_).info;
    EXPECT_EQ(info.geometry.origin_mm(), Eigen::Vector3d(1, 2, 3)) << key;
    EXPECT_EQ(info.origin_provenance, Provenance::stated);
    EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(4, 5, 6));
    EXPECT_EQ(Eigen::Vector3d(info.geometry.direction().col(0)), Eigen::Vector3d(0, 1, 0));
  }
  // Slices may be thinner than they are apart.
  write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8), "ElementSize = 4 5 6\nElementSpacing = 1 2 3\n");
  auto info = read(file_).info;
  EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(info.spacing_provenance[0], Provenance::stated);
  EXPECT_EQ(info.origin_provenance, Provenance::absent);
  EXPECT_EQ(info.direction_provenance, Provenance::absent);
  EXPECT_FALSE(info.patient_axes);
  EXPECT_EQ(info.time_provenance, Provenance::absent);
  for (const auto& [unit, mm] : {std::pair<const char*, double>("um", 1e-3), {"cm", 10.0}, {"mm", 1.0}}) {
    write_mha(file_, "20 20 20", "MET_UCHAR", std::string(8000, 'x'),
              std::string("ElementSpacing = 1 2 3\nOffset = 1 1 1\nDistanceUnits = ") + unit + "\n");
    info = read(file_).info;
    EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(1 * mm, 2 * mm, 3 * mm)) << unit;
    EXPECT_EQ(info.geometry.origin_mm(), Eigen::Vector3d(mm, mm, mm)) << unit;
    EXPECT_EQ(info.spacing_provenance[1], mm == 1.0 ? Provenance::stated : Provenance::derived) << unit;
  }
  write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8),
            "ElementSpacing = 1 2 3\nDistanceUnits = furlong\n");
  EXPECT_TRUE(warned(read(file_), "unknown-unit"));
}

TEST_F(MetaImage, NamedAxesAreAmbiguousWithoutTheMatrix) {
  write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8),
            "AnatomicalOrientation = RAI\nElementSpacing = 1 1 1\n");
  auto info = read(file_).info;
  EXPECT_EQ(info.orientation, "LPS");  // as ITK writes it for the identity
  EXPECT_EQ(info.orientation_choices, (std::vector<std::string>{"LPS", "RAI"}));
  EXPECT_FALSE(info.patient_axes);
  EXPECT_NE(warning_text(info, "orientation-ambiguous"), "");
  const std::string identity = "TransformMatrix = 1 0 0 0 1 0 0 0 1\n";
  write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8), identity + "AnatomicalOrientation = RAI\n");
  info = read(file_).info;
  EXPECT_TRUE(info.patient_axes);
  EXPECT_TRUE(info.orientation_choices.empty());
  EXPECT_EQ(warning_text(info, "orientation-contradiction"), "");
  write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8), identity + "AnatomicalOrientation = SPL\n");
  EXPECT_NE(warning_text(read(file_).info, "orientation-contradiction"), "");
  write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8), "AnatomicalOrientation = ???\n");
  EXPECT_EQ(read(file_).info.direction_provenance, Provenance::absent);
}

TEST_F(MetaImage, MatricesThatAreNoRotationAreRepairedOrRefusedWithTheirNumbers) {
  const auto with = [&](const std::string& matrix) {
    write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8),
              "TransformMatrix = " + matrix + "\nElementSpacing = 1 1 1\n");
    return file_;
  };
  // Four degrees between i and j: the nearest rotation turns each by half of it.
  auto info = read(with("1 0 0 0.0697564737 0.9975640503 0 0 0 1")).info;
  const double half = 2.0 * std::acos(-1.0) / 180.0;
  EXPECT_NEAR(info.geometry.direction()(0, 0), std::cos(half), 1e-9);  // ten digits in the header
  EXPECT_NEAR(info.geometry.direction()(1, 0), -std::sin(half), 1e-9);
  EXPECT_NEAR(info.geometry.direction().determinant(), 1.0, 1e-12);
  EXPECT_NE(warning_text(info, "repaired-direction").find("0.0697565"), std::string::npos);
  info = read(with("2 0 0 0 2 0 0 0 2")).info;
  EXPECT_NE(warning_text(info, "repaired-direction").find("2 0 0"), std::string::npos);
  EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(1, 1, 1));
  EXPECT_EQ(info.geometry.direction(), Eigen::Matrix3d::Identity());
  EXPECT_EQ(error_code(with("1 0 0 0.6 0.8 0 0 0 1")), "bad-header");
  EXPECT_NE(error_text(file_).find("1 0.6 0; 0 0.8 0; 0 0 1"), std::string::npos) << error_text(file_);
  // The user may say what the file does not.
  ReadOptions options;
  options.orientation = "RAS";
  EXPECT_EQ(read(file_, options).info.geometry.direction()(0, 0), -1.0);
  for (const char* singular : {"1 0 0 0 1 0 0 1 0", "0 0 0 0 1 0 0 0 1", "1 0 0 1 0 0 0 0 1"})
    EXPECT_EQ(error_code(with(singular)), "bad-header") << singular;
  EXPECT_EQ(error_code(with("1 0 0 0 1 0 0 0")), "bad-header");
  // A mirrored system is not wrong, only left-handed.
  info = read(with("-1 0 0 0 1 0 0 0 1")).info;
  EXPECT_EQ(info.geometry.direction()(0, 0), -1.0);
  EXPECT_EQ(warning_text(info, "repaired-direction"), "");
}

TEST_F(MetaImage, SlantedSlicesStayWhereTheScannerPutThem) {
  write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, 'x'),
            "TransformMatrix = 1 0 0 0 1 0 0 0.6 0.8\nElementSpacing = 1 1 1\n");
  const auto sequence = read(file_);
  EXPECT_NE(warning_text(sequence.info, "sheared-axes").find("0 1 0.6"), std::string::npos);
  EXPECT_NEAR(sequence.info.geometry.direction()(1, 2), 0.6, 1e-12);
}

TEST_F(MetaImage, ColourBecomesRec601LumaAndSaysSo) {
  write_mha(file_, "2 1 1", "MET_UCHAR", std::string("\xC8\x64\x32\x00\x00\xFF", 6),
            "ElementNumberOfChannels = 3\n");
  const auto sequence = read(file_);
  // Half a unit in the last place of a float near 124 is 4e-6.
  EXPECT_NEAR(sequence.frames.at(0).data()[0], 0.299 * 200 + 0.587 * 100 + 0.114 * 50, 1e-5);
  EXPECT_NEAR(sequence.frames.at(0).data()[1], 0.114 * 255, 1e-5);
  EXPECT_TRUE(warned(sequence, "colour-to-grey"));
  EXPECT_EQ(sequence.info.components, 3);
  write_mha(file_, "2 1 1", "MET_UCHAR", "abcd", "ElementNumberOfChannels = 2\n");
  EXPECT_EQ(error_code(file_), "unsupported");
}

TEST_F(MetaImage, FourthAxisIsTimeAndFramesCanBeReadAlone) {
  write_mha(file_, "2 1 1 3", "MET_UCHAR", counted_bytes(6), "ElementSpacing = 1 1 1 0.25\n");
  const auto all = read(file_);
  ASSERT_EQ(all.frames.size(), 3U);
  EXPECT_EQ(all.info.frame_times_s, (std::vector<double>{0.0, 0.25, 0.5}));
  for (const bool zipped : {false, true}) {
    if (zipped)
      write_mha(file_, "2 1 1 3", "MET_UCHAR", packed(counted_bytes(6), false), "CompressedData = True\n");
    ReadOptions options;
    options.frame = 1;
    options.frame_count = 2;
    const auto two = read(file_, options);
    ASSERT_EQ(two.frames.size(), 2U);
    EXPECT_EQ(two.first_frame, 1);
    EXPECT_EQ(voxels_of(two, 0), counted(2, 2.0F));
    EXPECT_EQ(voxels_of(two, 1), counted(2, 4.0F));
    EXPECT_EQ(two.info.frames, 3);
    options.frame = 3;
    EXPECT_THROW(read(file_, options), palpate::core::Error);
  }
  write_mha(file_, "2 1 1 3", "MET_UCHAR", counted_bytes(6), "ElementSpacing = 1 1 1 1\n");
  EXPECT_TRUE(read(file_).info.frame_times_s.empty());  // what writers put where they know no time
  write_mha(file_, "2 1 1 3", "MET_UCHAR", counted_bytes(6), "ElementSpacing = 1 1 1 40\n");
  EXPECT_TRUE(warned(read(file_), "implausible-time"));
}

TEST_F(MetaImage, TrackedUltrasoundIsTimeAndItsSpacingUnknown) {
  const std::string stamps = "Seq_Frame0000_Timestamp = 5.5\nSeq_Frame0001_Timestamp = 5.75\n";
  write_mha(file_, "2 1 2", "MET_UCHAR", "abcd",
            "ElementSpacing = 1 1 1\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nKinds = domain "
            "domain list\n" +
                stamps);
  auto sequence = read(file_);
  EXPECT_EQ(sequence.info.geometry.dims(), (std::array<int, 3>{2, 1, 1}));
  EXPECT_EQ(sequence.info.frame_times_s, (std::vector<double>{0.0, 0.25}));
  EXPECT_EQ(sequence.info.time_provenance, Provenance::stated);
  EXPECT_EQ(sequence.info.spacing_provenance[0], Provenance::assumed);
  EXPECT_TRUE(warned(sequence, "assumed-spacing"));
  EXPECT_FALSE(sequence.info.patient_axes);  // the picture lies in its own pixels
  // Volumes that follow one another.
  write_mha(file_, "2 1 2 2", "MET_UCHAR", counted_bytes(8),
            "ElementSpacing = 0.5 0.5 0.5 1\nKinds = domain domain domain list\n" + stamps);
  sequence = read(file_);
  EXPECT_EQ(sequence.info.geometry.dims(), (std::array<int, 3>{2, 1, 2}));
  EXPECT_EQ(sequence.info.frame_times_s, (std::vector<double>{0.0, 0.25}));
  EXPECT_EQ(sequence.info.geometry.spacing_mm(), Eigen::Vector3d(0.5, 0.5, 0.5));
  EXPECT_EQ(voxels_of(sequence, 1), counted(4, 4.0F));
  // A volume that was made from a sequence keeps its kinds, but has no frames.
  write_mha(file_, "2 1 2", "MET_UCHAR", "abcd",
            "ElementSpacing = 0.5 0.5 0.5\nKinds = domain domain list\n");
  EXPECT_EQ(read(file_).info.geometry.dims(), (std::array<int, 3>{2, 1, 2}));
  // Times that go back are the file's own.
  write_mha(file_, "2 1 2", "MET_UCHAR", "abcd",
            "Seq_Frame0000_Timestamp = 5.5\nSeq_Frame0001_Timestamp = 5.25\n");
  EXPECT_TRUE(warned(read(file_), "unordered-times"));
  write_mha(file_, "2 1 2", "MET_UCHAR", "abcd", "Seq_Frame0000_Timestamp = 5.5\n");
  EXPECT_EQ(read(file_).info.time_provenance, Provenance::absent);
}

TEST_F(MetaImage, SaysWhereSpacingComesFromAndTakesTheUsers) {
  write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, 'x'));
  EXPECT_TRUE(warned(read(file_), "assumed-spacing"));
  ReadOptions options;
  options.spacing_mm = {0.5, 0.5, 2.0};
  const auto sequence = read(file_, options);
  EXPECT_EQ(sequence.info.geometry.spacing_mm(), Eigen::Vector3d(0.5, 0.5, 2.0));
  EXPECT_EQ(sequence.info.spacing_provenance[2], Provenance::user);
  EXPECT_FALSE(warned(sequence, "assumed-spacing"));
}

TEST_F(MetaImage, VoxelsThatAreNoNumbersBecomeTheSmallest) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  write_mha(file_, "2 2 1", "MET_FLOAT", bytes_of(std::vector<float>{nan, 3.0F, infinite, -2.0F}));
  const auto sequence = read(file_);
  EXPECT_EQ(voxels_of(sequence), (std::vector<float>{-2.0F, 3.0F, -2.0F, -2.0F}));
  EXPECT_EQ(sequence.info.max, 3.0);
  EXPECT_TRUE(warned(sequence, "non-finite-voxels"));
  write_mha(file_, "2 1 1", "MET_DOUBLE", bytes_of(std::vector<double>{1e300, 3.0}));
  EXPECT_TRUE(warned(read(file_), "non-finite-voxels"));  // no float holds it
  write_mha(file_, "2 1 1", "MET_FLOAT", bytes_of(std::vector<float>{nan, nan}));
  EXPECT_EQ(error_code(file_), "no-image");
}

TEST_F(MetaImage, PackedTextAndDetachedVoxels) {
  const std::string zipped = packed(counted_bytes(8), false);
  const std::string size = "CompressedDataSize = " + std::to_string(zipped.size()) + "       \n";
  write_mha(file_, "2 2 2", "MET_UCHAR", zipped, "CompressedData = True\n" + size);
  EXPECT_EQ(voxels_of(read(file_)), counted(8));
  write_mha(file_, "2 2 2", "MET_UCHAR", zipped, "CompressedData = True\n");
  EXPECT_EQ(voxels_of(read(file_)), counted(8));
  write_bytes(folder_ / "scan.zraw", zipped);
  EXPECT_EQ(voxels_of(read(detached("2 2 2", "scan.zraw", "CompressedData = True\n" + size))), counted(8));
  write_bytes(folder_ / "with blanks.raw", counted_bytes(8));
  EXPECT_EQ(voxels_of(read(detached("2 2 2", "with blanks.raw"))), counted(8));
  write_bytes(folder_ / "ahead.raw", "twelve bytes" + counted_bytes(8));
  EXPECT_EQ(voxels_of(read(detached("2 2 2", "ahead.raw", "HeaderSize = -1\n"))), counted(8));
  EXPECT_EQ(voxels_of(read(detached("2 2 2", "ahead.raw", "HeaderSize = 12\n"))), counted(8));
  EXPECT_EQ(error_code(detached("2 2 2", "ahead.raw", "HeaderSize = 13\n")), "truncated");
  EXPECT_EQ(error_code(detached("2 2 2", "ahead.raw", "HeaderSize = -2\n")), "bad-header");
  EXPECT_TRUE(warned(read(detached("2 2 2", "ahead.raw")), "extra-data"));
  write_mha(file_, "2 2 2", "MET_UCHAR", "0 1 2 3\n4 5 6 7\n", "");
  std::string text =
      "NDims = 3\nBinaryData = False\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
  write_bytes(file_, text + "0 1 2 3\r\n4 5 6\t7");
  EXPECT_EQ(voxels_of(read(file_)), counted(8));
  write_bytes(file_, text + "0 1 2 3 4 5 6");
  EXPECT_EQ(error_code(file_), "truncated");
  for (const char* wrong : {"banana", "256", "-1", "0.5", "nan"}) {
    write_bytes(file_, text + "0 1 2 3 4 5 6 " + wrong);
    EXPECT_EQ(error_code(file_), "bad-header") << wrong;
  }
  write_bytes(file_,
              "ObjectType = Image\r\nNDims = 3\r\nDimSize = 2 2 2\r\nElementType = MET_UCHAR\r\n"
              "ElementDataFile = LOCAL\r\n" +
                  counted_bytes(8));
  EXPECT_EQ(voxels_of(read(file_)), counted(8));
  write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8),
            "ElementToIntensityFunctionSlope = 2\nElementToIntensityFunctionOffset = -3\n");
  EXPECT_EQ(voxels_of(read(file_))[7], 11.0F);
}

TEST_F(MetaImage, HeadersOfAnyLengthDoNoHarm) {
  // Longer than the buffers of the usual library.
  const std::string name(200, 'n');
  write_bytes(folder_ / (name + ".raw"), counted_bytes(8));
  EXPECT_EQ(voxels_of(read(detached("2 2 2", name + ".raw"))), counted(8));
  write_mha(file_, "2 2 2", "MET_UCHAR", counted_bytes(8),
            "Comment = " + std::string(100000, 'A') + "\n" + std::string(3000, 'B') + " = " +
                std::string(700, 'C') + "\n");
  EXPECT_EQ(voxels_of(read(file_)), counted(8));
  write_bytes(file_, "NDims = 3\nComment = " + std::string(3 << 20, 'A'));
  EXPECT_EQ(error_code(file_), "bad-header");
  write_bytes(file_, "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\n");
  EXPECT_EQ(error_code(file_), "bad-header");
  write_bytes(
      file_,
      "NDims = 3\nDimSize = 2 2 2\nDimSize = 4 4 4\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n");
  EXPECT_EQ(error_code(file_), "bad-header");
}

TEST_F(MetaImage, ListsOfFiles) {
  for (int n = 0; n < 4; ++n) write_bytes(folder_ / ("s" + std::to_string(n)), counted_bytes(4, 4 * n));
  EXPECT_EQ(voxels_of(read(detached("2 2 4", "LIST\ns0\ns1\ns2\ns3"))), counted(16));
  EXPECT_EQ(error_code(detached("2 2 4", "LIST\ns0\ns1\ns2")), "truncated");
  EXPECT_EQ(error_code(detached("2 2 3", "LIST\ns0\ns1\ns2\ns3")), "truncated");
  EXPECT_EQ(error_code(detached("2 2 4", "LIST\ns0\ns1\ns2\nmissing")), "not-found");
  // Four axes: a file a slice, or a file a frame.
  auto sequence = read(detached("2 2 2 2", "LIST 2D\ns0\ns1\ns2\ns3"));
  ASSERT_EQ(sequence.frames.size(), 2U);
  EXPECT_EQ(voxels_of(sequence, 1), counted(8, 8.0F));
  for (int n = 0; n < 2; ++n) write_bytes(folder_ / ("v" + std::to_string(n)), counted_bytes(8, 8 * n));
  for (const char* list : {"LIST 3D\nv0\nv1", "LIST 3\nv0\nv1", "LIST\nv0\nv1"})
    EXPECT_EQ(voxels_of(read(detached("2 2 2 2", list)), 1), counted(8, 8.0F)) << list;
  ReadOptions last;
  last.frame = 1;
  EXPECT_EQ(voxels_of(read(detached("2 2 2 2", "LIST\nv0\nv1"), last)), counted(8, 8.0F));
  EXPECT_EQ(error_code(detached("2 2 2 2", "LIST 9D\nv0\nv1")), "bad-header");
  // Files of different sizes belong to different scans.
  write_bytes(folder_ / "s3", counted_bytes(5, 12));
  EXPECT_EQ(error_code(detached("2 2 4", "LIST\ns0\ns1\ns2\ns3")), "bad-header");
  write_bytes(folder_ / "s3", counted_bytes(3, 12));
  EXPECT_EQ(error_code(header_), "truncated");
  ReadOptions options;
  options.allow_truncated = true;
  sequence = read(header_, options);
  EXPECT_TRUE(warned(sequence, "truncated"));
  auto expected = counted(16);
  expected.back() = 0.0F;
  EXPECT_EQ(voxels_of(sequence), expected);
}

TEST_F(MetaImage, PatternsOfFiles) {
  for (int n = 1; n <= 10; ++n) {
    std::ostringstream name;
    name << "slice" << (n < 10 ? "00" : "0") << n << ".raw";
    write_bytes(folder_ / name.str(), counted_bytes(4, 4 * n));
  }
  EXPECT_EQ(voxels_of(read(detached("2 2 10", "slice%03d.raw 1 10 1"))), counted(40, 4.0F));
  EXPECT_EQ(voxels_of(read(detached("2 2 10", "slice%03d.raw"))), counted(40, 4.0F));
  EXPECT_EQ(voxels_of(read(detached("2 2 3", "slice%03d.raw 4"))), counted(12, 16.0F));
  EXPECT_EQ(voxels_of(read(detached("2 2 2", "slice%03d.raw 2 6 4")))[4], 24.0F);
  EXPECT_EQ(voxels_of(read(detached("2 2 1 2", "slice%03d.raw 1 2 1 2")), 1), counted(4, 8.0F));
  EXPECT_EQ(error_code(detached("2 2 9", "slice%03d.raw 1 10 1")), "truncated");
  EXPECT_EQ(error_code(detached("2 2 11", "slice%03d.raw 1 11 1")), "not-found");
  for (const char* pattern : {"slice%s.raw 1 10 1", "slice%d%d.raw 1 10 1", "slice%n.raw 1 10 1", "%d 1 10 0",
                              "%d 1 99999999999999 1", "%99999d 1 10 1", "slice%03d.raw x 10 1"})
    EXPECT_EQ(error_code(detached("2 2 10", pattern)), "bad-header") << pattern;
}

TEST_F(MetaImage, RefusesWhatDoesNotAddUp) {
  write_mha(file_, "4 4 4", "MET_UCHAR", std::string(63, 'x'));
  EXPECT_EQ(error_code(file_), "truncated");
  EXPECT_NE(error_text(file_).find("63 bytes"), std::string::npos);
  ReadOptions options;
  options.allow_truncated = true;
  const auto cut = read(file_, options);
  EXPECT_NE(warning_text(cut.info, "truncated").find("1 of 64 bytes"), std::string::npos);
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
  // More than any integer holds, and still told right: (2^31 - 1)^3.
  EXPECT_NE(error_text(file_).find("99035203004479"), std::string::npos) << error_text(file_);
  EXPECT_EQ(error_code(file_, options), "too-large");
  // No stream unpacks to a thousand times its size and more.
  write_mha(file_, "2000 2000 200", "MET_UCHAR", packed("x", false), "CompressedData = True\n");
  EXPECT_EQ(error_code(file_), "truncated");
  for (const char* line :
       {"ElementSpacing = 1 0 1\n", "ElementSpacing = 1 -1 1\n", "ElementSpacing = 1 1\n",
        "ElementSpacing = 1 nan 1\n", "ElementNumberOfChannels = 0\n",
        "ElementNumberOfChannels = 2000000000\n", "Offset = 1 2\n", "Offset = 1 2 inf\n"}) {
    write_mha(file_, "2 2 2", "MET_UCHAR", std::string(8, 'x'), line);
    EXPECT_EQ(error_code(file_), "bad-header") << line;
  }
  for (const char* axes : {"0", "-1", "11", "x"}) {
    write_bytes(file_, "ObjectType = Image\nNDims = " + std::string(axes) +
                           "\nDimSize = 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\nx");
    EXPECT_EQ(error_code(file_), "bad-header") << axes;
  }
  write_bytes(
      file_,
      "ObjectType = Tube\nNDims = 1\nDimSize = 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\nx");
  EXPECT_EQ(error_code(file_), "unsupported");
}

TEST_F(MetaImage, DamagedStreamsAreRefusedOrOpenedWithAWarning) {
  std::string noise;
  for (unsigned n = 0; n < 4096; ++n) noise.push_back(static_cast<char>((n * 2654435761U) >> 13));
  const std::string zipped = packed(noise, false);
  ReadOptions options;
  options.allow_truncated = true;
  const auto with = [&](const std::string& stream) {
    write_mha(file_, "16 16 16", "MET_UCHAR", stream, "CompressedData = True\n");
    return file_;
  };
  EXPECT_EQ(error_code(with(zipped)), "none");
  EXPECT_EQ(error_code(with(zipped.substr(0, zipped.size() / 2))), "truncated");
  const auto half = read(file_, options);
  EXPECT_TRUE(warned(half, "truncated"));
  EXPECT_EQ(half.frames.at(0).data()[100], static_cast<float>(static_cast<unsigned char>(noise[100])));
  EXPECT_EQ(half.frames.at(0).data()[4095], 0.0F);
  std::string wrong = zipped;
  wrong.back() = static_cast<char>(wrong.back() ^ 1);  // the checksum at its end
  EXPECT_EQ(error_code(with(wrong)), "truncated");
  EXPECT_EQ(error_code(with("no stream at all")), "truncated");
  EXPECT_TRUE(warned(read(with(packed(noise + "more", false))), "extra-data"));
  // Who opens the first frame learns that the last is missing.
  write_mha(file_, "16 16 8 2", "MET_UCHAR", zipped.substr(0, zipped.size() / 2 + 100),
            "CompressedData = True\n");
  ReadOptions first;
  first.frame = 0;
  EXPECT_EQ(error_code(file_, first), "truncated");
}

TEST_F(MetaImage, FollowsNoDataFileOutOfItsFolder) {
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
  EXPECT_EQ(naming("LIST\n../secret.raw\n../secret.raw"), "bad-header");
  EXPECT_EQ(naming("../s%dcret.raw 1 2 1"), "bad-header");
  EXPECT_EQ(naming((folder_ / "secret.raw").string()), "bad-header");
  std::filesystem::create_symlink("../secret.raw", folder_ / "inner" / "link.raw");
  EXPECT_EQ(naming("link.raw"), "bad-header");
  EXPECT_EQ(naming("scan.mhd"), "bad-header");
  EXPECT_EQ(naming("."), "not-found");
  EXPECT_EQ(naming("missing.raw"), "not-found");
  EXPECT_EQ(naming(std::string(300, 'A') + "%d.raw 1 2 1"), "not-found");
  write_bytes(folder_ / "inner" / "own.raw", std::string(8, 's'));
  EXPECT_EQ(naming("own.raw"), "none");
  std::filesystem::create_directory(folder_ / "inner" / "below");
  std::filesystem::rename(folder_ / "inner" / "own.raw", folder_ / "inner" / "below" / "own.raw");
  EXPECT_EQ(naming("below/own.raw"), "none");
}

}  // namespace
