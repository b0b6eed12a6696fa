#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

class DcmItem;
class DcmFileFormat;

namespace palpate::testing {

struct Tag {
  std::uint16_t group, element;
};

/// A dataset or an item of a sequence that is being written. The type of a
/// public tag is the dictionary's; a private one's is said.
class DicomNode {
 public:
  explicit DicomNode(DcmItem& item) : item_(&item) {}
  DicomNode& text(Tag tag, const std::string& value);
  DicomNode& us(Tag tag, const std::vector<std::uint16_t>& values);
  DicomNode& ul(Tag tag, const std::vector<std::uint32_t>& values);
  DicomNode& fd(Tag tag, const std::vector<double>& values);
  DicomNode& attribute(Tag tag, Tag value);
  DicomNode& bytes(Tag tag, const std::string& value);  ///< OB
  /// One more item at the end of the sequence.
  DicomNode item(Tag sequence);
  /// Reserves a block and writes into it: element `low` of `creator`.
  DicomNode& private_text(std::uint16_t group, std::uint8_t block, const std::string& creator,
                          std::uint8_t low, const std::string& value);
  DicomNode& private_fd(std::uint16_t group, std::uint8_t block, const std::string& creator, std::uint8_t low,
                        double value);
  DicomNode& private_ul(std::uint16_t group, std::uint8_t block, const std::string& creator, std::uint8_t low,
                        std::uint32_t value);
  DicomNode& private_bytes(std::uint16_t group, std::uint8_t block, const std::string& creator,
                           std::uint8_t low, const std::string& value);
  DicomNode private_item(std::uint16_t group, std::uint8_t block, const std::string& creator,
                         std::uint8_t low);

 private:
  DcmItem* item_;
};

/// The grey value of pixel (i, j) of a frame.
using PixelValue = std::function<int(int i, int j, int frame)>;

class DicomMaker {
 public:
  /// `uid` tells instances apart: a number under this suite's own root.
  DicomMaker(const std::string& sop_class, const std::string& modality, const std::string& series,
             const std::string& uid);
  ~DicomMaker();
  DicomMaker(const DicomMaker&) = delete;
  DicomMaker& operator=(const DicomMaker&) = delete;

  DicomNode top();
  /// Grey pixels of 8 or 16 bits; NumberOfFrames is written where frames > 0.
  void pixels(int columns, int rows, int frames, int bits, const PixelValue& value);
  /// Only the pixels; the tags about them are the caller's.
  void raw_pixels(const std::string& bytes);
  /// Explicit little-endian, or implicit where asked for.
  void save(const std::filesystem::path& path, bool implicit = false);

 private:
  std::unique_ptr<DcmFileFormat> file_;
};

}  // namespace palpate::testing
