// Headers: what stands in them comes out right, and what is damaged or made to
// do harm is refused or left out.
#include "made_dicom.hpp"

#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <fstream>

namespace {

using namespace palpate::testing;
using palpate::imaging::reading::DicomFile;
using palpate::imaging::reading::DicomItem;

class DicomHeaders : public ::testing::Test {
 protected:
  std::filesystem::path file() const { return folder_ / "a.dcm"; }
  std::string bytes_of(const std::filesystem::path& path) const {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  void write(const std::string& bytes) const { std::ofstream(file(), std::ios::binary) << bytes; }
  std::string code_of_opening() const {
    try {
      const DicomFile opened(file());
    } catch (const palpate::core::Error& error) {
      return error.code();
    }
    return {};
  }
  TemporaryFolder folder_;
};

std::string little(std::uint32_t value, int bytes) {
  std::string text;
  for (int n = 0; n < bytes; ++n) text.push_back(static_cast<char>(value >> (8 * n) & 0xFF));
  return text;
}

/// An explicit little-endian file without length of its meta group.
std::string head() {
  return std::string(128, '\0') + "DICM" + little(2, 2) + little(0x10, 2) + "UI" + little(20, 2) +
         std::string("1.2.840.10008.1.2.1\0", 20) + little(8, 2) + little(0x60, 2) + "CS" + little(2, 2) +
         "US";
}

/// `depth` sequences, each in an item of the one around it.
std::string nested(int depth) {
  std::string bytes = head();
  for (int n = 0; n < depth; ++n)
    bytes += little(8, 2) + little(0x1140, 2) + "SQ" + little(0, 2) + little(0xFFFFFFFF, 4) +
             little(0xFFFE, 2) + little(0xE000, 2) + little(0xFFFFFFFF, 4);
  for (int n = 0; n < depth; ++n)
    bytes += little(0xFFFE, 2) + little(0xE00D, 2) + little(0, 4) + little(0xFFFE, 2) + little(0xE0DD, 2) +
             little(0, 4);
  return bytes;
}

TEST_F(DicomHeaders, RefusesAbsurdNesting) {
  write(nested(20));
  EXPECT_EQ(code_of_opening(), "");
  for (const int depth : {1000, 100000}) {
    write(nested(depth));
    EXPECT_EQ(code_of_opening(), "too-large") << depth;
  }
}

TEST_F(DicomHeaders, RefusesAbsurdNestingInADeflatedFile) {
  MadeDicom made(1, 1, 8, 8);
  DcmItem* place = &made.set();
  for (int n = 0; n < 1000; ++n) {
    DcmItem* item = nullptr;
    ASSERT_TRUE(place->findOrCreateSequenceItem(DCM_ReferencedImageSequence, item).good());
    place = item;
  }
  made.write(file(), EXS_DeflatedLittleEndianExplicit);
  EXPECT_EQ(code_of_opening(), "too-large");
}

TEST_F(DicomHeaders, ReadsDataSetsWithoutMetaHeader) {
  for (const auto syntax : {EXS_LittleEndianExplicit, EXS_LittleEndianImplicit, EXS_BigEndianExplicit}) {
    DcmDataset set;
    set.putAndInsertString(DCM_Modality, "US");
    set.putAndInsertString(DCM_SOPClassUID, UID_UltrasoundImageStorage);
    set.putAndInsertUint16(DCM_Rows, 258);
    ASSERT_TRUE(set.saveFile(file().c_str(), syntax).good());
    const DicomFile opened(file());
    EXPECT_EQ(opened.dataset().text({0x0008, 0x0060}), "US");
    EXPECT_EQ(opened.dataset().number({0x0028, 0x0010}), 258.0);
    EXPECT_EQ(opened.transfer_syntax(), DcmXfer(syntax).getXferID());
    EXPECT_EQ(opened.big_endian(), syntax == EXS_BigEndianExplicit);
  }
}

TEST_F(DicomHeaders, ReadsBehindStrayBytesAndItems) {
  MadeDicom made(2, 1, 8, 8);
  made.pixels8({5, 6}).write(file());
  const std::string whole = bytes_of(file());
  write("x" + whole);
  EXPECT_EQ(decode(file()).grey, (std::vector<float>{5, 6}));
  // An item of two bytes whose sequence was taken away, before the rows (0028,0010).
  const auto at = whole.find(std::string("\x28\x00\x10\x00US", 6));
  ASSERT_NE(at, std::string::npos);
  const std::string item = little(0xFFFE, 2) + little(0xE000, 2) + little(12, 4) + little(0x18, 2) +
                           little(0x6024, 2) + "US" + little(2, 2) + little(3, 2) + "  ";
  write(whole.substr(0, at) + item + whole.substr(at));
  EXPECT_EQ(decode(file()).grey, (std::vector<float>{5, 6}));
  EXPECT_TRUE(decode(file()).warned("damaged-header"));
}

TEST_F(DicomHeaders, SaysWhatItDoesNotRead) {
  write("This is a letter to nobody, and it is long enough to be one.");
  EXPECT_EQ(code_of_opening(), "unsupported");
  write("");
  EXPECT_EQ(code_of_opening(), "unsupported");
  write(std::string(128, '\0') + "DICM");
  EXPECT_EQ(code_of_opening(), "unsupported");
  // Cut off within the value of an element.
  write(head() + little(0x10, 2) + little(0x10, 2) + "PN" + little(60, 2) + "Nob");
  EXPECT_EQ(code_of_opening(), "truncated");
}

TEST_F(DicomHeaders, ReadsWhatStandsBehindThePixels) {
  MadeDicom made(2, 1, 8, 8);
  made.pixels8({5, 6});
  made.set().putAndInsertString(DcmTag(0x7FE1, 0x0010, EVR_LO), "KRETZ_US");
  const Bytes value(10000, 7);
  made.set().putAndInsertUint8Array(DcmTag(0x7FE1, 0x1001, EVR_OB), value.data(), 10000);
  made.write(file());
  const DicomFile opened(file());
  const auto tag = opened.dataset().private_tag(0x7FE1, "KRETZ_US", 0x01);
  ASSERT_TRUE(tag.has_value());
  EXPECT_EQ(opened.dataset().bytes(*tag), value);
  EXPECT_EQ(opened.dataset().creators(), std::vector<std::string>{"KRETZ_US"});
  EXPECT_EQ(opened.pixels().value.present, 2U);
}

TEST_F(DicomHeaders, FindsPrivateBlocksByTheirCreator) {
  MadeDicom made(1, 1, 8, 8);
  DcmDataset& set = made.set();
  set.putAndInsertString(DcmTag(0x200D, 0x0010, EVR_LO), "Other");
  set.putAndInsertString(DcmTag(0x200D, 0x0011, EVR_LO), "Mine ");
  set.putAndInsertString(DcmTag(0x200D, 0x0012, EVR_LO), "Mine");
  set.putAndInsertFloat64(DcmTag(0x200D, 0x1003, EVR_FD), 1.0);
  set.putAndInsertFloat64(DcmTag(0x200D, 0x1203, EVR_FD), 2.5);
  for (const auto syntax : {EXS_LittleEndianExplicit, EXS_LittleEndianImplicit}) {
    made.write(file(), syntax);
    const DicomFile opened(file());
    const DicomItem data = opened.dataset();
    EXPECT_EQ(data.creators(), (std::vector<std::string>{"Other", "Mine"}));
    const auto tag = data.private_tag(0x200D, "Mine", 0x03);
    ASSERT_TRUE(tag.has_value());
    EXPECT_EQ(data.number(*tag), 2.5) << "of an unknown form the eight bytes are a real number";
    EXPECT_FALSE(data.private_tag(0x200D, "Nobody", 0x03).has_value());
  }
}

TEST_F(DicomHeaders, GivesTextAsUtf8) {
  MadeDicom made(1, 1, 8, 8);
  const auto name_of = [&](const std::string& set, const std::string& name) {
    made.text(DCM_SpecificCharacterSet, set).text(DCM_PatientName, name);
    made.write(file());
    return DicomFile(file()).dataset().text({0x0010, 0x0010});
  };
  EXPECT_EQ(name_of("ISO_IR 100", "M\xFCller"), "M\xC3\xBCller");
  EXPECT_EQ(name_of("ISO_IR 144", "\xBB\xEE"), "\xD0\x9B\xD1\x8E");
  EXPECT_EQ(name_of("ISO_IR 192", "M\xC3\xBCller"), "M\xC3\xBCller");
  EXPECT_EQ(name_of("NO SUCH SET", "M\xFCller"), "M\xC3\xBCller");
}

TEST_F(DicomHeaders, GivesNumbersOfEveryForm) {
  MadeDicom made(1, 1, 8, 8);
  DcmDataset& set = made.set();
  made.text(DCM_FrameTimeVector, " 0 \\33.3\\ 41 ");
  made.text(DCM_FrameTime, "fast");
  set.putAndInsertFloat64(DCM_PhysicalDeltaX, 0.0251);
  set.putAndInsertSint32(DCM_ReferencePixelX0, -7);
  set.putAndInsertUint32(DCM_RegionLocationMinX0, 4000000000U);
  set.putAndInsertFloat32(DCM_RecommendedDisplayFrameRateInFloat, 1.5F);
  for (const auto syntax : {EXS_LittleEndianExplicit, EXS_LittleEndianImplicit, EXS_BigEndianExplicit}) {
    made.write(file(), syntax);
    const DicomFile opened(file());
    const DicomItem data = opened.dataset();
    EXPECT_EQ(data.numbers({0x0018, 0x1065}), (std::vector<double>{0, 33.3, 41}));
    EXPECT_TRUE(data.has({0x0018, 0x1063}));
    EXPECT_TRUE(data.numbers({0x0018, 0x1063}).empty());
    EXPECT_EQ(data.number({0x0018, 0x602C}), 0.0251);
    EXPECT_EQ(data.number({0x0018, 0x6020}), -7.0);
    EXPECT_EQ(data.number({0x0018, 0x6018}), 4e9);
    EXPECT_EQ(data.number({0x0008, 0x9459}), 1.5);
    EXPECT_FALSE(data.number({0x0018, 0x9999}).has_value());
  }
}

}  // namespace
