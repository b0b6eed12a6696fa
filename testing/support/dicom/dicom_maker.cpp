#include "palpate/testing/dicom_maker.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <stdexcept>

namespace palpate::testing {
namespace {

void check(const OFCondition& condition, const char* what) {
  if (condition.bad()) throw std::runtime_error(std::string(what) + ": " + condition.text());
}

DcmTag key(Tag tag) { return DcmTag(tag.group, tag.element); }

/// The tag within a private block, which is reserved where it is not yet.
Tag reserve(DcmItem& item, std::uint16_t group, std::uint8_t block, const std::string& creator,
            std::uint8_t low) {
  const DcmTag owner(group, block, DcmVR(EVR_LO));
  check(item.putAndInsertString(owner, creator.c_str()), "creator");
  return {group, static_cast<std::uint16_t>(block * 0x100U + low)};
}

DcmTag typed(Tag tag, DcmEVR type) { return DcmTag(tag.group, tag.element, DcmVR(type)); }

void append(DcmItem& item, const DcmTag& tag, const std::string& value) {
  auto element = std::make_unique<DcmOtherByteOtherWord>(tag);
  check(element->putUint8Array(reinterpret_cast<const Uint8*>(value.data()), value.size()), "bytes");
  check(item.insert(element.release(), OFTrue), "insert");
}

DcmItem& append_item(DcmItem& item, const DcmTag& tag) {
  DcmItem* added = nullptr;
  check(item.findOrCreateSequenceItem(tag, added, -2), "item");
  return *added;
}

}  // namespace

DicomNode& DicomNode::text(Tag tag, const std::string& value) {
  check(item_->putAndInsertString(key(tag), value.c_str()), "text");
  return *this;
}

DicomNode& DicomNode::us(Tag tag, const std::vector<std::uint16_t>& values) {
  check(item_->putAndInsertUint16Array(DcmTag(tag.group, tag.element, DcmVR(EVR_US)), values.data(),
                                       values.size()),
        "us");
  return *this;
}

DicomNode& DicomNode::ul(Tag tag, const std::vector<std::uint32_t>& values) {
  auto element = std::make_unique<DcmUnsignedLong>(key(tag));
  check(element->putUint32Array(values.data(), values.size()), "ul");
  check(item_->insert(element.release(), OFTrue), "insert");
  return *this;
}

DicomNode& DicomNode::fd(Tag tag, const std::vector<double>& values) {
  check(item_->putAndInsertFloat64Array(key(tag), values.data(), values.size()), "fd");
  return *this;
}

DicomNode& DicomNode::attribute(Tag tag, Tag value) {
  check(item_->putAndInsertTagKey(key(tag), DcmTagKey(value.group, value.element)), "attribute");
  return *this;
}

DicomNode& DicomNode::bytes(Tag tag, const std::string& value) {
  append(*item_, typed(tag, EVR_OB), value);
  return *this;
}

DicomNode DicomNode::item(Tag sequence) { return DicomNode(append_item(*item_, key(sequence))); }

DicomNode& DicomNode::private_text(std::uint16_t group, std::uint8_t block, const std::string& creator,
                                   std::uint8_t low, const std::string& value) {
  const Tag tag = reserve(*item_, group, block, creator, low);
  check(item_->putAndInsertString(typed(tag, EVR_LO), value.c_str()), "private text");
  return *this;
}

DicomNode& DicomNode::private_fd(std::uint16_t group, std::uint8_t block, const std::string& creator,
                                 std::uint8_t low, double value) {
  const Tag tag = reserve(*item_, group, block, creator, low);
  check(item_->putAndInsertFloat64(typed(tag, EVR_FD), value), "private fd");
  return *this;
}

DicomNode& DicomNode::private_ul(std::uint16_t group, std::uint8_t block, const std::string& creator,
                                 std::uint8_t low, std::uint32_t value) {
  const Tag tag = reserve(*item_, group, block, creator, low);
  check(item_->putAndInsertUint32(typed(tag, EVR_UL), value), "private ul");
  return *this;
}

DicomNode& DicomNode::private_bytes(std::uint16_t group, std::uint8_t block, const std::string& creator,
                                    std::uint8_t low, const std::string& value) {
  append(*item_, typed(reserve(*item_, group, block, creator, low), EVR_OB), value);
  return *this;
}

DicomNode DicomNode::private_item(std::uint16_t group, std::uint8_t block, const std::string& creator,
                                  std::uint8_t low) {
  const Tag tag = reserve(*item_, group, block, creator, low);
  return DicomNode(append_item(*item_, typed(tag, EVR_SQ)));
}

DicomMaker::DicomMaker(const std::string& sop_class, const std::string& modality, const std::string& series,
                       const std::string& uid)
    : file_(std::make_unique<DcmFileFormat>()) {
  const std::string root = "1.2.826.0.1.3680043.8.498.77.";
  top()
      .text({0x0008, 0x0016}, sop_class)
      .text({0x0008, 0x0018}, root + "3." + series + "." + uid)
      .text({0x0008, 0x0060}, modality)
      .text({0x0020, 0x000D}, root + "1")
      .text({0x0020, 0x000E}, root + "2." + series);
}

DicomMaker::~DicomMaker() = default;

DicomNode DicomMaker::top() { return DicomNode(*file_->getDataset()); }

void DicomMaker::raw_pixels(const std::string& bytes) {
  append(*file_->getDataset(), DcmTag(0x7FE0, 0x0010, DcmVR(EVR_OB)), bytes);
}

void DicomMaker::pixels(int columns, int rows, int frames, int bits, const PixelValue& value) {
  const auto stored = static_cast<std::uint16_t>(bits);
  top()
      .us({0x0028, 0x0002}, {1})
      .text({0x0028, 0x0004}, "MONOCHROME2")
      .us({0x0028, 0x0010}, {static_cast<std::uint16_t>(rows)})
      .us({0x0028, 0x0011}, {static_cast<std::uint16_t>(columns)})
      .us({0x0028, 0x0100}, {stored})
      .us({0x0028, 0x0101}, {stored})
      .us({0x0028, 0x0102}, {static_cast<std::uint16_t>(bits - 1)})
      .us({0x0028, 0x0103}, {0});
  if (frames > 0) top().text({0x0028, 0x0008}, std::to_string(frames));
  std::vector<std::uint16_t> words;
  for (int frame = 0; frame < std::max(1, frames); ++frame)
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) words.push_back(static_cast<std::uint16_t>(value(i, j, frame)));
  if (bits == 8) {
    raw_pixels(std::string(words.begin(), words.end()));
    return;
  }
  check(file_->getDataset()->putAndInsertUint16Array(DcmTag(0x7FE0, 0x0010, DcmVR(EVR_OW)), words.data(),
                                                     words.size()),
        "pixels");
}

void DicomMaker::save(const std::filesystem::path& path, bool implicit) {
  const auto syntax = implicit ? EXS_LittleEndianImplicit : EXS_LittleEndianExplicit;
  check(file_->saveFile(path.c_str(), syntax), "save");
}

}  // namespace palpate::testing
