#include "dicom_file.hpp"
#include "text_header.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcelem.h>
#include <dcmtk/dcmdata/dcitem.h>
#include <dcmtk/dcmdata/dcsequen.h>
#include <dcmtk/dcmdata/dcspchrs.h>
#include <limits>

namespace palpate::imaging::reading {
namespace {

DcmElement* element_of(DcmItem& item, DicomTag tag) {
  DcmElement* element = nullptr;
  if (item.findAndGetElement(DcmTagKey(tag.group, tag.element), element).bad()) return nullptr;
  return element;
}

bool is_text(DcmEVR vr) {
  switch (vr) {
    case EVR_AE:
    case EVR_AS:
    case EVR_CS:
    case EVR_DA:
    case EVR_DS:
    case EVR_DT:
    case EVR_IS:
    case EVR_LO:
    case EVR_LT:
    case EVR_PN:
    case EVR_SH:
    case EVR_ST:
    case EVR_TM:
    case EVR_UC:
    case EVR_UI:
    case EVR_UR:
    case EVR_UT:
      return true;
    default:
      return false;
  }
}

/// Whether the value's form is not said and has to be found in its bytes.
bool is_unknown(DcmEVR vr) {
  return vr == EVR_UN || vr == EVR_UNKNOWN || vr == EVR_UNKNOWN2B || vr == EVR_OB || vr == EVR_ox ||
         vr == EVR_px;
}

constexpr std::size_t longest_text = std::size_t{1} << 20;

/// Of values of several bytes the lowest comes first.
std::vector<std::uint8_t> raw_bytes(DcmElement& element, std::size_t most) {
  const DcmEVR kind = element.ident();
  if (kind == EVR_SQ || kind == EVR_pixelSQ || kind == EVR_PixelData) return {};
  const Uint32 length = element.getLengthField();
  if (length == 0 || length == DCM_UndefinedLength || length > most) return {};
  std::vector<std::uint8_t> bytes(length);
  if (element.getPartialValue(bytes.data(), 0, length, nullptr, EBO_LittleEndian).bad()) return {};
  return bytes;
}

/// Bytes of a string element as they stand in the file.
std::string string_of(DcmElement& element) {
  const DcmEVR vr = element.getVR();
  if (is_text(vr)) {
    char* characters = nullptr;
    Uint32 length = 0;
    if (element.getLengthField() > longest_text || element.getString(characters, length).bad() ||
        characters == nullptr)
      return {};
    return {characters, length};
  }
  if (is_unknown(vr)) {
    const auto bytes = raw_bytes(element, longest_text);
    return {bytes.begin(), bytes.end()};
  }
  OFString text;
  if (element.ident() == EVR_SQ || element.getLengthField() > longest_text ||
      element.getOFStringArray(text).bad())
    return {};
  return {text.c_str(), text.length()};
}

bool is_utf8(const std::string& text) {
  for (std::size_t n = 0; n < text.size();) {
    const auto lead = static_cast<unsigned char>(text[n]);
    const std::size_t more = lead < 0x80       ? 0
                             : lead >> 5 == 6  ? 1
                             : lead >> 4 == 14 ? 2
                             : lead >> 3 == 30 ? 3
                                               : 9;
    if (more == 9 || n + more >= text.size()) return false;
    for (std::size_t k = 1; k <= more; ++k)
      if (static_cast<unsigned char>(text[n + k]) >> 6 != 2) return false;
    n += more + 1;
  }
  return true;
}

std::string latin1_to_utf8(const std::string& text) {
  std::string result;
  for (const char character : text) {
    const auto byte = static_cast<unsigned char>(character);
    if (byte < 0x80) {
      result.push_back(character);
    } else {
      result.push_back(static_cast<char>(0xC0 | byte >> 6));
      result.push_back(static_cast<char>(0x80 | (byte & 0x3F)));
    }
  }
  return result;
}

/// By the character set of the item or of what it stands in; where that is
/// missing or wrong, as UTF-8 if it is, else as Latin 1.
std::string to_utf8(const std::string& text, DcmItem& item) {
  const bool plain =
      std::all_of(text.begin(), text.end(), [](char c) { return (c & 0x80) == 0 && c != 0x1B; });
  if (plain) return text;
  for (DcmItem* place = &item; place != nullptr; place = place->getParentItem()) {
    OFString sets;
    if (place->findAndGetOFStringArray(DCM_SpecificCharacterSet, sets).bad() || sets.empty()) continue;
    DcmSpecificCharacterSet converter;
    OFString converted;
    if (converter.selectCharacterSet(sets).good() &&
        converter.convertString(text.c_str(), text.size(), converted, "\\^=").good())
      return {converted.c_str(), converted.length()};
    break;
  }
  return is_utf8(text) ? text : latin1_to_utf8(text);
}

/// Each value without the blanks that pad it.
std::string without_padding(const std::string& text) {
  std::string result;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t to = std::min(text.find('\\', from), text.size());
    std::size_t first = from;
    std::size_t last = to;
    const auto blank = [&](std::size_t n) {
      return text[n] == ' ' || text[n] == '\0' || text[n] == '\t' || text[n] == '\r' || text[n] == '\n';
    };
    while (first < last && blank(first)) ++first;
    while (last > first && blank(last - 1)) --last;
    if (from > 0) result.push_back('\\');
    result.append(text, first, last - first);
    from = to + 1;
  }
  return result;
}

/// Empty where one of the values is no finite number.
std::vector<double> written_numbers(const std::string& text) {
  std::vector<double> values;
  const std::string all = without_padding(text);
  for (std::size_t from = 0; from <= all.size() && !all.empty();) {
    const std::size_t to = std::min(all.find('\\', from), all.size());
    const auto value = number(all.substr(from, to - from));
    if (!value || !std::isfinite(*value)) return {};
    values.push_back(*value);
    from = to + 1;
  }
  return values;
}

template <typename T>
T value_at(const std::vector<std::uint8_t>& bytes) {
  T value{};
  std::memcpy(&value, bytes.data(), sizeof(T));
  return value;
}

/// One number whose form the file does not say: text where it reads as such, else by its size.
std::vector<double> guessed_numbers(const std::vector<std::uint8_t>& bytes) {
  const std::string text(bytes.begin(), bytes.end());
  const bool digits = text.find_first_not_of(std::string("0123456789+-.eE\\ \0", 18)) == std::string::npos &&
                      text.find_first_of("0123456789") != std::string::npos;
  if (digits) {
    auto values = written_numbers(text);
    if (!values.empty()) return values;
  }
  if (bytes.size() == 2) return {static_cast<double>(value_at<std::uint16_t>(bytes))};
  if (bytes.size() == 4) {
    // Counts are small; a float of ordinary size has the bits of a huge count.
    const auto count = value_at<std::uint32_t>(bytes);
    const auto real = static_cast<double>(value_at<float>(bytes));
    const bool ordinary = std::abs(real) > 1e-9 && std::abs(real) < 1e9;
    return {ordinary ? real : static_cast<double>(count)};
  }
  std::vector<double> values;
  if (bytes.empty() || bytes.size() % 8 != 0 || bytes.size() > 8 * 64) return values;
  for (std::size_t n = 0; n < bytes.size(); n += 8) {
    double value = 0.0;
    std::memcpy(&value, bytes.data() + n, sizeof(value));
    if (!std::isfinite(value)) return {};
    values.push_back(value);
  }
  return values;
}

template <typename T>
std::vector<double> binary_numbers(DcmElement& element) {
  // No header says more numbers than this; something else was taken for the element.
  constexpr std::size_t most_bytes = std::size_t{1} << 26;
  const auto bytes = raw_bytes(element, most_bytes);
  std::vector<double> values;
  values.reserve(bytes.size() / sizeof(T));
  for (std::size_t n = 0; n + sizeof(T) <= bytes.size(); n += sizeof(T)) {
    T value{};
    std::memcpy(&value, bytes.data() + n, sizeof(T));
    if (!std::isfinite(static_cast<double>(value))) return {};
    values.push_back(static_cast<double>(value));
  }
  return values;
}

}  // namespace

bool DicomItem::has(DicomTag tag) const {
  return item_->tagExists(DcmTagKey(tag.group, tag.element)) != OFFalse;
}

std::string DicomItem::text(DicomTag tag) const {
  DcmElement* element = element_of(*item_, tag);
  if (element == nullptr) return {};
  return without_padding(to_utf8(string_of(*element), *item_));
}

std::vector<double> DicomItem::numbers(DicomTag tag) const {
  DcmElement* element = element_of(*item_, tag);
  if (element == nullptr) return {};
  switch (element->getVR()) {
    case EVR_US:
    case EVR_xs:
    case EVR_lt:
    case EVR_OW:
      return binary_numbers<std::uint16_t>(*element);
    case EVR_SS:
      return binary_numbers<std::int16_t>(*element);
    case EVR_UL:
    case EVR_up:
    case EVR_OL:
      return binary_numbers<std::uint32_t>(*element);
    case EVR_SL:
      return binary_numbers<std::int32_t>(*element);
    case EVR_UV:
    case EVR_OV:
      return binary_numbers<std::uint64_t>(*element);
    case EVR_SV:
      return binary_numbers<std::int64_t>(*element);
    case EVR_FL:
    case EVR_OF:
      return binary_numbers<float>(*element);
    case EVR_FD:
    case EVR_OD:
      return binary_numbers<double>(*element);
    default:
      break;
  }
  if (is_unknown(element->getVR())) return guessed_numbers(raw_bytes(*element, longest_text));
  return written_numbers(string_of(*element));
}

std::optional<double> DicomItem::number(DicomTag tag) const {
  const auto values = numbers(tag);
  if (values.empty()) return std::nullopt;
  return values.front();
}

std::vector<std::uint8_t> DicomItem::bytes(DicomTag tag) const {
  DcmElement* element = element_of(*item_, tag);
  if (element == nullptr) return {};
  return raw_bytes(*element, std::numeric_limits<std::uint32_t>::max());
}

std::vector<DicomItem> DicomItem::items(DicomTag sequence) const {
  std::vector<DicomItem> all;
  DcmElement* element = element_of(*item_, sequence);
  if (element == nullptr || element->ident() != EVR_SQ) return all;
  auto* list = dynamic_cast<DcmSequenceOfItems*>(element);
  if (list == nullptr) return all;
  for (DcmObject* item = list->nextInContainer(nullptr); item != nullptr; item = list->nextInContainer(item))
    if (auto* entry = dynamic_cast<DcmItem*>(item)) all.emplace_back(*entry);
  return all;
}

std::optional<DicomTag> DicomItem::private_tag(std::uint16_t group, const std::string& creator,
                                               std::uint8_t low) const {
  std::optional<DicomTag> first;
  for (std::uint16_t block = 0x10; block <= 0xFF; ++block) {
    if (!has({group, block}) || text({group, block}) != creator) continue;
    const DicomTag tag{group, static_cast<std::uint16_t>(block << 8 | low)};
    if (has(tag)) return tag;
    if (!first) first = tag;
  }
  return first;
}

std::vector<std::string> DicomItem::creators() const {
  std::vector<std::string> all;
  for (DcmObject* object = item_->nextInContainer(nullptr); object != nullptr;
       object = item_->nextInContainer(object)) {
    const DicomTag tag{object->getGTag(), object->getETag()};
    if (tag.group % 2 == 0 || tag.element < 0x10 || tag.element > 0xFF) continue;
    const std::string name = text(tag);
    if (!name.empty() && std::find(all.begin(), all.end(), name) == all.end()) all.push_back(name);
  }
  return all;
}

}  // namespace palpate::imaging::reading
