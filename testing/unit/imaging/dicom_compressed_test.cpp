// Compressed pixels: streams that DCMTK's encoders or this test's own hand
// made, and real scans against other libraries.
#include "made_dicom.hpp"

#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmimage/diregist.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <dcmtk/dcmjpeg/djrploss.h>
#include <dcmtk/dcmjpls/djencode.h>
#include <fstream>
#include <memory>
#include <numeric>

namespace {

using namespace palpate::testing;
using palpate::imaging::reading::DicomFile;
using Floats = std::vector<float>;

class DicomCompressed : public ::testing::Test {
 protected:
  std::filesystem::path file() const { return folder_ / "a.dcm"; }
  /// The fragments of a file, as this program finds them.
  std::vector<Bytes> fragments_of(const std::filesystem::path& path) const {
    const DicomFile scan(path);
    std::vector<Bytes> all;
    for (const auto& piece : scan.pixels().fragments)
      all.push_back(scan.read(piece.offset, static_cast<std::size_t>(piece.length)));
    return all;
  }
  TemporaryFolder folder_;
};

/// Writes the picture and has DCMTK compress the file.
void write_compressed(MadeDicom& made, const std::filesystem::path& path, E_TransferSyntax syntax,
                      const DcmRepresentationParameter* how = nullptr) {
  made.write(path);
  DcmFileFormat loaded;
  ASSERT_TRUE(loaded.loadFile(path.c_str()).good());
  ASSERT_TRUE(loaded.loadAllDataIntoMemory().good());
  const OFCondition result = loaded.getDataset()->chooseRepresentation(syntax, how);
  ASSERT_TRUE(result.good()) << result.text();
  ASSERT_TRUE(loaded.saveFile(path.c_str(), syntax).good());
}

/// A frame of run-length code with every byte as it is (PS3.5, annex G).
Bytes literal_runs(const std::vector<Bytes>& segments) {
  std::vector<std::uint32_t> header(16, 0);
  header[0] = static_cast<std::uint32_t>(segments.size());
  Bytes body;
  for (std::size_t n = 0; n < segments.size(); ++n) {
    header[n + 1] = static_cast<std::uint32_t>(64 + body.size());
    body.push_back(static_cast<std::uint8_t>(segments[n].size() - 1));
    body.insert(body.end(), segments[n].begin(), segments[n].end());
    if (body.size() % 2 != 0) body.push_back(0x80);
  }
  Bytes frame = little_endian(header);
  frame.insert(frame.end(), body.begin(), body.end());
  return frame;
}

Bytes joined(const std::vector<Bytes>& pieces) {
  Bytes all;
  for (const auto& piece : pieces) all.insert(all.end(), piece.begin(), piece.end());
  return all;
}

TEST_F(DicomCompressed, UndoesRunLengths) {
  DcmRLEEncoderRegistration::registerCodecs();
  MadeDicom bytes(16, 1, 8, 8);
  bytes.pixels8({1, 1, 1, 1, 1, 2, 3, 4, 5, 5, 5, 5, 0, 0, 255, 255});
  write_compressed(bytes, file(), EXS_RLELossless);
  EXPECT_EQ(decode(file()).grey, (Floats{1, 1, 1, 1, 1, 2, 3, 4, 5, 5, 5, 5, 0, 0, 255, 255}));
  MadeDicom words(2, 2, 16, 16);
  words.number(DCM_PixelRepresentation, 1).pixels16({0xFFFF, 0x8000, 0x7FFF, 0x0102});
  write_compressed(words, file(), EXS_RLELossless);
  EXPECT_EQ(decode(file()).grey, (Floats{-1, -32768, 32767, 258}));
  MadeDicom colour(2, 1, 8, 8, 3, "RGB");
  colour.pixels8({200, 100, 50, 9, 9, 9});
  write_compressed(colour, file(), EXS_RLELossless);
  EXPECT_EQ(decode(file()).grey, (Floats{124.2F, 9}));  // 0.299 * 200 + 0.587 * 100 + 0.114 * 50
}

TEST_F(DicomCompressed, UndoesRunLengthsOf1And32Bits) {
  // What ends other programs: 3 x 3 bits packed, and as a byte each.
  MadeDicom(3, 3, 1, 1)
      .fragments(EXS_RLELossless, {literal_runs({{0x55, 0x01}})})
      .write(file(), EXS_RLELossless);
  EXPECT_EQ(decode(file()).grey, (Floats{1, 0, 1, 0, 1, 0, 1, 0, 1}));
  MadeDicom(3, 1, 1, 1)
      .fragments(EXS_RLELossless, {literal_runs({{1, 0, 1}})})
      .write(file(), EXS_RLELossless);
  EXPECT_EQ(decode(file()).grey, (Floats{1, 0, 1}));
  // 795000 is 0x000C2178, its highest byte in the first segment.
  MadeDicom(2, 1, 32, 32)
      .fragments(EXS_RLELossless, {literal_runs({{0, 0}, {0x0C, 0}, {0x21, 0}, {0x78, 7}})})
      .write(file(), EXS_RLELossless);
  EXPECT_EQ(decode(file()).grey, (Floats{795000, 7}));
}

TEST_F(DicomCompressed, FindsFramesWhateverTheOffsetTable) {
  const Bytes first = literal_runs({{1, 2, 3, 4}});
  const Bytes second = literal_runs({{5, 6, 7, 8}});
  const auto half = [](const Bytes& all, bool front) {
    const auto middle = all.begin() + 66;
    return front ? Bytes(all.begin(), middle) : Bytes(middle, all.end());
  };
  const std::vector<Bytes> pieces{half(first, true), half(first, false), half(second, true),
                                  half(second, false)};
  // The second frame begins behind 66 and the rest of the first, 8 bytes of item before each.
  const auto right = static_cast<std::uint32_t>(first.size() + 16);
  const std::vector<std::vector<std::uint32_t>> tables{{0, right}, {},     {0, 12345},
                                                       {7, 7},     {0, 0}, {0, right, 99}};
  for (std::size_t n = 0; n < tables.size(); ++n) {
    MadeDicom(4, 1, 8, 8)
        .text(DCM_NumberOfFrames, "2")
        .fragments(EXS_RLELossless, pieces, tables[n])
        .write(file(), EXS_RLELossless);
    EXPECT_EQ(decode(file(), 0).grey, (Floats{1, 2, 3, 4})) << "table " << n;
    EXPECT_EQ(decode(file(), 1).grey, (Floats{5, 6, 7, 8})) << "table " << n;
  }
  // One fragment a frame needs no table, and is not misled by one.
  MadeDicom(4, 1, 8, 8)
      .text(DCM_NumberOfFrames, "2")
      .fragments(EXS_RLELossless, {first, second}, {0, 2})
      .write(file(), EXS_RLELossless);
  EXPECT_EQ(decode(file(), 1).grey, (Floats{5, 6, 7, 8}));
}

TEST_F(DicomCompressed, RefusesMissingFramesAndBrokenOnes) {
  const Bytes first = literal_runs({{1, 2, 3, 4}});
  MadeDicom(4, 1, 8, 8)
      .text(DCM_NumberOfFrames, "3")
      .fragments(EXS_RLELossless, {first})
      .write(file(), EXS_RLELossless);
  EXPECT_EQ(refusal(file()), "truncated");
  EXPECT_EQ(decode(file(), 0, true).grey, (Floats{1, 2, 3, 4}));
  const auto missing = decode(file(), 2, true);
  EXPECT_EQ(missing.grey, (Floats{0, 0, 0, 0}));
  EXPECT_TRUE(missing.warned("truncated"));
  // Run lengths that end before the frame does.
  MadeDicom(8, 1, 8, 8).fragments(EXS_RLELossless, {first}).write(file(), EXS_RLELossless);
  EXPECT_EQ(refusal(file()), "truncated");
  EXPECT_EQ(decode(file(), 0, true).grey, (Floats{1, 2, 3, 4, 0, 0, 0, 0}));
  // The file ends within a fragment.
  MadeDicom(4, 1, 8, 8).fragments(EXS_RLELossless, {first}).write(file(), EXS_RLELossless);
  std::filesystem::resize_file(file(), std::filesystem::file_size(file()) - 8 - 3);
  EXPECT_EQ(refusal(file()), "truncated");
  // Only the mark behind the last fragment is missing: nothing is lost.
  MadeDicom(4, 1, 8, 8).fragments(EXS_RLELossless, {first}).write(file(), EXS_RLELossless);
  std::filesystem::resize_file(file(), std::filesystem::file_size(file()) - 8);
  EXPECT_EQ(decode(file()).grey, (Floats{1, 2, 3, 4}));
  EXPECT_TRUE(decode(file()).warned("missing-end"));
}

std::vector<std::uint16_t> ramp(std::size_t count, int most) {
  std::vector<std::uint16_t> values(count);
  for (std::size_t n = 0; n < count; ++n)
    values[n] = static_cast<std::uint16_t>((n * n * 37 + n * 11) % static_cast<std::size_t>(most + 1));
  return values;
}

TEST_F(DicomCompressed, DecodesLosslessJpegExactly) {
  DJEncoderRegistration::registerCodecs();
  DJLSEncoderRegistration::registerCodecs();
  const DJ_RPLossless jpeg;
  for (const auto syntax : {EXS_JPEGProcess14SV1, EXS_JPEGProcess14, EXS_JPEGLSLossless}) {
    const DcmRepresentationParameter* how = syntax == EXS_JPEGLSLossless ? nullptr : &jpeg;
    for (const int bits : {8, 12, 16}) {
      const auto values = ramp(64, (1 << bits) - 1);
      MadeDicom made(8, 8, bits == 8 ? 8 : 16, bits);
      if (bits == 8)
        made.pixels8(Bytes(values.begin(), values.end()));
      else
        made.pixels16(values);
      write_compressed(made, file(), syntax, how);
      EXPECT_EQ(decode(file()).grey, Floats(values.begin(), values.end()))
          << DcmXfer(syntax).getXferName() << ", " << bits << " bits";
    }
  }
}

TEST_F(DicomCompressed, DecodesLosslessColourAndSigns) {
  DJEncoderRegistration::registerCodecs();
  DJLSEncoderRegistration::registerCodecs();
  MadeDicom colour(2, 1, 8, 8, 3, "RGB");
  colour.pixels8({200, 100, 50, 9, 9, 9});
  write_compressed(colour, file(), EXS_JPEGLSLossless);
  EXPECT_EQ(decode(file()).grey, (Floats{124.2F, 9}));
  MadeDicom negative(2, 2, 16, 16);
  negative.number(DCM_PixelRepresentation, 1).pixels16({0xFFFF, 0x8000, 0x7FFF, 0x0102});
  const DJ_RPLossless jpeg;
  write_compressed(negative, file(), EXS_JPEGProcess14SV1, &jpeg);
  EXPECT_EQ(decode(file()).grey, (Floats{-1, -32768, 32767, 258}));
}

/// A picture of smooth colours and its luma.
struct Smooth {
  Bytes rgb;
  Floats luma;
};
Smooth smooth(int size) {
  Smooth picture;
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      const int red = 60 + 4 * x;
      const int green = 200 - 3 * y;
      const int blue = 40 + x + y;
      for (const int value : {red, green, blue}) picture.rgb.push_back(static_cast<std::uint8_t>(value));
      picture.luma.push_back(static_cast<float>((299 * red + 587 * green + 114 * blue) / 1000.0));
    }
  return picture;
}

float largest_difference(const Floats& a, const Floats& b) {
  float largest = a.size() == b.size() ? 0.0F : 1e9F;
  for (std::size_t n = 0; n < std::min(a.size(), b.size()); ++n)
    largest = std::max(largest, std::abs(a[n] - b[n]));
  return largest;
}

// Quality 100: what is left is rounding to whole numbers, of colour twice and
// of the cosine transform. Taking YCbCr for RGB would be off by up to 60.
constexpr float rounding = 3.0F;

TEST_F(DicomCompressed, TakesTheColourThatAJpegStreamSays) {
  const Smooth picture = smooth(32);
  const DJ_RPLossy best(100);
  for (const bool as_ybr : {true, false}) {
    DJEncoderRegistration::cleanup();
    DJEncoderRegistration::registerCodecs(as_ybr ? ECC_lossyYCbCr : ECC_lossyRGB, EUC_never);
    MadeDicom made(32, 32, 8, 8, 3, "RGB");
    made.pixels8(picture.rgb);
    write_compressed(made, file(), EXS_JPEGProcess1, &best);
    const auto right = decode(file());
    EXPECT_LT(largest_difference(right.grey, picture.luma), rounding) << as_ybr;
    EXPECT_FALSE(right.warned("colour-space"));
    // The same stream under the other name: the stream is believed.
    const auto stream = fragments_of(file());
    MadeDicom(32, 32, 8, 8, 3, as_ybr ? "RGB" : "YBR_FULL_422")
        .fragments(EXS_JPEGProcess1, stream)
        .write(file(), EXS_JPEGProcess1);
    const auto other = decode(file());
    EXPECT_EQ(other.grey, right.grey) << as_ybr;
    EXPECT_TRUE(other.warned("colour-space"));
  }
}

TEST_F(DicomCompressed, DecodesJpegInSeveralFragmentsAndCutOff) {
  DJEncoderRegistration::cleanup();
  DJEncoderRegistration::registerCodecs(ECC_lossyYCbCr, EUC_never);
  const Smooth picture = smooth(32);
  const DJ_RPLossy best(100);
  MadeDicom made(32, 32, 8, 8, 3, "RGB");
  made.pixels8(picture.rgb);
  write_compressed(made, file(), EXS_JPEGProcess1, &best);
  const auto whole = decode(file()).grey;
  const Bytes stream = joined(fragments_of(file()));
  const auto cut = stream.begin() + static_cast<std::ptrdiff_t>(stream.size() / 4 * 2);
  MadeDicom(32, 32, 8, 8, 3, "YBR_FULL_422")
      .fragments(EXS_JPEGProcess1, {Bytes(stream.begin(), cut), Bytes(cut, stream.end())})
      .write(file(), EXS_JPEGProcess1);
  EXPECT_EQ(decode(file()).grey, whole);
  MadeDicom(32, 32, 8, 8, 3, "YBR_FULL_422")
      .fragments(EXS_JPEGProcess1, {Bytes(stream.begin(), stream.end() - 40)})
      .write(file(), EXS_JPEGProcess1);
  EXPECT_EQ(refusal(file()), "truncated");
  const auto part = decode(file(), 0, true);
  EXPECT_TRUE(std::equal(part.grey.begin(), part.grey.begin() + 32, whole.begin()));
  EXPECT_EQ(part.grey.back(), 0.0F);
}

TEST_F(DicomCompressed, PutsSmallerFramesToTheUpperLeft) {
  DJEncoderRegistration::registerCodecs();
  const DJ_RPLossless jpeg;
  MadeDicom made(2, 2, 8, 8);
  made.pixels8({1, 2, 3, 4});
  write_compressed(made, file(), EXS_JPEGProcess14SV1, &jpeg);
  const auto stream = fragments_of(file());
  MadeDicom(3, 3, 8, 8).fragments(EXS_JPEGProcess14SV1, stream).write(file(), EXS_JPEGProcess14SV1);
  EXPECT_EQ(decode(file()).grey, (Floats{1, 2, 0, 3, 4, 0, 0, 0, 0}));
  EXPECT_TRUE(decode(file()).warned("smaller-frames"));
  MadeDicom(1, 2, 8, 8).fragments(EXS_JPEGProcess14SV1, stream).write(file(), EXS_JPEGProcess14SV1);
  EXPECT_EQ(refusal(file()), "unsupported");
}

/// A real scan, with what another library makes of it.
struct Known {
  const char* name;
  int frames;
  double min, max, mean;
};

class RealPixels : public ::testing::TestWithParam<Known> {};

// Means of colour are 0.299 R + 0.587 G + 0.114 B of the channel means that ITK
// 5.2 with GDCM 3.0.21 gives, ends of grey are its ends; those of JPEG-LS and of the
// mosaic are from DCMTK's dcmdjpls and dcmdjpeg +ca. `min` or `max` -1: not known.
TEST_P(RealPixels, AgreeWithOtherLibraries) {
  const Known known = GetParam();
  PALPATE_TEST_SCAN(path, known.name);
  double sum = 0.0;
  double min = 1e300;
  double max = -1e300;
  std::size_t count = 0;
  for (int frame = 0; frame < known.frames; ++frame)
    for (const float value : decode(path, frame).grey) {
      sum += static_cast<double>(value);
      min = std::min(min, static_cast<double>(value));
      max = std::max(max, static_cast<double>(value));
      ++count;
    }
  // The means above have five or six digits.
  EXPECT_NEAR(sum / static_cast<double>(count), known.mean,
              2e-5 * std::max(1.0, std::abs(known.mean)) + 1e-3);
  if (known.min != -1.0) {
    EXPECT_EQ(min, known.min);
  }
  if (known.max != -1.0) {
    EXPECT_EQ(max, known.max);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scans, RealPixels,
    ::testing::Values(Known{"pydicom/examples_ybr_color.dcm", 30, 0, -1, 10.47788},
                      Known{"pydicom/examples_palette.dcm", 1, 0, 255, 19.47009},
                      Known{"pydicom/examples_rgb_color.dcm", 1, 0, 255, 35.33139},
                      Known{"pydicom/examples_jpeg2k.dcm", 1, 0, 255, 35.59718},
                      Known{"pydicom/ExplVR_BigEnd.dcm", 1, -1, 255, 222.43607},
                      Known{"pydicom-data/JPGLosslessP14SV1_1s_1f_8b.dcm", 1, 0, 255, 17.2578},
                      Known{"pydicom-data/OBXXXX1A_rle_2frame.dcm", 2, 0, 255, 25.91182},
                      Known{"pydicom-data/color-pl.dcm", 1, 16, -1, 40.35563},
                      Known{"pydicom-data/US1_UNCI.dcm", 1, 0, 255, 35.72019},
                      Known{"pydicom-data/emri_small.dcm", 10, 0, 467, 109.699},
                      Known{"pydicom-data/emri_small_jpeg_2k_lossless.dcm", 10, 0, 467, 109.699},
                      Known{"pydicom-data/eCT_Supplemental.dcm", 2, -1024, 172, -643.962},
                      Known{"pydicom/rtdose.dcm", 15, 795000, 1254000, 1013270},
                      Known{"pydicom/rtdose_expb.dcm", 15, 795000, 1254000, 1013270},
                      Known{"pydicom/image_dfl.dcm", 1, 0, 255, 127.116},
                      Known{"pydicom/JPEGLSNearLossless_16.dcm", 1, 0, 65535, 12014.5},
                      Known{"orthanc/Issue94.dcm", 1, 0, -1, 329.578},
                      Known{"fodicom/CT-MONO2-16-ankle", 1, -992, 3056, -305.605},
                      // ITK turns MONOCHROME1 round: 1023 less its 521.143.
                      Known{"fodicom/CR-MONO1-10-chest", 1, 0, 979, 501.857}));

TEST(RealPixels, TwinsInTwoSyntaxesAreTheSame) {
  PALPATE_TEST_SCAN(native, "pydicom-data/emri_small.dcm");
  PALPATE_TEST_SCAN(wavelets, "pydicom-data/emri_small_jpeg_2k_lossless.dcm");
  for (int frame = 0; frame < 10; ++frame)
    EXPECT_EQ(decode(native, frame).grey, decode(wavelets, frame).grey) << frame;
}

}  // namespace
