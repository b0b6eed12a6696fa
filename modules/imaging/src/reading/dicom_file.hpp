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
  /// The value's bytes; of words (OW) the lower first, of OB and UN as they
  /// stand in the file; empty where absent.
  std::vector<std::uint8_t> bytes(DicomTag tag) const;
  std::vector<DicomItem> items(DicomTag sequence) const;
  /// The tag of element xx`low` in the block that `creator` reserved in this
  /// group (PS3.5, 7.8.1): matched by name, never by block number. Where
  /// several blocks are the creator's, the first that holds the element.
  std::optional<DicomTag> private_tag(std::uint16_t group, const std::string& creator,
                                      std::uint8_t low) const;
  /// All private creators of this level, each once.
  std::vector<std::string> creators() const;

 private:
  DcmItem* item_;
};

/// Where the pixels lie: offsets count bytes of the file, of a deflated one
/// those that come out of it. Nothing of it is in memory.
struct DicomPixelPlace {
  enum class Kind { none, whole_numbers, floats, doubles };  ///< (7FE0,0010), (7FE0,0008), (7FE0,0009)
  struct Piece {
    std::uint64_t offset = 0, length = 0;
    std::uint64_t present = 0;  ///< of `length`, before the file ends
  };
  Kind kind = Kind::none;
  bool words = false;                  ///< value representation OW
  bool encapsulated = false;           ///< in fragments
  Piece value;                         ///< where not encapsulated
  std::vector<Piece> fragments;        ///< without the basic offset table
  std::vector<std::uint64_t> offsets;  ///< of the frames' fragments, basic or extended table, as they stand
  bool complete = true;                ///< no fragment is cut off, and their end was found
};

/// One DICOM file with or without preamble and meta header, read by DCMTK
/// without its pixels, which stay in the file until they are asked for. Other
/// values over 4 KB stay there as well, but in a deflated file.
class DicomFile {
 public:
  /// Throws Error(input): "unsupported" where it is no DICOM, "bad-header",
  /// "truncated" where it ends within its header, "too-large" where nesting or
  /// counts are absurd.
  explicit DicomFile(const std::filesystem::path& path);
  ~DicomFile();
  DicomFile(DicomFile&&) noexcept;
  DicomFile& operator=(DicomFile&&) noexcept;

  const std::filesystem::path& path() const { return path_; }
  /// What stands before and behind the pixels.
  DicomItem dataset() const;
  /// UID of the transfer syntax that the dataset was written in.
  std::string transfer_syntax() const { return transfer_syntax_; }
  bool deflated() const { return deflated_from_ != 0; }
  bool big_endian() const { return big_endian_; }
  const DicomPixelPlace& pixels() const { return pixels_; }
  /// That many bytes from an offset of pixels(), or fewer where the file ends.
  std::vector<std::uint8_t> read(std::uint64_t offset, std::size_t count) const;
  /// Parts of the header were damaged and left out.
  bool mended() const { return mended_; }
  DcmFileFormat& format() const { return *format_; }
  /// Whether names and types of the tags are known: without the dictionary
  /// (an incomplete installation) implicit files are read by guesses.
  static bool dictionary_loaded();

 private:
  class Loader;
  std::filesystem::path path_;
  std::unique_ptr<DcmFileFormat> format_;
  std::string transfer_syntax_;
  bool big_endian_ = false;
  bool mended_ = false;
  std::uint64_t deflated_from_ = 0;  ///< where the deflated part begins; 0 where none
  DicomPixelPlace pixels_;
};

}  // namespace palpate::imaging::reading
