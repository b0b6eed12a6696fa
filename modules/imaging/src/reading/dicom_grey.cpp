#include "dicom_grey.hpp"

#include "parsed.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace palpate::imaging::reading {
namespace {

/// A number of a palette or table; of nonsense the end of the range.
int word_of(double value) { return static_cast<int>(std::clamp(value, -65536.0, 65536.0)); }

/// Follows the segments of a segmented palette (PS3.3, C.7.9.2).
class Segments {
 public:
  Segments(const std::vector<int>& words, std::size_t most, bool wide)
      : words_(words), most_(most), wide_(wide) {}

  std::vector<int> expand() {
    std::size_t at = 0;
    while (at + 1 < words_.size() && values_.size() < most_ && step(at, true)) {
    }
    return values_;
  }

 private:
  /// One segment; false where there is no sense in it.
  bool step(std::size_t& at, bool may_repeat) {
    if (at + 1 >= words_.size()) return false;
    const int kind = words_[at];
    const auto count = static_cast<std::size_t>(words_[at + 1]);
    at += 2;
    if (kind == 0) return discrete(at, count);
    if (kind == 1) return linear(at, count);
    if (kind == 2 && may_repeat) return repeated(at, count);
    return false;
  }
  bool discrete(std::size_t& at, std::size_t count) {
    if (at + count > words_.size()) return false;
    for (std::size_t n = 0; n < count && values_.size() < most_; ++n) values_.push_back(words_[at + n]);
    at += count;
    return true;
  }
  bool linear(std::size_t& at, std::size_t count) {
    if (at >= words_.size() || values_.empty()) return false;
    const int from = values_.back();
    const int to = words_[at++];
    for (std::size_t n = 1; n <= count && values_.size() < most_; ++n)
      values_.push_back(static_cast<int>(
          std::lround(from + (to - from) * static_cast<double>(n) / static_cast<double>(count))));
    return true;
  }
  /// Segments that stand further up, once more.
  bool repeated(std::size_t& at, std::size_t count) {
    const std::size_t parts = wide_ ? 2 : 4;
    if (at + parts > words_.size()) return false;
    std::size_t offset = 0;
    for (std::size_t n = 0; n < parts; ++n)
      offset |= static_cast<std::size_t>(words_[at + n]) << (n * (wide_ ? 16 : 8));
    if (wide_) offset /= 2;
    at += parts;
    std::size_t place = offset;
    for (std::size_t n = 0; n < count && values_.size() < most_; ++n)
      if (!step(place, false)) return false;
    return true;
  }

  const std::vector<int>& words_;
  std::size_t most_;
  bool wide_;
  std::vector<int> values_;
};

std::vector<int> numbers_in(const std::vector<std::uint8_t>& bytes, bool wide) {
  std::vector<int> numbers;
  for (std::size_t n = 0; n + (wide ? 2 : 1) <= bytes.size(); n += wide ? 2 : 1)
    numbers.push_back(wide ? bytes[n] | bytes[n + 1] << 8 : bytes[n]);
  return numbers;
}

/// The entries of one channel as they stand in the file.
std::vector<int> channel_of(const DicomItem& data, std::uint16_t channel, std::size_t count, bool wide) {
  const auto plain = data.bytes({0x0028, static_cast<std::uint16_t>(0x1201 + channel)});
  if (!plain.empty()) {
    // Entries of 8 bits may fill a word each.
    const bool words = plain.size() >= 2 * count;
    auto entries = numbers_in(plain, words);
    entries.resize(std::min(entries.size(), count));
    return entries;
  }
  const auto segmented = data.bytes({0x0028, static_cast<std::uint16_t>(0x1221 + channel)});
  const auto words = numbers_in(segmented, wide);
  return Segments(words, count, wide).expand();
}

template <typename T>
struct Stored {
  const T* samples;
  int shift;
  std::uint64_t mask;
  std::uint64_t sign;  ///< the bit that makes it negative; 0 of unsigned ones

  std::int64_t at(std::size_t n) const {
    const std::uint64_t bits = (static_cast<std::uint64_t>(samples[n]) >> shift) & mask;
    if ((bits & sign) != 0) return static_cast<std::int64_t>(bits | ~mask);
    return static_cast<std::int64_t>(bits);
  }
};

double rescaled(std::int64_t stored, const ModalityRescale& rescale) {
  if (rescale.table.empty()) return static_cast<double>(stored) * rescale.slope + rescale.intercept;
  const std::int64_t last = static_cast<std::int64_t>(rescale.table.size()) - 1;
  return rescale
      .table[static_cast<std::size_t>(std::clamp<std::int64_t>(stored - rescale.table_first, 0, last))];
}

/// The luma of the R, G and B, whole numbers, that Y, Cb and Cr stand for.
double luma_of_ybr(double y, double cb, double cr, double most, bool partial) {
  const double half = (most + 1.0) / 2.0;
  if (partial) {
    const double unit = (most + 1.0) / 256.0;
    y = (y - 16.0 * unit) * most / (219.0 * unit);
    cb = half + (cb - half) * most / (224.0 * unit);
    cr = half + (cr - half) * most / (224.0 * unit);
  }
  const double red = y + 1.402 * (cr - half);
  const double green = y - 0.344136 * (cb - half) - 0.714136 * (cr - half);
  const double blue = y + 1.772 * (cb - half);
  const auto whole = [&](double value) { return std::floor(std::clamp(value, 0.0, most) + 0.5); };
  return luma(whole(red), whole(green), whole(blue));
}

template <typename T>
bool grey_of(const std::vector<T>& samples, const CodedFrame& frame, const GreyRule& rule, float* grey) {
  const DicomPixelForm& form = rule.form;
  const auto bits = static_cast<unsigned>(form.bits_stored);
  const Stored<T> stored{samples.data(), form.high_bit + 1 - form.bits_stored,
                         bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1,
                         form.is_signed ? std::uint64_t{1} << (bits - 1) : 0};
  const std::size_t count = static_cast<std::size_t>(frame.columns) * static_cast<std::size_t>(frame.rows);
  const auto width = static_cast<std::size_t>(frame.samples);
  const std::size_t step = frame.planar ? 1 : width;
  const std::size_t plane = frame.planar ? count : 1;
  const double most = std::pow(2.0, form.bits_stored) - 1.0;
  bool padding = false;
  for (std::size_t n = 0; n < count; ++n) {
    if (rule.colour == PixelColour::grey) {
      const std::int64_t value = stored.at(n * step);
      padding = padding || (value >= rule.padding.first && value <= rule.padding.second);
      grey[n] = static_cast<float>(rescaled(value, rule.rescale));
      continue;
    }
    if (rule.colour == PixelColour::palette) {
      const auto entry = [&](const std::vector<float>& entries) {
        const std::int64_t place = stored.at(n * step) - rule.palette.first;
        return static_cast<double>(entries[static_cast<std::size_t>(
            std::clamp<std::int64_t>(place, 0, static_cast<std::int64_t>(entries.size()) - 1))]);
      };
      const auto& entries = rule.palette.entries;
      const bool missing = frame.damaged && stored.at(n * step) == 0;
      grey[n] =
          missing ? 0.0F : static_cast<float>(luma(entry(entries[0]), entry(entries[1]), entry(entries[2])));
      continue;
    }
    std::array<std::size_t, 3> places{n * step, n * step + plane, n * step + 2 * plane};
    if (rule.halved) places = {n / 2 * 4 + n % 2, n / 2 * 4 + 2, n / 2 * 4 + 3};
    const auto first = static_cast<double>(stored.at(places[0]));
    const auto second = static_cast<double>(stored.at(places[1]));
    const auto third = static_cast<double>(stored.at(places[2]));
    const bool missing = frame.damaged && first == 0.0 && second == 0.0 && third == 0.0;
    if (missing)
      grey[n] = 0.0F;
    else if (rule.colour == PixelColour::rgb)
      grey[n] = static_cast<float>(luma(first, second, third));
    else
      grey[n] = static_cast<float>(
          luma_of_ybr(first, second, third, most, rule.colour == PixelColour::ybr_partial));
  }
  return padding;
}

template <typename T>
bool grey_of_bytes(const CodedFrame& frame, const GreyRule& rule, float* grey) {
  std::vector<T> samples(frame.bytes.size() / sizeof(T));
  if (!samples.empty()) std::memcpy(samples.data(), frame.bytes.data(), samples.size() * sizeof(T));
  return grey_of(samples, frame, rule, grey);
}

}  // namespace

double luma(double red, double green, double blue) {
  if (red == green && green == blue) return red;
  return (299.0 * red + 587.0 * green + 114.0 * blue) / 1000.0;
}

Palette read_palette(const DicomFile& file, const DicomPixelForm& form) {
  const DicomItem data = file.dataset();
  Palette palette;
  const auto refuse = [&] {
    fail("bad-header", file.path(),
         "shows its colours by a palette that is missing or damaged. Export the scan again.");
  };
  std::array<std::vector<int>, 3> raw;
  int largest = 0;
  bool high_only = true;
  for (std::uint16_t channel = 0; channel < 3; ++channel) {
    const auto says = data.numbers({0x0028, static_cast<std::uint16_t>(0x1101 + channel)});
    if (says.size() != 3) refuse();
    const auto count = says[0] > 0.0 ? static_cast<std::size_t>(word_of(says[0])) : std::size_t{65536};
    // Read as unsigned or signed by the file's form; the bits are what counts.
    const auto first = word_of(says[1]);
    palette.first = form.is_signed ? static_cast<std::int16_t>(first) : static_cast<std::uint16_t>(first);
    raw[channel] = channel_of(data, channel, count, says[2] > 8.0);
    if (raw[channel].empty()) refuse();
    for (const int entry : raw[channel]) {
      largest = std::max(largest, entry);
      high_only = high_only && entry % 256 == 0;
    }
  }
  // A palette of 16 bits for pixels of 8 says their 256 colours more finely.
  const bool narrow = form.bits_allocated <= 8 && largest > 255;
  const float unit = !narrow ? 1.0F : high_only ? 256.0F : 257.0F;
  for (std::size_t channel = 0; channel < 3; ++channel)
    for (const int entry : raw[channel]) palette.entries[channel].push_back(static_cast<float>(entry) / unit);
  return palette;
}

/// Enhanced US Volume fixes its rescale at one (PS3.3 C.8.24.3). Where its
/// greys are not the stored numbers, one Real World Value Mapping that is
/// linear and without a unit says what they are.
std::optional<ModalityRescale> ultrasound_greys(const DicomItem& group) {
  const auto maps = group.items({0x0040, 0x9096});
  if (maps.size() != 1) return {};
  const auto slope = maps.front().number({0x0040, 0x9225});
  const auto units = maps.front().items({0x0040, 0x08EA});
  if (!slope || *slope == 0.0 || units.empty() || units.front().text({0x0008, 0x0100}) != "1") return {};
  ModalityRescale rescale;
  rescale.slope = *slope;
  rescale.intercept = maps.front().number({0x0040, 0x9224}).value_or(0.0);
  return rescale;
}

ModalityRescale read_rescale(const DicomFile& file, const DicomPixelForm& form,
                             const std::vector<DicomItem>& frame_groups, int frame) {
  ModalityRescale rescale;
  const DicomItem data = file.dataset();
  const bool ultrasound_volume = data.text({0x0008, 0x0016}) == "1.2.840.10008.5.1.4.1.1.6.2";
  std::optional<ModalityRescale> greys;
  std::vector<DicomItem> places;
  const auto add = [&](const DicomItem& group) {
    if (ultrasound_volume && !greys) greys = ultrasound_greys(group);
    const auto items = group.items({0x0028, 0x9145});
    if (!items.empty()) places.push_back(items.front());
  };
  if (static_cast<std::size_t>(frame) < frame_groups.size())
    add(frame_groups[static_cast<std::size_t>(frame)]);
  const auto shared = data.items({0x5200, 0x9229});
  if (!shared.empty()) add(shared.front());
  if (greys) return *greys;
  places.push_back(data);
  for (const auto& place : places) {
    const auto slope = place.number({0x0028, 0x1053});
    const auto intercept = place.number({0x0028, 0x1052});
    if (!slope && !intercept) continue;
    // A slope of nothing would wipe the picture out; it stands where none was meant.
    rescale.slope = slope && *slope != 0.0 ? *slope : 1.0;
    rescale.intercept = intercept.value_or(0.0);
    return rescale;
  }
  const auto tables = data.items({0x0028, 0x3000});
  if (tables.empty()) return rescale;
  const auto says = tables.front().numbers({0x0028, 0x3002});
  auto table = tables.front().numbers({0x0028, 0x3006});
  if (says.size() != 3 || table.empty()) return rescale;
  const auto first = word_of(says[1]);
  rescale.table_first = form.is_signed ? static_cast<std::int16_t>(first) : static_cast<std::uint16_t>(first);
  const auto count = says[0] > 0.0 ? static_cast<std::size_t>(word_of(says[0])) : std::size_t{65536};
  table.resize(std::min(table.size(), count));
  rescale.table = std::move(table);
  return rescale;
}

bool make_grey(const CodedFrame& frame, const GreyRule& rule, float* grey) {
  if (frame.packed_bits) {
    const std::size_t count = static_cast<std::size_t>(frame.columns) * static_cast<std::size_t>(frame.rows);
    for (std::size_t n = 0; n < count; ++n)
      grey[n] = static_cast<float>(rescaled(frame.bytes[n / 8] >> (n % 8) & 1, rule.rescale));
    return false;
  }
  switch (frame.sample_bytes) {
    case 1:
      return grey_of(frame.bytes, frame, rule, grey);
    case 2:
      return grey_of_bytes<std::uint16_t>(frame, rule, grey);
    case 4:
      return grey_of_bytes<std::uint32_t>(frame, rule, grey);
    default:
      return grey_of_bytes<std::uint64_t>(frame, rule, grey);
  }
}

}  // namespace palpate::imaging::reading
