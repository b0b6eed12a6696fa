#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

class DcmItem;
class DcmFileFormat;

namespace palpate::imaging::reading {

/// (group, element) of DICOM PS3.6.
struct DicomTag {
  std::uint16_t group = 0, element = 0;
};

/// A dataset or an item of a sequence; lives as long as its DicomFile. Byte
/// order and value representation are dealt with, unknown ones by the bytes.
class DicomItem {
 public:
  explicit DicomItem(DcmItem& item) : item_(&item) {}
  bool has(DicomTag tag) const;  ///< present, perhaps empty
  /// All values as UTF-8 text, padding trimmed, several parted by backslashes; empty where absent.
  std::string text(DicomTag tag) const;
  /// All values as numbers, written (DS, IS) or binary (US, SS, UL, SL, FL, FD, ...);
  /// empty where absent or where one of them is no finite number.
  std::vector<double> numbers(DicomTag tag) const;
  /// The first of numbers().
  std::optional<double> number(DicomTag tag) const;
  /// The value's bytes in the file's order (OB, OW, UN); empty where absent.
  std::vector<std::uint8_t> bytes(DicomTag tag) const;
  std::vector<DicomItem> items(DicomTag sequence) const;
  /// The tag of element xx`low` in the block that `creator` reserved in this
  /// group (PS3.5, 7.8.1): matched by name, never by block number.
  std::optional<DicomTag> private_tag(std::uint16_t group, const std::string& creator,
                                      std::uint8_t low) const;
  /// All private creators of this level, each once.
  std::vector<std::string> creators() const;

 private:
  DcmItem* item_;
};

/// One DICOM file with or without preamble and meta header, read by DCMTK
/// without its pixels, which stay in the file until they are asked for.
class DicomFile {
 public:
  /// Throws Error(input): "unsupported" where it is no DICOM, "bad-header",
  /// "too-large" where nesting or counts are absurd.
  explicit DicomFile(const std::filesystem::path& path);
  ~DicomFile();
  DicomFile(DicomFile&&) noexcept;
  DicomFile& operator=(DicomFile&&) noexcept;

  const std::filesystem::path& path() const { return path_; }
  DicomItem dataset() const;
  /// UID of the transfer syntax that the dataset was written in.
  std::string transfer_syntax() const;
  /// For the pixel decoder (dicom_pixels.hpp) and nobody else.
  DcmFileFormat& format() const { return *format_; }

 private:
  std::filesystem::path path_;
  std::unique_ptr<DcmFileFormat> format_;
};

}  // namespace palpate::imaging::reading
