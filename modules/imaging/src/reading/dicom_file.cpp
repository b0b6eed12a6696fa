#include "dicom_file.hpp"

#include "parsed.hpp"

#include <algorithm>
#include <array>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcdict.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcistrmf.h>
#include <dcmtk/dcmdata/dcmetinf.h>
#include <dcmtk/oflog/oflog.h>
#include <fstream>

namespace palpate::imaging::reading {
namespace {

constexpr Uint32 longest_kept_value = 4096;

/// DCMTK descends into sequences by recursion: what it may take of the stack
/// limits the nesting, whatever the transfer syntax. Scans nest about ten deep,
/// a level takes about 1 KB.
constexpr std::uintptr_t most_stack = std::uintptr_t{256} << 10;
constexpr std::uint64_t most_elements = 5000000;

std::uintptr_t stack_place() { return reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0)); }

/// A file as DCMTK reads it, that stops once the data nest too deep or have too many elements.
class WatchedStream : public DcmInputFileStream {
 public:
  enum class Stop { none, depth, count };

  explicit WatchedStream(const std::filesystem::path& path)
      : DcmInputFileStream(OFFilename(path.c_str())), from_(stack_place()) {}

  OFBool good() const override { return !watch() && DcmInputFileStream::good(); }
  OFCondition status() const override {
    return watch() ? OFCondition(EC_CorruptedData) : DcmInputFileStream::status();
  }
  void mark() override {
    if (++marks_ > most_elements && stop_ == Stop::none) stop_ = Stop::count;
    marked_at_ = static_cast<std::uint64_t>(tell());
    DcmInputFileStream::mark();
  }
  std::uint64_t marked_at() const { return marked_at_; }
  std::uint64_t place() const { return static_cast<std::uint64_t>(tell()); }
  Stop stop() const { return stop_; }

  bool read_all(void* bytes, std::size_t count) {
    return good() && read(bytes, static_cast<offile_off_t>(count)) == static_cast<offile_off_t>(count);
  }
  /// How many of `count` bytes there were to skip.
  std::uint64_t pass(std::uint64_t count) {
    std::uint64_t passed = 0;
    while (passed < count && good() && !eos()) {
      const auto step = skip(static_cast<offile_off_t>(count - passed));
      if (step <= 0) break;
      passed += static_cast<std::uint64_t>(step);
    }
    return passed;
  }

 private:
  bool watch() const {
    const std::uintptr_t here = stack_place();
    if ((from_ > here ? from_ - here : here - from_) > most_stack && stop_ == Stop::none) stop_ = Stop::depth;
    return stop_ != Stop::none;
  }

  std::uintptr_t from_;
  mutable Stop stop_ = Stop::none;
  std::uint64_t marks_ = 0;
  std::uint64_t marked_at_ = 0;
};

/// How DCMTK reads in this program: forgiving, and without a word on the terminal.
void prepare_dcmtk(bool ignore_errors) {
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  dcmIgnoreFileMetaInformationGroupLength.set(OFTrue);
  dcmAutoDetectDatasetXfer.set(OFTrue);
  dcmAcceptUnexpectedImplicitEncoding.set(OFTrue);
  dcmReplaceWrongDelimitationItem.set(OFTrue);
  dcmEnableUnknownVRConversion.set(OFTrue);
  dcmIgnoreParsingErrors.set(ignore_errors ? OFTrue : OFFalse);
}

std::uint32_t number_of(const std::uint8_t* bytes, std::size_t count, bool big_endian) {
  std::uint32_t value = 0;
  for (std::size_t n = 0; n < count; ++n)
    value |= std::uint32_t{bytes[n]} << (8 * (big_endian ? count - 1 - n : n));
  return value;
}

/// Whether `count` elements of rising tags follow each other from here.
bool elements_at(const std::vector<std::uint8_t>& bytes, std::size_t at, int count, bool explicit_vr) {
  std::uint32_t before = 0;
  for (; count > 0; --count) {
    if (at + 8 > bytes.size()) return false;
    const std::uint32_t group = number_of(&bytes[at], 2, false);
    const std::uint32_t tag = group << 16 | number_of(&bytes[at + 2], 2, false);
    if ((group != 0x0002 && group != 0x0008) || tag <= before) return false;
    before = tag;
    const auto letter = [&](std::size_t n) { return bytes[n] >= 'A' && bytes[n] <= 'Z'; };
    if (explicit_vr && (!letter(at + 4) || !letter(at + 5))) return false;
    at += 8 + (explicit_vr ? number_of(&bytes[at + 6], 2, false) : number_of(&bytes[at + 4], 4, false));
  }
  return true;
}

struct Beginning {
  bool found = false;
  bool marked = false;       ///< by the letters DICM
  std::uint64_t before = 0;  ///< bytes that do not belong to it
};

/// Some files have stray bytes before them, or before their DICM.
Beginning beginning_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<std::uint8_t> start(4096);
  file.read(reinterpret_cast<char*>(start.data()), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, file.gcount())));
  constexpr std::size_t preamble = 128;
  static constexpr std::array<std::uint8_t, 4> magic{'D', 'I', 'C', 'M'};
  if (start.size() > preamble + 4 && std::equal(magic.begin(), magic.end(), start.begin() + preamble))
    return {true, true, 0};
  if (may_be_dicom(path)) return {true, false, 0};
  const auto found = std::search(start.begin(), start.end(), magic.begin(), magic.end());
  const auto behind = static_cast<std::size_t>(found - start.begin()) + 4;
  if (found != start.end() && elements_at(start, behind, 2, true)) return {true, true, behind};
  constexpr std::size_t furthest = 256;
  for (std::size_t n = 1; n < std::min(furthest, start.size()); ++n)
    if (elements_at(start, n, 4, true) || elements_at(start, n, 4, false)) return {true, false, n};
  return {};
}

struct ElementStart {
  DicomTag tag;
  std::uint32_t length = 0;
  bool words = false;
};

/// Tag and length of a pixel element; none where the file ends.
std::optional<ElementStart> element_start(WatchedStream& stream, bool explicit_vr, bool big_endian) {
  std::array<std::uint8_t, 8> head{};
  if (!stream.read_all(head.data(), head.size())) return std::nullopt;
  ElementStart start;
  start.tag.group = static_cast<std::uint16_t>(number_of(head.data(), 2, big_endian));
  start.tag.element = static_cast<std::uint16_t>(number_of(head.data() + 2, 2, big_endian));
  const auto letter = [](std::uint8_t byte) { return byte >= 'A' && byte <= 'Z'; };
  if (!explicit_vr || !letter(head[4]) || !letter(head[5])) {
    start.length = number_of(head.data() + 4, 4, big_endian);
    return start;
  }
  // All that pixels may be (OB, OW, OF, OD, ..., UN) have a long length.
  std::array<std::uint8_t, 4> length{};
  if (!stream.read_all(length.data(), length.size())) return std::nullopt;
  start.length = number_of(length.data(), 4, big_endian);
  start.words = head[4] == 'O' && head[5] == 'W';
  return start;
}

constexpr std::uint32_t undefined_length = 0xFFFFFFFF;

/// Walks over the fragments, the stream standing before the first item.
void pass_fragments(WatchedStream& stream, DicomPixelPlace& place) {
  place.complete = false;
  for (bool first = true;; first = false) {
    std::array<std::uint8_t, 8> head{};
    if (!stream.read_all(head.data(), head.size())) return;
    const std::uint32_t tag = number_of(head.data(), 2, false) << 16 | number_of(head.data() + 2, 2, false);
    const std::uint32_t length = number_of(head.data() + 4, 4, false);
    if (tag == 0xFFFEE0DD) {
      place.complete = true;
      return;
    }
    if (tag != 0xFFFEE000 || length == undefined_length) return;
    DicomPixelPlace::Piece piece{stream.place(), length, 0};
    constexpr std::uint32_t longest_table = std::uint32_t{1} << 24;
    if (first && length <= longest_table) {
      std::vector<std::uint8_t> table(length);
      if (!stream.read_all(table.data(), table.size())) return;
      for (std::size_t n = 0; n + 4 <= table.size(); n += 4)
        place.offsets.push_back(number_of(table.data() + n, 4, false));
      continue;
    }
    piece.present = stream.pass(length);
    if (!first) place.fragments.push_back(piece);
    if (piece.present < piece.length) return;
  }
}

}  // namespace

/// Fills a DicomFile. One attempt is strict, and where that fails another goes
/// on behind what is damaged.
class DicomFile::Loader {
 public:
  Loader(DicomFile& file, std::uint64_t before, bool mend) : file_(file), stream_(file.path_) {
    prepare_dcmtk(mend);
    stream_.pass(before);
  }

  /// Whether the header was read to its end.
  bool load() {
    const DcmTagKey pixel_group(0x7FE0, 0x0008);
    file_.format_ = std::make_unique<DcmFileFormat>();
    file_.pixels_ = {};
    DcmMetaInfo& meta = *file_.format_->getMetaInfo();
    DcmDataset& dataset = *file_.format_->getDataset();
    meta.transferInit();
    dataset.transferInit();
    if (!stream_.good() || meta.read(stream_, EXS_Unknown, EGL_noChange, longest_kept_value).bad())
      return false;
    file_.transfer_syntax_ = DicomItem(meta).text({0x0002, 0x0010});
    const bool named = !file_.transfer_syntax_.empty();
    const DcmXfer stated(file_.transfer_syntax_.c_str());
    const E_TransferSyntax form = named ? stated.getXfer() : EXS_Unknown;
    file_.deflated_from_ = named && stated.getStreamCompression() == ESC_zlib ? stream_.place() : 0;
    // Of what DCMTK does not know it finds out byte order and form by itself.
    bool good = dataset.readUntilTag(stream_, form, EGL_noChange, longest_kept_value, pixel_group).good();
    const DcmXfer found(dataset.getOriginalXfer());
    if (!named && found.getXferID() != nullptr) file_.transfer_syntax_ = found.getXferID();
    file_.big_endian_ = found.getByteOrder() == EBO_BigEndian;
    while (pass_stray_item()) good = read_part(found.getXfer(), pixel_group);
    if (!good) return false;
    take_pixels(found);
    read_rest(found.getXfer());
    return true;
  }
  const WatchedStream& stream() const { return stream_; }
  bool at_end() { return stream_.eos(); }

 private:
  /// The stream stands behind the start of the element that ended the header, or at the file's end.
  void take_pixels(const DcmXfer& form) {
    constexpr std::uint64_t longest_start = 12;
    if (stream_.place() - stream_.marked_at() > longest_start) return;
    stream_.putback();
    stream_.mark();
    const auto start = element_start(stream_, form.isExplicitVR(), file_.big_endian_);
    DicomPixelPlace& place = file_.pixels_;
    using Kind = DicomPixelPlace::Kind;
    if (start && start->tag.group == 0x7FE0)
      place.kind = start->tag.element == 0x0008   ? Kind::floats
                   : start->tag.element == 0x0009 ? Kind::doubles
                   : start->tag.element == 0x0010 ? Kind::whole_numbers
                                                  : Kind::none;
    if (place.kind == Kind::none) {
      if (start && stream_.good()) stream_.putback();
      return;
    }
    place.words = start->words;
    place.encapsulated = start->length == undefined_length;
    if (place.encapsulated) return pass_fragments(stream_, place);
    place.value = {stream_.place(), start->length, 0};
    place.value.present = stream_.pass(start->length);
  }

  /// Vendors put whole volumes behind the pixels; what is broken there is left.
  void read_rest(E_TransferSyntax form) {
    if (stream_.eos() || !stream_.good()) return;
    read_part(form, DCM_UndefinedTagKey);
  }

  /// Reads on from here; the elements become part of the dataset.
  bool read_part(E_TransferSyntax form, const DcmTagKey& until) {
    DcmDataset part;
    part.transferInit();
    const bool good =
        part.DcmItem::readUntilTag(stream_, form, EGL_noChange, longest_kept_value, until).good();
    while (part.card() > 0) {
      DcmElement* element = part.remove(0UL);
      if (element == nullptr) break;
      if (file_.format_->getDataset()->insert(element, OFFalse).bad()) delete element;
    }
    return good;
  }

  /// Items whose sequence was taken away are left out with what they hold.
  bool pass_stray_item() {
    constexpr std::uint64_t item_start = 8;
    if (!stream_.good() || stream_.eos() || stream_.place() - stream_.marked_at() > 12) return false;
    stream_.putback();
    stream_.mark();
    std::array<std::uint8_t, item_start> head{};
    if (!stream_.read_all(head.data(), head.size())) return false;
    const bool big = file_.big_endian_;
    const std::uint32_t element = number_of(head.data() + 2, 2, big);
    const std::uint32_t length = number_of(head.data() + 4, 4, big);
    if (number_of(head.data(), 2, big) != 0xFFFE) {
      stream_.putback();
      return false;
    }
    file_.mended_ = true;
    if (element == 0xE000 && length != undefined_length) return stream_.pass(length) == length;
    return element == 0xE000 || element == 0xE00D || element == 0xE0DD;
  }

  DicomFile& file_;
  WatchedStream stream_;
};

DicomFile::DicomFile(const std::filesystem::path& path) : path_(path) {
  const Beginning beginning = beginning_of(path);
  if (!beginning.found)
    fail("unsupported", path, "is no DICOM file. Export the scan again, or as MetaImage or NRRD.");
  bool whole = false;
  bool ended = false;
  for (const bool mend : {false, true}) {
    if (whole) break;
    Loader loader(*this, beginning.before, mend);
    mended_ = mend;
    whole = loader.load();
    ended = loader.at_end();
    if (loader.stream().stop() == WatchedStream::Stop::depth)
      fail("too-large", path,
           "nests its data deeper than any scan does; it is damaged or made to do harm. Export the scan "
           "again.");
    if (loader.stream().stop() == WatchedStream::Stop::count)
      fail("too-large", path,
           "holds more than " + std::to_string(most_elements) +
               " pieces of data in its header; it is damaged or made to do harm. Export the scan again.");
  }
  const DicomItem data = dataset();
  const bool known = data.has({0x0008, 0x0016}) || data.has({0x0008, 0x0018}) || data.has({0x0008, 0x0060}) ||
                     data.has({0x0028, 0x0010});
  if (!known && (!beginning.marked || format_->getDataset()->card() == 0))
    fail("unsupported", path, "is no DICOM file that can be read. Export it again, or as MetaImage or NRRD.");
  if (whole || pixels_.kind != DicomPixelPlace::Kind::none) return;
  if (ended) fail("truncated", path, "ends within its header. It was cut off: copy or export it again.");
  fail("bad-header", path, "has a damaged header that cannot be read to its end. Export the scan again.");
}

DicomFile::~DicomFile() = default;
DicomFile::DicomFile(DicomFile&&) noexcept = default;
DicomFile& DicomFile::operator=(DicomFile&&) noexcept = default;

DicomItem DicomFile::dataset() const { return DicomItem(*format_->getDataset()); }

std::vector<std::uint8_t> DicomFile::read(std::uint64_t offset, std::size_t count) const {
  std::vector<std::uint8_t> bytes(count);
  std::size_t have = 0;
  if (deflated_from_ == 0) {
    std::ifstream file(path_, std::ios::binary);
    file.seekg(static_cast<std::streamoff>(offset));
    file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(count));
    have = static_cast<std::size_t>(std::max<std::streamsize>(0, file.gcount()));
  } else {
    WatchedStream stream(path_);
    stream.pass(deflated_from_);
    if (stream.installCompressionFilter(ESC_zlib).good() &&
        stream.pass(offset - deflated_from_) == offset - deflated_from_) {
      while (have < count && stream.good() && !stream.eos()) {
        const auto step =
            stream.DcmInputFileStream::read(bytes.data() + have, static_cast<offile_off_t>(count - have));
        if (step <= 0) break;
        have += static_cast<std::size_t>(step);
      }
    }
  }
  bytes.resize(have);
  return bytes;
}

bool DicomFile::dictionary_loaded() { return dcmDataDict.isDictionaryLoaded(); }

}  // namespace palpate::imaging::reading
