// Damaged copies of small scans, given to the reader process: each ends with a
// volume or with a refusal by its code, and this program goes on.
#include "reader_files.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <iostream>
#include <map>
#include <random>
#include <set>
#include <sstream>
#include <zlib.h>

namespace {

using namespace palpate::testing;

struct Seed {
  std::string ending;
  std::string bytes;
  bool ours;  ///< parsed by this program alone
};

std::string packed(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string out(size, '\0');
  EXPECT_EQ(compress(reinterpret_cast<Bytef*>(out.data()), &size,
                     reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size())),
            Z_OK);
  out.resize(size);
  return out;
}

std::string file_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  return bytes.str();
}

std::vector<Seed> written_seeds(const TemporaryFolder& folder) {
  std::string voxels;
  for (int n = 0; n < 512; ++n) voxels.push_back(static_cast<char>(n * 37 % 251));
  const std::string geometry =
      "TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 0.5 0.5 0.7\n";
  std::vector<Seed> seeds;
  const auto keep = [&](const char* name, const std::string& ending, bool ours) {
    seeds.push_back({ending, file_bytes(folder / name), ours});
  };
  write_mha(folder / "a", "8 8 8", "MET_UCHAR", voxels,
            geometry + "AnatomicalOrientation = RAI\nDistanceUnits = mm\n");
  keep("a", ".mha", true);
  const std::string zipped = packed(voxels);
  write_mha(folder / "a", "4 4 4 4", "MET_SHORT", zipped,
            "CompressedData = True\nCompressedDataSize = " + std::to_string(zipped.size()) +
                "\nElementSpacing = 0.5 0.5 0.7 0.04\n");
  keep("a", ".mha", true);
  write_mha(folder / "a", "8 8 8", "MET_UCHAR", voxels,
            "Kinds = domain domain list\nSeq_Frame0000_Timestamp = 1.5\nSeq_Frame0001_Timestamp = 1.75\n");
  keep("a", ".mha", true);
  seeds.push_back(
      {".nrrd",
       "NRRD0005\ntype: uint16\ndimension: 4\nspace: right-anterior-superior\nsizes: 2 8 4 4\nkinds: list "
       "domain domain domain\nspace directions: none (0.5,0,0) (0,0.5,0) (0,0,0.7)\nspace origin: "
       "(1,2,3)\nspace units: \"mm\" \"mm\" \"mm\"\nendian: big\nencoding: raw\nbyte skip: 0\n\n" +
           voxels,
       true});
  std::string text;
  for (const char voxel : voxels) text += std::to_string(static_cast<unsigned char>(voxel)) + " ";
  seeds.push_back(
      {".nrrd",
       "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 8 8 8\nspacings: 1 2 3\nencoding: text\n\n" + text,
       true});
  NiftiBytes nifti({4, 4, 4, 4}, 4, 16);
  nifti.put<std::int16_t>(252, 1).put<float>(264, 0.70710678F).put<float>(92, 40.0F);
  seeds.push_back({".nii", nifti.bytes() + voxels, true});
  SmallImage image;
  image.write(folder / "a");
  keep("a", ".dcm", false);
  image.sop = "1.2.840.10008.5.1.4.1.1.3.1";
  image.frames = "2";
  image.frame_time = "40";
  image.regions = SmallImage::region(0.05);
  image.pixels += std::string(8, '\x9');
  image.write(folder / "a");
  keep("a", ".dcm", false);
  return seeds;
}

/// Small files of the test data, as far as it is there.
void add_real_seeds(std::vector<Seed>& seeds) {
  for (const char* name :
       {"nibabel/anatomical.nii", "pluslib/NwirePhantomFreehandReconstructed.mha",
        "pluslib/NrrdSample.igs.nrrd", "pluslib/NwirePhantomFreehandCropped.igs.mha",
        "constructed/m27_binarydata_false_ascii.mha", "pydicom/MR_small_padded.dcm",
        "pydicom/ExplVR_BigEnd.dcm", "pydicom/rtdose.dcm", "pydicom/JPEGLSNearLossless_16.dcm",
        "pydicom/SC_rgb_small_odd.dcm", "pydicom/image_dfl.dcm", "pydicom-data/liver_rle.dcm",
        "pydicom-data/emri_small_jpeg_2k_lossless.dcm", "pydicom-data/OBXXXX1A_rle_2frame.dcm",
        "series/noniso_mr/001.dcm"}) {
    const auto path = test_scan(name);
    if (!path) continue;
    const std::string ending = path->extension().string();
    seeds.push_back({ending, file_bytes(*path), ending != ".dcm"});
  }
}

/// The standard's distributions differ between libraries; the engine does not.
class Damage {
 public:
  explicit Damage(std::uint32_t seed) : random_(seed) {}

  std::string of(const std::string& whole) {
    std::string bytes = whole;
    switch (below(6)) {
      case 0:
        for (std::size_t n = 1 + below(16); n > 0; --n) flip(bytes);
        break;
      case 1:
        bytes.resize(below(bytes.size()));
        break;
      case 2:
        grow(bytes);
        break;
      case 3:
        swap_blocks(bytes);
        break;
      case 4:
        replace_text_number(bytes);
        break;
      default:
        replace_binary_number(bytes);
        break;
    }
    return bytes;
  }

 private:
  std::size_t below(std::size_t end) { return end == 0 ? 0 : random_() % end; }
  /// Headers are at the start, and are what there is to confuse.
  std::size_t place(const std::string& bytes) {
    return below(2) == 0 ? below(std::min<std::size_t>(bytes.size(), 1200)) : below(bytes.size());
  }
  void flip(std::string& bytes) {
    if (bytes.empty()) return;
    char& byte = bytes[place(bytes)];
    byte = static_cast<char>(byte ^ (1 << below(8)));
  }
  void grow(std::string& bytes) {
    std::string more(1 + below(300), '\0');
    for (char& byte : more) byte = static_cast<char>(random_());
    bytes.insert(place(bytes), more);
  }
  void swap_blocks(std::string& bytes) {
    const std::size_t length = 1 + below(64);
    if (bytes.size() < 2 * length) return;
    const std::size_t a = below(bytes.size() - length);
    const std::size_t b = below(bytes.size() - length);
    for (std::size_t n = 0; n < length; ++n) std::swap(bytes[a + n], bytes[b + n]);
  }
  void replace_text_number(std::string& bytes) {
    static const std::array<const char*, 12> extremes{
        "-1",    "0",      "1e308", "nan", "-inf", "2147483647", "-2147483648", "99999999999999999999",
        "65536", "1e-320", "",      "%d"};
    const std::size_t at = bytes.find_first_of("0123456789", place(bytes));
    if (at == std::string::npos) return;
    const std::size_t end = std::min(bytes.size(), bytes.find_first_not_of("0123456789.", at));
    bytes.replace(at, end - at, extremes[below(extremes.size())]);
  }
  void replace_binary_number(std::string& bytes) {
    static const std::array<std::uint32_t, 8> extremes{0U,          0xFFFFFFFFU, 0x7FFFFFFFU, 0x80000000U,
                                                       0x7F800000U, 0x7FC00000U, 0x0000FFFFU, 0x00010000U};
    if (bytes.size() < 4) return;
    const std::uint32_t extreme = extremes[below(extremes.size())];
    const std::size_t at = std::min(place(bytes) & ~std::size_t{1}, bytes.size() - 4);
    std::memcpy(bytes.data() + at, &extreme, 2 + 2 * below(2));
  }

  std::mt19937 random_;
};

TEST(DamagedScans, EndWithAVolumeOrARefusal) {
  const TemporaryFolder folder;
  auto seeds = written_seeds(folder);
  add_real_seeds(seeds);
  const std::set<std::string> known{"not-found",      "unsupported",    "truncated",      "bad-header",
                                    "too-large",      "no-image",       "several-series", "no-volume",
                                    "reader-crashed", "reader-timeout", "reader-memory"};
  Damage damage(20260301);
  std::map<std::string, int> tally;
  palpate::imaging::ReaderLimits limits;
  limits.memory_bytes = std::size_t{1} << 30;
  limits.time_s = 60.0;
  const int trials = repetitions(120, 2000);
  for (int trial = 0; trial < trials; ++trial) {
    const Seed& seed = seeds[static_cast<std::size_t>(trial) % seeds.size()];
    const auto path = folder / ("damaged" + seed.ending);
    write_bytes(path, damage.of(seed.bytes));
    palpate::imaging::ReadOptions options;
    options.allow_truncated = trial % 3 == 0;
    std::string outcome = "volume";
    try {
      const auto sequence = palpate::imaging::read(path, options, {}, limits);
      ASSERT_FALSE(sequence.frames.empty());
      EXPECT_TRUE(std::isfinite(sequence.info.min) && std::isfinite(sequence.info.max));
      EXPECT_TRUE(sequence.info.geometry.ijk_to_lps_mm().allFinite());
    } catch (const palpate::core::Error& error) {
      EXPECT_EQ(error.kind(), palpate::core::ErrorKind::input) << trial << ": " << error.what();
      EXPECT_EQ(known.count(error.code()), 1U) << trial << ": " << error.code();
      outcome = error.code();
      // Our own parsers neither end the process nor keep it busy.
      EXPECT_FALSE(seed.ours && (outcome == "reader-crashed" || outcome == "reader-timeout"))
          << trial << ": " << error.what() << " " << error.details();
    }
    ++tally[outcome];
    ++tally[(seed.ours ? "ours: " : "DICOM: ") + outcome];
  }
  for (const auto& [outcome, count] : tally) {
    std::cout << outcome << " " << count << "\n";
    ::testing::Test::RecordProperty(outcome, count);
  }
  EXPECT_GT(tally["volume"], 0);
}

}  // namespace
