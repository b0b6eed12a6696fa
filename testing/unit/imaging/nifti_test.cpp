// NIfTI-1 and NIfTI-2: files written byte by byte here, and what must come of them.
#include "format_support.hpp"

#include <cmath>
#include <limits>

namespace {

using palpate::core::Provenance;
using palpate::imaging::read;
using palpate::imaging::ReadOptions;
using namespace palpate::testing;

/// A NIfTI-2 header for a single file, in this machine's order of bytes.
class Nifti2Bytes {
 public:
  Nifti2Bytes(const std::vector<std::int64_t>& dims, std::int16_t type, std::int16_t bits)
      : bytes_(544, '\0') {
    put<std::int32_t>(0, 540);
    std::memcpy(bytes_.data() + 4, "n+2\0\r\n\032\n", 8);
    put<std::int16_t>(12, type);
    put<std::int16_t>(14, bits);
    put<std::int64_t>(16, static_cast<std::int64_t>(dims.size()));
    for (std::size_t n = 0; n < 7; ++n) put<std::int64_t>(24 + 8 * n, n < dims.size() ? dims[n] : 1);
    for (std::size_t n = 0; n < 8; ++n) put<double>(104 + 8 * n, 1.0);
    put<std::int64_t>(168, 544);
    put<std::int32_t>(500, 2 + 8);  // mm and s
  }
  template <typename T>
  Nifti2Bytes& put(std::size_t at, T value) {
    std::memcpy(bytes_.data() + at, &value, sizeof(T));
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

class Nifti : public ::testing::Test {
 protected:
  const std::filesystem::path& with(const std::string& bytes) {
    write_bytes(file_, bytes);
    return file_;
  }
  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "scan.nii";
};

NiftiBytes cube() { return NiftiBytes({2, 2, 2}, 2, 8); }

/// The rows of the sform, in millimetres right, anterior, superior.
NiftiBytes& sform(NiftiBytes& header, const std::vector<float>& rows, std::int16_t code = 1) {
  header.put<std::int16_t>(254, code);
  for (std::size_t n = 0; n < 12; ++n) header.put<float>(280 + 4 * n, rows.at(n));
  return header;
}

TEST_F(Nifti, FirstVersionWithTimes) {
  NiftiBytes header({2, 1, 1, 3}, 4, 16);
  header.put<float>(92, 40.0F);
  const std::string voxels = bytes_of(std::vector<std::int16_t>{1, 2, 3, 4, 5, -6});
  auto sequence = read(with(header.bytes() + voxels));
  ASSERT_EQ(sequence.frames.size(), 3U);
  EXPECT_EQ(sequence.frames[2].data()[1], -6.0F);
  ASSERT_EQ(sequence.info.frame_times_s.size(), 3U);
  EXPECT_NEAR(sequence.info.frame_times_s[2], 0.08, 1e-12);  // 40 ms each
  EXPECT_EQ(sequence.info.time_provenance, Provenance::stated);
  for (const auto& [unit, third] : {std::pair<int, double>(8, 80.0), {16, 0.08}, {24, 8e-5}}) {
    header.put<char>(123, static_cast<char>(2 + unit));
    EXPECT_NEAR(read(with(header.bytes() + voxels)).info.frame_times_s.at(2), third, 1e-12) << unit;
  }
  header.put<char>(123, 2 + 8);
  EXPECT_TRUE(warned(read(with(header.bytes() + voxels)), "implausible-time"));  // 40 s a frame
  for (const int unit : {0, 32}) {                                               // not said; Hz
    header.put<char>(123, static_cast<char>(2 + unit));
    EXPECT_EQ(read(with(header.bytes() + voxels)).info.time_provenance, Provenance::absent) << unit;
  }
  ReadOptions options;
  options.frame = 1;
  EXPECT_EQ(voxels_of(read(file_, options)), (std::vector<float>{3, 4}));
}

TEST_F(Nifti, SecondVersion) {
  Nifti2Bytes header({2, 2, 2, 2}, 16, 32);
  header.put<double>(112, 0.25).put<double>(120, 0.5).put<double>(128, 0.75).put<double>(136, 0.04);
  header.put<std::int32_t>(348, 1);  // sform: scanner
  const std::vector<double> rows{0.25, 0, 0, -10, 0, 0.5, 0, 20, 0, 0, 0.75, 30};
  for (std::size_t n = 0; n < 12; ++n) header.put<double>(400 + 8 * n, rows[n]);
  std::vector<float> voxels = counted(16);
  for (const bool zipped : {false, true}) {
    const auto path = folder_ / (zipped ? "scan.nii.gz" : "scan.nii");
    write_bytes(path,
                zipped ? packed(header.bytes() + bytes_of(voxels), true) : header.bytes() + bytes_of(voxels));
    const auto sequence = read(path);
    ASSERT_EQ(sequence.frames.size(), 2U);
    EXPECT_EQ(voxels_of(sequence, 1), counted(8, 8.0F));
    EXPECT_EQ(sequence.info.pixel_type, "float32");
    EXPECT_EQ(sequence.info.frame_times_s, (std::vector<double>{0.0, 0.04}));
    EXPECT_EQ(sequence.info.geometry.to_lps_mm(Eigen::Vector3d(1, 1, 1)),
              Eigen::Vector3d(9.75, -20.5, 30.75));
  }
  EXPECT_EQ(error_code(with(header.bytes().substr(0, 500))), "truncated");
  EXPECT_EQ(error_code(with(header.bytes() + "few")), "truncated");
  header.put<std::int64_t>(24, std::int64_t{1} << 40);
  EXPECT_EQ(error_code(with(header.bytes() + bytes_of(voxels))), "bad-header");
  header.put<std::int64_t>(24, 2).put<std::int64_t>(16, -3);
  EXPECT_EQ(error_code(with(header.bytes() + bytes_of(voxels))), "bad-header");
}

TEST_F(Nifti, HighByteFirst) {
  NiftiBytes little({2, 1, 1}, 4, 16);
  // Each field of the header that is used, turned around by its own size.
  std::string bytes = little.bytes();
  const auto turn = [&](std::size_t at, std::size_t size) {
    std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                 bytes.begin() + static_cast<std::ptrdiff_t>(at + size));
  };
  turn(0, 4);
  for (std::size_t at = 40; at < 56; at += 2) turn(at, 2);
  for (const std::size_t at : {68, 70, 72, 252, 254}) turn(at, 2);
  for (std::size_t at = 76; at < 120; at += 4) turn(at, 4);
  for (std::size_t at = 256; at < 328; at += 4) turn(at, 4);
  EXPECT_EQ(voxels_of(read(with(bytes + big_endian_bytes(std::vector<std::int16_t>{7, -300})))),
            (std::vector<float>{7, -300}));
}

TEST_F(Nifti, PairsOfFiles) {
  NiftiBytes header = cube();
  header.put<float>(108, 0.0F);
  std::string bytes = header.bytes();
  std::memcpy(bytes.data() + 344, "ni1", 4);
  write_bytes(folder_ / "pair.hdr", bytes);
  EXPECT_EQ(error_code(folder_ / "pair.hdr"), "not-found");
  write_bytes(folder_ / "pair.img", counted_bytes(8));
  EXPECT_EQ(voxels_of(read(folder_ / "pair.hdr")), counted(8));
  EXPECT_EQ(voxels_of(read(folder_ / "pair.img")), counted(8));
  std::filesystem::remove(folder_ / "pair.img");
  write_bytes(folder_ / "pair.img.gz", packed(counted_bytes(8), true));
  EXPECT_EQ(voxels_of(read(folder_ / "pair.hdr")), counted(8));
  EXPECT_EQ(voxels_of(read(folder_ / "pair.img.gz")), counted(8));
  write_bytes(folder_ / "lone.img", counted_bytes(8));
  EXPECT_EQ(error_code(folder_ / "lone.img"), "not-found");
  std::memcpy(bytes.data() + 344, "\0\0\0", 4);
  write_bytes(folder_ / "pair.hdr", bytes);
  EXPECT_EQ(error_code(folder_ / "pair.hdr"), "unsupported");  // Analyze
}

TEST_F(Nifti, WhichPlacementHolds) {
  const std::string voxels = counted_bytes(8);
  NiftiBytes header = cube();
  auto info = read(with(header.bytes() + voxels)).info;
  EXPECT_EQ(info.direction_provenance, Provenance::absent);
  EXPECT_FALSE(info.patient_axes);
  EXPECT_EQ(info.spacing_provenance[0], Provenance::stated);
  // A quarter turn about the third axis: b = c = 0, d = sin 45 degrees; spacing 2 3 4, third axis flipped.
  header.put<std::int16_t>(252, 1).put<float>(264, 0.70710678F);
  header.put<float>(76, -1.0F).put<float>(80, 2.0F).put<float>(84, -3.0F).put<float>(88, 4.0F);
  header.put<float>(268, 10.0F).put<float>(272, 20.0F).put<float>(276, 30.0F);
  info = read(with(header.bytes() + voxels)).info;
  // RAS: i to +y, j to -x, k to -z; LPS turns x and y. Seven digits of the quaternion times 4 mm.
  EXPECT_LT((info.geometry.to_lps_mm({1, 0, 0}) - Eigen::Vector3d(-10, -22, 30)).norm(), 1e-5);
  EXPECT_LT((info.geometry.to_lps_mm({0, 1, 0}) - Eigen::Vector3d(-7, -20, 30)).norm(), 1e-5);
  EXPECT_LT((info.geometry.to_lps_mm({0, 0, 1}) - Eigen::Vector3d(-10, -20, 26)).norm(), 1e-5);
  EXPECT_TRUE(info.patient_axes);
  // The same again as sform: no doubt.
  sform(header, {0, -3, 0, 10, 2, 0, 0, 20, 0, 0, -4, 30});
  info = read(with(header.bytes() + voxels)).info;
  EXPECT_EQ(warning_text(info, "two-placements"), "");
  EXPECT_EQ(info.geometry.to_lps_mm({0, 1, 0}), Eigen::Vector3d(-7, -20, 30));
  // An sform in the space of a template: millimetres are those of the scanner.
  sform(header, {5, 0, 0, 0, 0, 5, 0, 0, 0, 0, 5, 0}, 4);
  info = read(with(header.bytes() + voxels)).info;
  EXPECT_NE(warning_text(info, "two-placements"), "");
  EXPECT_NEAR(info.geometry.spacing_mm()[0], 2.0, 1e-6);
  sform(header, {5, 0, 0, 0, 0, 5, 0, 0, 0, 0, 5, 0}, 1);
  info = read(with(header.bytes() + voxels)).info;
  EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(5, 5, 5));
  // A sheared or singular sform beside a qform: that one, and the numbers.
  for (const std::vector<float>& bad :
       {std::vector<float>{1, 0.5F, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}, {1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0}}) {
    info = read(with(sform(header, bad).bytes() + voxels)).info;
    EXPECT_NE(warning_text(info, "repaired-direction"), "");
    EXPECT_NEAR(info.geometry.spacing_mm()[1], 3.0, 1e-6);
  }
}

TEST_F(Nifti, SformsThatAreNoRotationAreRepairedOrRefusedWithTheirNumbers) {
  NiftiBytes header = cube();
  const std::string voxels = counted_bytes(8);
  // 0.05 between i and j: about three degrees.
  auto info = read(with(sform(header, {1, 0.05F, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}).bytes() + voxels)).info;
  EXPECT_NE(warning_text(info, "repaired-direction").find("0.049"), std::string::npos)
      << warning_text(info, "repaired-direction");
  const Eigen::Matrix3d axes = info.geometry.direction();
  EXPECT_LT((axes.transpose() * axes - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_EQ(error_code(with(sform(header, {1, 0.7F, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}).bytes() + voxels)),
            "bad-header");
  EXPECT_NE(error_text(file_).find("0.573462"), std::string::npos) << error_text(file_);  // 0.7 / sqrt(1.49)
  for (const std::vector<float>& bad : {std::vector<float>(12, 0.0F), {1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0}}) {
    EXPECT_EQ(error_code(with(sform(header, bad).bytes() + voxels)), "bad-header");
    EXPECT_NE(error_text(file_).find("singular sform"), std::string::npos);
    ReadOptions options;
    options.orientation = "RAS";
    info = read(file_, options).info;
    EXPECT_EQ(info.direction_provenance, Provenance::user);
    EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(1, 1, 1));
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(error_code(with(sform(header, {nan, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}).bytes() + voxels)),
            "bad-header");
}

TEST_F(Nifti, UnitsAndUnusableSpacing) {
  const std::string voxels(8000, 'v');
  for (const auto& [unit, mm] : {std::pair<int, double>(1, 1000.0), {2, 1.0}, {3, 1e-3}, {0, 1.0}}) {
    NiftiBytes header({20, 20, 20}, 2, 8);
    header.put<char>(123, static_cast<char>(unit));
    sform(header, {2, 0, 0, 4, 0, 2, 0, 4, 0, 0, 2, 4});
    const auto info = read(with(header.bytes() + voxels)).info;
    EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(2 * mm, 2 * mm, 2 * mm)) << unit;
    EXPECT_EQ(info.geometry.origin_mm(), Eigen::Vector3d(-4 * mm, -4 * mm, 4 * mm)) << unit;
    EXPECT_EQ(info.spacing_provenance[0], unit == 2 ? Provenance::stated : Provenance::derived) << unit;
    EXPECT_EQ(warning_text(info, "unknown-unit").empty(), unit != 0);
  }
  for (const float useless : {0.0F, std::numeric_limits<float>::quiet_NaN()}) {
    const auto info = read(with(cube().put<float>(84, useless).bytes() + counted_bytes(8))).info;
    EXPECT_EQ(info.spacing_provenance[1], Provenance::assumed);
    EXPECT_EQ(info.geometry.spacing_mm()[1], 1.0);
    EXPECT_NE(warning_text(info, "assumed-spacing"), "");
  }
}

TEST_F(Nifti, ScalingAndKindsOfVoxels) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto last = [&](float slope, float inter) {
    return voxels_of(
        read(with(cube().put<float>(112, slope).put<float>(116, inter).bytes() + counted_bytes(8))))[7];
  };
  EXPECT_EQ(last(2.0F, -3.0F), 11.0F);
  EXPECT_EQ(last(0.0F, 5.0F), 7.0F);
  EXPECT_EQ(last(nan, 5.0F), 7.0F);
  EXPECT_EQ(last(2.0F, nan), 14.0F);
  EXPECT_EQ(last(-1.0F, 0.0F), -7.0F);
  const auto colour = read(with(NiftiBytes({2, 1, 1}, 128, 24).put<float>(112, 2.0F).bytes() + "\xC8\x64\x32"
                                                                                               "abc"));
  EXPECT_FLOAT_EQ(voxels_of(colour)[0], static_cast<float>(0.299 * 200 + 0.587 * 100 + 0.114 * 50));
  EXPECT_TRUE(warned(colour, "colour-to-grey"));
  EXPECT_EQ(read(with(NiftiBytes({2, 1, 1}, 2304, 32).bytes() + "abcdefgh")).info.components, 4);
  EXPECT_EQ(voxels_of(read(
                with(NiftiBytes({2, 1, 1}, 32, 64).bytes() + bytes_of(std::vector<float>{3, 4, 0, -2})))),
            (std::vector<float>{5, 2}));
  EXPECT_EQ(
      voxels_of(read(with(NiftiBytes({1, 1, 1}, 1792, 128).bytes() + bytes_of(std::vector<double>{-3, 4})))),
      (std::vector<float>{5}));
  // Colour as a fifth axis, plane by plane.
  NiftiBytes planes({2, 1, 1, 1, 3}, 2, 8);
  planes.put<std::int16_t>(68, 2003);
  EXPECT_FLOAT_EQ(voxels_of(read(with(planes.bytes() + std::string("\xC8\0\x64\0\x32\xFF", 6))))[1],
                  static_cast<float>(0.114 * 255));
  EXPECT_EQ(error_code(with(NiftiBytes({2, 1, 1, 1, 3}, 2, 8).bytes() + "abcdef")), "unsupported");
  for (const int type : {1, 1536, 2048, 77})
    EXPECT_EQ(error_code(with(NiftiBytes({2, 1, 1}, static_cast<std::int16_t>(type), 128).bytes() +
                              std::string(64, 'x'))),
              "unsupported")
        << type;
  EXPECT_EQ(error_code(with(NiftiBytes({2, 1, 1}, 4, 8).bytes() + "abcd")), "bad-header");
}

TEST_F(Nifti, RefusesWhatDoesNotAddUp) {
  NiftiBytes header({2, 1, 1, 3}, 4, 16);
  EXPECT_EQ(error_code(with(header.bytes() + "ab")), "truncated");
  ReadOptions options;
  options.allow_truncated = true;
  const auto cut = read(file_, options);
  EXPECT_NE(warning_text(cut.info, "truncated").find("10 of 12 bytes"), std::string::npos);
  write_bytes(folder_ / "cut.nii.gz", packed(header.bytes() + "ab", true));
  EXPECT_EQ(error_code(folder_ / "cut.nii.gz"), "truncated");
  EXPECT_TRUE(warned(read(folder_ / "cut.nii.gz", options), "truncated"));
  EXPECT_EQ(error_code(with(NiftiBytes({2, -1, 1}, 4, 16).bytes())), "bad-header");
  EXPECT_EQ(error_code(with(NiftiBytes({32767, 32767, 32767}, 64, 64).bytes())), "truncated");
  EXPECT_EQ(error_code(file_, options), "too-large");
  EXPECT_EQ(error_code(with(NiftiBytes({1, 1, 1}, 4, 16).put<std::int32_t>(0, 540).bytes())), "unsupported");
  EXPECT_EQ(error_code(with(NiftiBytes({1, 1, 1}, 4, 16).put<std::int32_t>(0, 999).bytes())), "bad-header");
  for (const int axes : {0, -1, 8, 32767})
    EXPECT_EQ(error_code(with(cube().put<std::int16_t>(40, static_cast<std::int16_t>(axes)).bytes() +
                              counted_bytes(8))),
              "bad-header")
        << axes;
  for (const float offset : {0.0F, -352.0F, 352.5F, 1e20F, std::numeric_limits<float>::quiet_NaN()})
    EXPECT_EQ(error_code(with(cube().put<float>(108, offset).bytes() + counted_bytes(8))), "bad-header")
        << offset;
  EXPECT_EQ(error_code(with("short")), "truncated");
  EXPECT_EQ(error_code(with("")), "truncated");
}

}  // namespace
