// NRRD: files written byte by byte here, and what must come of them.
#include "format_support.hpp"

#include <bzlib.h>

namespace {

using palpate::core::Provenance;
using palpate::imaging::read;
using palpate::imaging::ReadOptions;
using namespace palpate::testing;

class Nrrd : public ::testing::Test {
 protected:
  /// A file of 8-bit voxels: the lines of its header but type and encoding, then the voxels.
  const std::filesystem::path& with(const std::string& lines, const std::string& voxels) {
    write_bytes(file_, "NRRD0005\n# made here\ntype: uint8\nencoding: raw\n" + lines + "\n" + voxels);
    return file_;
  }
  const std::filesystem::path& lines(const std::string& lines, const std::string& voxels = {}) {
    write_bytes(file_, "NRRD0004\n" + lines + "\n" + voxels);
    return file_;
  }
  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "scan.nrrd";
};

const std::string cube = "dimension: 3\nsizes: 2 2 2\n";
const std::string lps = "space: left-posterior-superior\nspace directions: (1,0,0) (0,2,0) (0,0,3)\n";

std::string bzip2(const std::string& bytes) {
  std::string in = bytes;
  std::string out(bytes.size() + 1000, '\0');
  auto size = static_cast<unsigned>(out.size());
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(out.data(), &size, in.data(), static_cast<unsigned>(in.size()), 9, 0, 0),
            BZ_OK);
  out.resize(size);
  return out;
}

TEST_F(Nrrd, EveryEncoding) {
  const std::string gz = packed(counted_bytes(8), true);
  const std::string bz = bzip2(counted_bytes(8));
  const std::string head = "type: unsigned char\n" + cube;
  for (const auto& [name, data] : {std::pair<std::string, std::string>("raw", counted_bytes(8)),
                                   {"gzip", gz},
                                   {"gz", gz},
                                   {"bzip2", bz},
                                   {"bz2", bz},
                                   {"text", "0 1 2,3\n4 5, 6 7\n"},
                                   {"ascii", "0 1 2 3 4 5 6 7"},
                                   {"txt", " 0 1 2 3 4 5 6 7"},
                                   {"hex", "00010203\n0405 0607\n"}})
    EXPECT_EQ(voxels_of(read(lines(head + "encoding: " + name + "\n", data))), counted(8)) << name;
  EXPECT_EQ(error_code(lines(head + "encoding: zrl\n", "x")), "unsupported");
  for (const auto& [name, data] : {std::pair<std::string, std::string>("raw", counted_bytes(7)),
                                   {"gz", gz.substr(0, gz.size() - 9)},
                                   {"gz", packed(counted_bytes(7), true)},
                                   {"bz2", bz.substr(0, bz.size() - 6)},
                                   {"bz2", bzip2("1234567")},
                                   {"text", "0 1 2 3 4 5 6"},
                                   {"hex", "0001020304050"}})
    EXPECT_EQ(error_code(lines(head + "encoding: " + name + "\n", data)), "truncated") << name;
  for (const auto& [name, data] :
       {std::pair<std::string, std::string>("text", "0 1 2 3 x 5 6 7"), {"hex", "00010203040506xx"}})
    EXPECT_EQ(error_code(lines(head + "encoding: " + name + "\n", data)), "bad-header") << name;
  // Two members of gzip that follow one another, as parallel writers make them.
  EXPECT_EQ(voxels_of(read(lines(head + "encoding: gzip\n",
                                 packed(counted_bytes(5), true) + packed(counted_bytes(3, 5), true)))),
            counted(8));
}

TEST_F(Nrrd, TypesAndByteOrder) {
  const std::vector<std::int16_t> values{0, -1, 2, 300};
  const std::string head = "type: signed short\ndimension: 2\nsizes: 2 2\n";
  EXPECT_EQ(voxels_of(read(lines(head + "encoding: raw\nendian: big\n", big_endian_bytes(values)))),
            (std::vector<float>{0, -1, 2, 300}));
  EXPECT_EQ(voxels_of(read(lines(head + "encoding: raw\nendian: little\n", bytes_of(values)))),
            (std::vector<float>{0, -1, 2, 300}));
  EXPECT_EQ(error_code(lines(head + "encoding: raw\n", bytes_of(values))),
            "bad-header");  // nothing is guessed
  EXPECT_EQ(voxels_of(read(lines(head + "encoding: text\n", "0 -1 2 300"))),
            (std::vector<float>{0, -1, 2, 300}));
  EXPECT_EQ(read(file_).info.pixel_type, "int16");
  EXPECT_EQ(
      error_code(lines("type: block\nblock size: 4\ndimension: 1\nsizes: 2\nencoding: raw\n", "12345678")),
      "unsupported");
}

TEST_F(Nrrd, DetachedListedAndSkippedData) {
  write_bytes(folder_ / "a.raw", "one line\nanother\nxyz" + counted_bytes(8));
  const std::string head = cube + "data file: a.raw\n";
  EXPECT_EQ(voxels_of(read(with(head + "line skip: 2\nbyte skip: 3\n", ""))), counted(8));
  EXPECT_EQ(voxels_of(read(with(head + "byteskip: -1\n", ""))), counted(8));
  EXPECT_EQ(voxels_of(read(with(head + "byte skip: 20\n", ""))), counted(8));
  EXPECT_EQ(error_code(with(head + "byte skip: 21\n", "")), "truncated");
  EXPECT_EQ(error_code(with(head + "line skip: 3\n", "")), "truncated");
  EXPECT_EQ(error_code(with(head + "byte skip: -2\n", "")), "bad-header");
  write_bytes(folder_ / "a.gz", "text\n" + packed("xyz" + counted_bytes(8), true));
  const std::string zipped = "type: uint8\nencoding: gzip\n" + cube + "datafile: a.gz\nlineskip: 1\n";
  EXPECT_EQ(voxels_of(read(lines(zipped + "byte skip: 3\n"))), counted(8));
  EXPECT_EQ(error_code(lines(zipped + "byte skip: -1\n")), "unsupported");

  for (int n = 0; n < 2; ++n) write_bytes(folder_ / ("s" + std::to_string(n)), counted_bytes(4, 4 * n));
  EXPECT_EQ(voxels_of(read(with(cube + "data file: LIST\ns0\ns1\n", ""))), counted(8));
  EXPECT_EQ(voxels_of(read(with(cube + "data file: LIST 2\ns0\ns1\n", ""))), counted(8));
  EXPECT_EQ(voxels_of(read(with(cube + "data file: s%d 0 1 1\n", ""))), counted(8));
  EXPECT_EQ(voxels_of(read(with(cube + "data file: s%d 1 0 -1 2\n", "")))[0], 4.0F);
  // Slabs: each file has all axes, and its part of the slowest.
  EXPECT_EQ(voxels_of(read(with("dimension: 2\nsizes: 2 4\ndata file: LIST 2\ns0\ns1\n", ""))), counted(8));
  EXPECT_EQ(error_code(with(cube + "data file: LIST\ns0\n", "")), "truncated");
  EXPECT_EQ(error_code(with(cube + "data file: LIST\n", "")), "truncated");
  EXPECT_EQ(error_code(with(cube + "data file: s%d 0 2 1\n", "")), "truncated");
  EXPECT_EQ(error_code(with(cube + "data file: s%d 0 1 0\n", "")), "bad-header");
  write_bytes(folder_ / "s1", counted_bytes(5, 4));
  EXPECT_EQ(error_code(with(cube + "data file: LIST\ns0\ns1\n", "")), "bad-header");
  for (const char* way_out : {"../x.raw", "/etc/passwd", "LIST\n../s0\n../s1", "../s%d 0 1 1", "scan.nrrd"})
    EXPECT_EQ(error_code(with(cube + "data file: " + way_out + "\n", "")), "bad-header") << way_out;
  EXPECT_EQ(error_code(with(cube + "data file: none.raw\n", "")), "not-found");
}

TEST_F(Nrrd, SpacesAreTurnedToLps) {
  const std::string box = "dimension: 3\nsizes: 2 1 1\n";
  const std::string rest = "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (10,20,30)\n";
  for (const auto& [space, x, y] :
       {std::tuple<const char*, double, double>("right-anterior-superior", -1, -1),
        {"RAS", -1, -1},
        {"left-anterior-superior", 1, -1},
        {"LPS", 1, 1},
        {"left-posterior-superior", 1, 1}}) {
    const auto info = read(with(box + "space: " + space + "\n" + rest, "ab")).info;
    EXPECT_EQ(info.geometry.to_lps_mm(Eigen::Vector3d(1, 0, 0)), Eigen::Vector3d(11 * x, 20 * y, 30))
        << space;
    EXPECT_TRUE(info.patient_axes);
    EXPECT_EQ(info.origin_provenance, Provenance::stated);
  }
  for (const char* space : {"space: scanner-xyz\n", "space dimension: 3\n", "space: 3D-right-handed\n"}) {
    const auto info =
        read(with(box + space + rest + "measurement frame: (1,0,0) (0,1,0) (0,0,1)\n", "ab")).info;
    EXPECT_EQ(info.direction_provenance, Provenance::assumed) << space;
    EXPECT_EQ(info.spacing_provenance[0], Provenance::stated) << space;
    EXPECT_FALSE(info.patient_axes) << space;
  }
  // Blanks in vectors, and a slice in space.
  const auto slice =
      read(with("dimension: 2\nsizes: 2 1\nspace: LPS\nspace directions: ( 0, 0.5, 0 ) (0,0,-0.5)\n", "ab"))
          .info;
  EXPECT_EQ(slice.geometry.to_lps_mm(Eigen::Vector3d(1, 1, 0)), Eigen::Vector3d(0, 0.5, -0.5));
  EXPECT_EQ(slice.spacing_provenance[2], Provenance::assumed);
  for (const char* wrong :
       {"space directions: (1,0,0) (0,1,0) (0,0,0)\n", "space directions: (1,0,0) (0,1,0)\n",
        "space directions: (1,0) (0,1) (1,1)\n", "space directions: (1,0,0) (0,1,0) (0,0,nope)\n",
        "space directions: (1,0,0) (0,1,0) (0,0,inf)\n", "space directions: (1,0,0) (0,1,0) (0,0,1\n",
        "space directions: (1,0,0) (0,1,0) (0.9,0.1,0)\n"})
    EXPECT_EQ(error_code(with(box + "space: LPS\n" + wrong, "ab")), "bad-header") << wrong;
}

TEST_F(Nrrd, UnitsAreTurnedToMillimetres) {
  const std::string box = "dimension: 3\nsizes: 20 20 20\n";
  const std::string voxels(8000, 'v');
  for (const auto& [unit, mm] :
       {std::pair<std::string, double>("mm", 1.0), {"cm", 10.0}, {"m", 1000.0}, {"um", 1e-3}}) {
    const std::string all = "\"" + unit + "\" \"" + unit + "\" \"" + unit + "\"\n";
    auto info = read(with(box + "space units: " + all + "space origin: (1,1,1)\n" + lps, voxels)).info;
    EXPECT_NEAR(info.geometry.spacing_mm()[2], 3.0 * mm, 1e-12 * mm) << unit;
    EXPECT_NEAR(info.geometry.origin_mm()[2], mm, 1e-12 * mm) << unit;
    EXPECT_EQ(info.spacing_provenance[0], mm == 1.0 ? Provenance::stated : Provenance::derived) << unit;
    info = read(with(box + "units: " + all + "spacings: 1 2 3\n", voxels)).info;
    EXPECT_NEAR(info.geometry.spacing_mm()[1], 2.0 * mm, 1e-12 * mm) << unit;
    EXPECT_EQ(info.direction_provenance, Provenance::absent);
  }
  const auto odd =
      read(with(box + "units: \"parsec\" \"parsec\" \"parsec\"\nspacings: 1 2 3\n", voxels)).info;
  EXPECT_NE(warning_text(odd, "unknown-unit").find("parsec"), std::string::npos);
  // Borders of the axes: of the cells, or of the samples.
  auto info =
      read(with("dimension: 3\nsizes: 2 2 2\naxis mins: 0 0 0\naxis maxs: 4 4 4\ncenters: cell node cell\n",
                counted_bytes(8)))
          .info;
  EXPECT_EQ(info.geometry.spacing_mm(), Eigen::Vector3d(2, 4, 2));
  EXPECT_EQ(info.spacing_provenance[0], Provenance::derived);
  EXPECT_EQ(read(with(cube, counted_bytes(8))).info.spacing_provenance[0], Provenance::assumed);
  EXPECT_EQ(error_code(with(cube + "spacings: 1 0 1\n", counted_bytes(8))), "bad-header");
}

TEST_F(Nrrd, ListAxesAreFramesWhereverTheyStand) {
  const auto frames = [&](const std::string& axes) {
    const auto sequence =
        read(with("space: left-posterior-superior\nspace origin: (1,2,3)\n" + axes, counted_bytes(8)));
    EXPECT_EQ(sequence.frames.size(), 2U) << axes;
    EXPECT_EQ(sequence.info.geometry.dims(), (std::array<int, 3>{2, 2, 1})) << axes;
    EXPECT_EQ(sequence.info.geometry.spacing_mm(), Eigen::Vector3d(2, 2, 2)) << axes;
    ReadOptions second;
    second.frame = 1;
    EXPECT_EQ(voxels_of(read(file_, second)), voxels_of(sequence, 1)) << axes;
    return voxels_of(sequence, 1);
  };
  const std::vector<float> odd{1, 3, 5, 7};
  const std::vector<float> late{4, 5, 6, 7};
  const std::vector<float> middle{2, 3, 6, 7};
  EXPECT_EQ(frames("dimension: 4\nsizes: 2 2 2 1\nkinds: list domain domain domain\n"
                   "space directions: none (2,0,0) (0,2,0) (0,0,2)\n"),
            odd);
  EXPECT_EQ(frames("dimension: 4\nsizes: 2 2 1 2\nkinds: space space space list\n"
                   "space directions: (2,0,0) (0,2,0) (0,0,2) none\n"),
            late);
  EXPECT_EQ(frames("dimension: 4\nsizes: 2 2 2 1\nkinds: domain list domain domain\n"
                   "space directions: (2,0,0) none (0,2,0) (0,0,2)\n"),
            middle);
  EXPECT_EQ(frames("dimension: 4\nsizes: 2 2 2 1\nspace directions: none (2,0,0) (0,2,0) (0,0,2)\n"), odd);
  EXPECT_EQ(frames("dimension: 4\nsizes: 2 2 1 2\nkinds: domain domain domain time\n"
                   "space directions: (2,0,0) (0,2,0) (0,0,2) (nan,nan,nan)\n"),
            late);
  // Without directions, the axis whose spacing is no number is the list.
  const auto plain = read(with("dimension: 4\nsizes: 2 2 2 1\nspacings: nan 2 2 2\n", counted_bytes(8)));
  EXPECT_EQ(plain.frames.size(), 2U);
  EXPECT_EQ(voxels_of(plain, 1), odd);
  EXPECT_EQ(read(with("dimension: 4\nsizes: 2 2 1 2\n", counted_bytes(8))).frames.size(), 2U);
  EXPECT_EQ(
      error_code(with("dimension: 4\nsizes: 2 2 1 2\nkinds: list domain domain time\n", counted_bytes(8))),
      "unsupported");
}

TEST_F(Nrrd, TimesOfFrames) {
  const auto times = [&](const std::string& axes) {
    return read(with("dimension: 3\nsizes: 2 1 3\n" + axes, counted_bytes(6))).info.frame_times_s;
  };
  const std::vector<double> steps{0.0, 0.04, 0.08};
  EXPECT_EQ(times("kinds: domain domain time\nspacings: 1 1 0.04\n"), steps);
  EXPECT_EQ(times("kinds: domain domain time\nspacings: 1 1 40\nunits: \"mm\" \"mm\" \"ms\"\n"), steps);
  EXPECT_TRUE(times("kinds: domain domain list\nspacings: 1 1 nan\n").empty());
  EXPECT_TRUE(times("kinds: domain domain list\nspacings: 1 1 0.5\nunits: \"mm\" \"mm\" \"Hz\"\n").empty());
  EXPECT_EQ(times("kinds: domain domain list\nSeq_Frame0000_Timestamp:=7\nSeq_Frame0001_Timestamp:=7.5\n"
                  "Seq_Frame0002_Timestamp:=9\n"),
            (std::vector<double>{0.0, 0.5, 2.0}));
  EXPECT_EQ(times("kinds: domain domain list\nMultiVolume.FrameLabels:=10,50,90\n"
                  "MultiVolume.FrameIdentifyingDICOMTagUnits:=ms\n"),
            steps);
  // A space that has time itself.
  const auto sequence =
      read(with("dimension: 4\nsizes: 2 1 1 3\nspace: left-posterior-superior-time\n"
                "space directions: (1,0,0,0) (0,1,0,0) (0,0,1,0) (0,0,0,0.04)\n"
                "space origin: (1,2,3,0)\n",
                counted_bytes(6)));
  EXPECT_EQ(sequence.info.frame_times_s, steps);
  EXPECT_EQ(sequence.info.geometry.origin_mm(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(sequence.info.time_provenance, Provenance::stated);
}

TEST_F(Nrrd, ColourComplexAndVectors) {
  const std::string rgb("\xC8\x64\x32\x00\x00\xFF", 6);
  const float first = static_cast<float>(0.299 * 200 + 0.587 * 100 + 0.114 * 50);
  for (const char* kind : {"RGB-color", "3-color", "vector"}) {
    const auto colour =
        read(with("dimension: 3\nsizes: 3 2 1\nkinds: " + std::string(kind) + " domain domain\n", rgb));
    EXPECT_FLOAT_EQ(voxels_of(colour)[0], first) << kind;
    EXPECT_EQ(colour.info.components, 3);
    EXPECT_TRUE(warned(colour, "colour-to-grey"));
  }
  // The same colours as three planes.
  const std::string planes("\xC8\x00\x64\x00\x32\xFF", 6);
  EXPECT_FLOAT_EQ(
      voxels_of(read(with("dimension: 3\nsizes: 2 1 3\nkinds: domain domain RGB-color\n", planes)))[0],
      first);
  // Colour over time.
  const auto cine = read(with("dimension: 4\nsizes: 3 1 1 2\nkinds: RGB-color domain domain time\n", rgb));
  ASSERT_EQ(cine.frames.size(), 2U);
  EXPECT_FLOAT_EQ(voxels_of(cine, 1)[0], static_cast<float>(0.114 * 255));
  EXPECT_EQ(
      voxels_of(read(lines(
          "type: float\nencoding: raw\nendian: little\ndimension: 2\nsizes: 2 2\nkinds: complex domain\n",
          bytes_of(std::vector<float>{3, -4, 0, 2})))),
      (std::vector<float>{5, 2}));
  const std::string floats = bytes_of(std::vector<float>{1, 2, 3});
  for (const char* kind : {"vector", "3-vector", "HSV-color", "3D-symmetric-matrix", "quaternion"})
    EXPECT_EQ(
        error_code(lines("type: float\nencoding: raw\nendian: little\ndimension: 2\nsizes: 3 1\nkinds: " +
                             std::string(kind) + " domain\n",
                         floats)),
        "unsupported")
        << kind;
}

TEST_F(Nrrd, RefusesWhatDoesNotAddUp) {
  EXPECT_EQ(error_code(with("dimension: 3\nsizes: 4 4 4\n", "short")), "truncated");
  ReadOptions options;
  options.allow_truncated = true;
  EXPECT_TRUE(warned(read(file_, options), "truncated"));
  for (const char* wrong :
       {"dimension: 3\nsizes: 4 0 4\n", "dimension: 3\nsizes: 4 4\n", "dimension: 17\nsizes: 1\n",
        "dimension: x\nsizes: 1\n", "sizes: 1\n", "dimension: 1\n", "no field at all\n",
        "dimension: 1\nsizes: 1\nkinds: domain domain\n", "dimension: 1\nsizes: 1\nsizes: 2\n"})
    EXPECT_EQ(error_code(with(wrong, "abcd")), "bad-header") << wrong;
  write_bytes(file_, "NOPE0004\n");
  EXPECT_EQ(error_code(file_), "bad-header");
  EXPECT_EQ(error_code(with("dimension: 3\nsizes: 2147483647 2147483647 2147483647\n", "abc")), "truncated");
  EXPECT_EQ(error_code(file_, options), "too-large");
  EXPECT_EQ(error_code(with("dimension: 5\nsizes: 1 1 1 2 2\n", "abcd")), "unsupported");
}

}  // namespace
