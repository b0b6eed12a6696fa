// Pixels in every form that DICOM allows, from files that DCMTK wrote; the
// expected grey is worked out by hand.
#include "made_dicom.hpp"

#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

namespace {

using namespace palpate::testing;
using Floats = std::vector<float>;

class DicomPixels : public ::testing::Test {
 protected:
  std::filesystem::path file() const { return folder_ / "a.dcm"; }
  TemporaryFolder folder_;
};

/// Rec. 601: the definition of grey.
float luma_of(int red, int green, int blue) {
  return static_cast<float>((299 * red + 587 * green + 114 * blue) / 1000.0);
}

TEST_F(DicomPixels, KeepsStoredGrey) {
  for (const char* form : {"MONOCHROME2", "MONOCHROME1"}) {
    MadeDicom(3, 2, 8, 8, 1, form).pixels8({0, 1, 127, 128, 254, 255}).write(file());
    EXPECT_EQ(decode(file()).grey, (Floats{0, 1, 127, 128, 254, 255})) << form;
    EXPECT_EQ(decode(file()).form.pixel_type, "uint8");
  }
}

TEST_F(DicomPixels, MasksOverlaysAboveTheHighBit) {
  MadeDicom(2, 2, 16, 12).pixels16({0xF000, 0x1FFF, 0x8001, 0x0800}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{0, 4095, 1, 2048}));
}

TEST_F(DicomPixels, ShiftsWhereTheHighBitIsHigher) {
  MadeDicom(2, 1, 16, 12).number(DCM_HighBit, 15).pixels16({0xFFFF, 0x0018}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{4095, 1}));
}

TEST_F(DicomPixels, ExtendsTheSignOfStoredBits) {
  // -1, -2048, 2047 in 12 bits, with overlay bits above the first.
  MadeDicom(3, 1, 16, 12).number(DCM_PixelRepresentation, 1).pixels16({0x1FFF, 0x0800, 0x07FF}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{-1, -2048, 2047}));
  EXPECT_EQ(decode(file()).form.pixel_type, "int16");
}

TEST_F(DicomPixels, ReadsBigEndian) {
  MadeDicom(2, 1, 16, 16).pixels16({0x0102, 0xFFFE}).write(file(), EXS_BigEndianExplicit);
  EXPECT_EQ(decode(file()).grey, (Floats{258, 65534}));
  // 8-bit pixels in words: the pair of bytes is swapped in the file.
  MadeDicom(3, 1, 8, 8).pixels16({0x0201, 0x0003}).write(file(), EXS_BigEndianExplicit);
  EXPECT_EQ(decode(file()).grey, (Floats{1, 2, 3}));
}

TEST_F(DicomPixels, ReadsBigEndianOf32Bits) {
  // DCMTK swaps words of 16 bits; the halves are laid out so that 4 bytes, highest first, result.
  const std::vector<std::uint16_t> words{0x000C, 0x2178, 0x0013, 0x2170};
  MadeDicom(2, 1, 32, 32).pixels16(words).write(file(), EXS_BigEndianExplicit);
  EXPECT_EQ(decode(file()).grey, (Floats{795000, 1253744}));
  MadeDicom(2, 1, 32, 32).pixels8(little_endian<std::uint32_t>({795000, 1253744})).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{795000, 1253744}));
}

TEST_F(DicomPixels, ReadsFloats) {
  MadeDicom made(2, 1, 32, 32);
  const std::vector<Float32> floats{-1.5F, 3.25e7F};
  made.set().putAndInsertFloat32Array(DcmTag(0x7FE0, 0x0008, EVR_OF), floats.data(), 2);
  made.write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{-1.5F, 3.25e7F}));
  EXPECT_EQ(decode(file()).form.pixel_type, "float32");
  MadeDicom wide(2, 1, 64, 64);
  const std::vector<Float64> doubles{0.1, -2.0};
  wide.set().putAndInsertFloat64Array(DcmTag(0x7FE0, 0x0009, EVR_OD), doubles.data(), 2);
  wide.write(file(), EXS_BigEndianExplicit);
  EXPECT_EQ(decode(file()).grey, (Floats{0.1F, -2.0F}));
}

TEST_F(DicomPixels, ReadsBitsThatGoOnAcrossFrames) {
  // Two frames of 3 x 3 bits: 101 010 101 and 110 000 011, lowest bit first.
  MadeDicom(3, 3, 1, 1).text(DCM_NumberOfFrames, "2").pixels8({0x55, 0x07, 0x03}).write(file());
  EXPECT_EQ(decode(file(), 0).grey, (Floats{1, 0, 1, 0, 1, 0, 1, 0, 1}));
  EXPECT_EQ(decode(file(), 1).grey, (Floats{1, 1, 0, 0, 0, 0, 0, 1, 1}));
}

TEST_F(DicomPixels, TurnsRgbToLuma) {
  const Floats grey{luma_of(255, 0, 0), luma_of(10, 200, 30), 77.0F, 0.0F};
  MadeDicom(2, 2, 8, 8, 3, "RGB").pixels8({255, 0, 0, 10, 200, 30, 77, 77, 77, 0, 0, 0}).write(file());
  EXPECT_EQ(decode(file()).grey, grey);
  EXPECT_EQ(decode(file()).form.components, 3);
  MadeDicom(2, 2, 8, 8, 3, "RGB")
      .number(DCM_PlanarConfiguration, 1)
      .pixels8({255, 10, 77, 0, 0, 200, 77, 0, 0, 30, 77, 0})
      .write(file());
  EXPECT_EQ(decode(file()).grey, grey);
}

// Y 100, Cb 120, Cr 140 is R 100 + 1.402 * 12 = 117 (116.824), G 100 + 0.344136 * 8 - 0.714136 * 12 = 94
// (94.183), B 100 - 1.772 * 8 = 86 (85.824). Y 250, Cr 255 has more red than there is: R 255,
// G 250 - 0.714136 * 127 = 159 (159.305), B 250.
TEST_F(DicomPixels, TurnsYbrToLumaOfItsRgb) {
  const Floats grey{luma_of(117, 94, 86), luma_of(255, 159, 250), 33.0F, 201.0F};
  MadeDicom(2, 2, 8, 8, 3, "YBR_FULL")
      .pixels8({100, 120, 140, 250, 128, 255, 33, 128, 128, 201, 128, 128})
      .write(file());
  EXPECT_EQ(decode(file()).grey, grey);
}

TEST_F(DicomPixels, UnpacksHalvedColour) {
  // Y, Y, Cb, Cr: two pixels share a colour.
  MadeDicom(2, 2, 8, 8, 3, "YBR_FULL_422").pixels8({100, 33, 120, 140, 7, 201, 128, 128}).write(file());
  const Floats grey{luma_of(117, 94, 86), luma_of(50, 27, 19), 7.0F, 201.0F};
  EXPECT_EQ(decode(file()).grey, grey);
  // Unpacked by a program that left the name as it was.
  MadeDicom(2, 1, 8, 8, 3, "YBR_FULL_422").pixels8({100, 120, 140, 33, 120, 140}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{grey[0], grey[1]}));
}

TEST_F(DicomPixels, StretchesPartialRange) {
  // 16 is black and 235 white in this form; 128 is no colour.
  MadeDicom(2, 1, 8, 8, 3, "YBR_PARTIAL_422").pixels8({16, 235, 128, 128}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{0, 255}));
}

void put_palette(MadeDicom& made, const std::vector<std::uint16_t>& descriptor, const Bytes& red,
                 const Bytes& green, const Bytes& blue) {
  const std::vector<Bytes> channels{red, green, blue};
  for (std::uint16_t n = 0; n < 3; ++n) {
    made.numbers(DcmTag(0x0028, static_cast<std::uint16_t>(0x1101 + n), EVR_US), descriptor);
    std::vector<std::uint16_t> words((channels[n].size() + 1) / 2);
    std::memcpy(words.data(), channels[n].data(), channels[n].size());
    made.numbers(DcmTag(0x0028, static_cast<std::uint16_t>(0x1201 + n), EVR_OW), words);
  }
}

TEST_F(DicomPixels, LooksUpAPaletteOf8Bits) {
  MadeDicom made(4, 1, 8, 8, 1, "PALETTE COLOR");
  put_palette(made, {3, 5, 8}, {255, 9, 10}, {0, 9, 20}, {0, 9, 40});
  // 4 and 9 are outside of the palette: its first and last entries stand for them.
  made.pixels8({4, 5, 6, 9}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{luma_of(255, 0, 0), luma_of(255, 0, 0), 9, luma_of(10, 20, 40)}));
  EXPECT_EQ(decode(file()).form.components, 3);
}

TEST_F(DicomPixels, LooksUpAPaletteOf16Bits) {
  MadeDicom made(2, 1, 8, 8, 1, "PALETTE COLOR");
  // Bytes of the picture in the upper half of each entry.
  put_palette(made, {2, 0, 16}, little_endian<std::uint16_t>({0x1000, 0xFF00}),
              little_endian<std::uint16_t>({0x2000, 0xFF00}), little_endian<std::uint16_t>({0x3000, 0xFF00}));
  made.pixels8({0, 1}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{luma_of(16, 32, 48), 255}));
  // Full 16 bits: 65535 is 255.
  MadeDicom fine(2, 1, 8, 8, 1, "PALETTE COLOR");
  put_palette(fine, {2, 0, 16}, little_endian<std::uint16_t>({0x1010, 0xFFFF}),
              little_endian<std::uint16_t>({0x2020, 0xFFFF}), little_endian<std::uint16_t>({0x3030, 0xFFFF}));
  fine.pixels8({0, 1}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{luma_of(16, 32, 48), 255}));
}

TEST_F(DicomPixels, LooksUpByASignedFirstValue) {
  MadeDicom made(3, 1, 16, 16, 1, "PALETTE COLOR");
  made.number(DCM_PixelRepresentation, 1);
  const Bytes entries = little_endian<std::uint16_t>({1000, 2000, 3000});
  put_palette(made, {3, 0xFFFF, 16}, entries, entries, entries);  // -1 is the first
  made.pixels16({0xFFFF, 0, 1}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{1000, 2000, 3000}));
}

TEST_F(DicomPixels, ExpandsASegmentedPalette) {
  MadeDicom made(8, 1, 16, 16, 1, "PALETTE COLOR");
  // Two values, a line of four to 60, and the first two segments once more from there.
  const std::vector<std::uint16_t> segments{0, 2, 10, 20, 1, 4, 60, 2, 1, 0, 0};
  for (std::uint16_t n = 0; n < 3; ++n) {
    made.numbers(DcmTag(0x0028, static_cast<std::uint16_t>(0x1101 + n), EVR_US), {8, 0, 16});
    made.numbers(DcmTag(0x0028, static_cast<std::uint16_t>(0x1221 + n), EVR_OW), segments);
  }
  made.pixels16({0, 1, 2, 3, 4, 5, 6, 7}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{10, 20, 30, 40, 50, 60, 10, 20}));
}

TEST_F(DicomPixels, RefusesAPaletteThatIsMissing) {
  MadeDicom(1, 1, 8, 8, 1, "PALETTE COLOR").pixels8({0, 0}).write(file());
  EXPECT_EQ(refusal(file()), "bad-header");
}

TEST_F(DicomPixels, RescalesOnce) {
  MadeDicom(2, 1, 16, 16)
      .text(DCM_RescaleSlope, "0.5")
      .text(DCM_RescaleIntercept, "-1024")
      .text(DCM_DoseGridScaling, "0.001")  // is no rescale
      .pixels16({0, 2048})
      .write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{-1024, 0}));
}

TEST_F(DicomPixels, RescalesByTheFramesOwnGroups) {
  MadeDicom made(1, 1, 16, 16);
  made.text(DCM_NumberOfFrames, "3").pixels16({10, 10, 10});
  const auto add = [&](const DcmTag& groups, long item, const char* slope) {
    DcmItem* group = nullptr;
    made.set().findOrCreateSequenceItem(groups, group, item);
    DcmItem* transformation = nullptr;
    group->findOrCreateSequenceItem(DCM_PixelValueTransformationSequence, transformation);
    transformation->putAndInsertString(DCM_RescaleSlope, slope);
    transformation->putAndInsertString(DCM_RescaleIntercept, "1");
  };
  add(DCM_SharedFunctionalGroupsSequence, 0, "5");
  add(DCM_PerFrameFunctionalGroupsSequence, 0, "2");
  add(DCM_PerFrameFunctionalGroupsSequence, 1, "3");
  made.write(file());
  EXPECT_EQ(decode(file(), 0).grey, Floats{21});
  EXPECT_EQ(decode(file(), 1).grey, Floats{31});
  EXPECT_EQ(decode(file(), 2).grey, Floats{51});
}

TEST_F(DicomPixels, LooksUpAModalityTable) {
  MadeDicom made(4, 1, 8, 8);
  DcmItem* table = nullptr;
  made.set().findOrCreateSequenceItem(DCM_ModalityLUTSequence, table);
  const std::vector<Uint16> descriptor{3, 10, 16};
  const std::vector<Uint16> data{100, 5, 7};
  table->putAndInsertUint16Array(DcmTag(DCM_LUTDescriptor, EVR_US), descriptor.data(), 3);
  table->putAndInsertUint16Array(DcmTag(DCM_LUTData, EVR_OW), data.data(), 3);
  made.pixels8({0, 10, 11, 200}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{100, 100, 5, 7}));
}

TEST_F(DicomPixels, SaysWherePaddingIsLeft) {
  MadeDicom made(2, 1, 16, 16);
  made.number(DcmTag(DCM_PixelPaddingValue, EVR_US), 63536);
  made.pixels16({63536, 5}).write(file());
  EXPECT_EQ(decode(file()).grey, (Floats{63536, 5}));
  EXPECT_TRUE(decode(file()).warned("pixel-padding"));
  made.pixels16({1, 5}).write(file());
  EXPECT_FALSE(decode(file()).warned("pixel-padding"));
}

TEST_F(DicomPixels, RefusesWhatIsCutOff) {
  MadeDicom made(2, 2, 16, 16);
  made.text(DCM_NumberOfFrames, "2").pixels16({1, 2, 3, 4, 5, 6}).write(file());
  EXPECT_EQ(refusal(file()), "truncated");
  const auto decoded = decode(file(), 1, true);
  EXPECT_EQ(decoded.grey, (Floats{5, 6, 0, 0}));
  EXPECT_TRUE(decoded.warned("truncated"));
  MadeDicom(2, 2, 16, 16).pixels16({1, 2, 3, 4}).write(file());
  std::filesystem::resize_file(file(), std::filesystem::file_size(file()) - 3);
  EXPECT_EQ(refusal(file()), "truncated");
  EXPECT_EQ(decode(file(), 0, true).grey, (Floats{1, 2, 3, 0}));  // of the third pixel both bytes are there
}

TEST_F(DicomPixels, RefusesAbsurdSizesBeforeTakingMemory) {
  MadeDicom(65535, 65535, 16, 16).pixels16({1, 2, 3, 4}).write(file());
  EXPECT_EQ(refusal(file()), "truncated");
  std::string code;
  try {
    decode(file(), 0, true);
  } catch (const palpate::core::Error& error) {
    code = error.code();
  }
  EXPECT_EQ(code, "too-large");
}

TEST_F(DicomPixels, RefusesWhatIsNoPicture) {
  MadeDicom made(2, 1, 8, 8);
  made.write(file());
  EXPECT_EQ(refusal(file()), "no-image");
  made.text(DCM_NumberOfFrames, "1A").pixels8({1, 2}).write(file());
  EXPECT_EQ(refusal(file()), "bad-header");
}

TEST_F(DicomPixels, ReadsDeflatedFrames) {
  MadeDicom(2, 1, 8, 8)
      .text(DCM_NumberOfFrames, "3")
      .pixels8({1, 2, 3, 4, 5, 6})
      .write(file(), EXS_DeflatedLittleEndianExplicit);
  EXPECT_EQ(decode(file(), 0).grey, (Floats{1, 2}));
  EXPECT_EQ(decode(file(), 2).grey, (Floats{5, 6}));
}

TEST_F(DicomPixels, NamesTheCompressionThatItRefuses) {
  // DCMTK does not know this one: the UID of JPEG 2000 is overwritten, which is as long but for its last
  // letters.
  MadeDicom(2, 1, 8, 8)
      .fragments(EXS_MPEG4HighProfileLevel4_1, {{1, 2, 3, 4}})
      .write(file(), EXS_MPEG4HighProfileLevel4_1);
  std::string text;
  EXPECT_EQ(refusal(file(), &text), "unsupported");
  EXPECT_NE(text.find("MPEG-4"), std::string::npos) << text;
  std::fstream bytes(file(), std::ios::binary | std::ios::in | std::ios::out);
  std::string all((std::istreambuf_iterator<char>(bytes)), {});
  const auto at = all.find("1.2.840.10008.1.2.4.102");
  ASSERT_NE(at, std::string::npos);
  bytes.clear();
  bytes.seekp(static_cast<std::streamoff>(at));
  bytes << "1.2.840.10008.1.2.4.201";
  bytes.close();
  EXPECT_EQ(refusal(file(), &text), "unsupported");
  EXPECT_NE(text.find("High-Throughput JPEG 2000"), std::string::npos) << text;
}

}  // namespace
