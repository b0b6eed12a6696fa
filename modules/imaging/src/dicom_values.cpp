#include "dicom_values.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace palpate::imaging {
namespace {

std::uint64_t mixed(std::uint64_t x) {
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}

std::string decimal(std::uint64_t high, std::uint64_t low) {
  std::array<std::uint64_t, 4> limbs{high >> 32U, high & 0xFFFFFFFFU, low >> 32U, low & 0xFFFFFFFFU};
  std::string digits;
  while (std::any_of(limbs.begin(), limbs.end(), [](std::uint64_t limb) { return limb != 0; })) {
    std::uint64_t rest = 0;
    for (auto& limb : limbs) {
      const std::uint64_t value = (rest << 32U) | limb;
      limb = value / 10;
      rest = value % 10;
    }
    digits.push_back(static_cast<char>('0' + rest));
  }
  std::reverse(digits.begin(), digits.end());
  return digits;
}

bool all_whole(const core::Volume& volume, float most) {
  return std::all_of(volume.data(), volume.data() + volume.size(), [most](float value) {
    return value >= 0.0F && value <= most && value == std::floor(value);
  });
}

}  // namespace

void ContentHash::add(const void* data, std::size_t bytes) {
  const auto* const octets = static_cast<const unsigned char*>(data);
  for (std::size_t n = 0; n < bytes; ++n) {
    low_ = (low_ ^ octets[n]) * 0x100000001B3ULL;
    high_ = (high_ ^ octets[n]) * 0x9E3779B97F4A7C15ULL;
    high_ ^= high_ >> 29U;
  }
}

std::string ContentHash::uid(std::uint64_t member) const {
  std::uint64_t high = mixed(high_ + 0x9E3779B97F4A7C15ULL * (member + 1));
  std::uint64_t low = mixed(low_ ^ mixed(member + 0x632BE59BD9B4E019ULL));
  high = (high & ~0xF000ULL) | 0x8000ULL;
  low = (low & ~(0xC0ULL << 56U)) | (0x80ULL << 56U);
  return "2.25." + decimal(high, low);
}

std::string decimal_string(double value) {
  std::array<char, 64> text{};
  if (value == 0.0) value = 0.0;  // no "-0"
  const auto shortest = std::to_chars(text.data(), text.data() + text.size(), value);
  std::string best(text.data(), shortest.ptr);
  for (int digits = 15; best.size() > 16 && digits > 0; --digits) {
    const auto end =
        std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, digits).ptr;
    best.assign(text.data(), end);
  }
  return best;
}

std::uint16_t StoredGreys::number_of(float value) const {
  const double number = (static_cast<double>(value) - intercept) / slope;
  return static_cast<std::uint16_t>(std::clamp(std::floor(number + 0.5), 0.0, bits == 8 ? 255.0 : 65535.0));
}

StoredGreys stored_greys(const std::vector<core::Volume>& frames) {
  const auto every = [&](float most) {
    return std::all_of(frames.begin(), frames.end(),
                       [most](const core::Volume& frame) { return all_whole(frame, most); });
  };
  if (every(255.0F)) return {8, false, 1.0, 0.0};
  if (every(65535.0F)) return {};
  double least = frames.front().range().min;
  double most = frames.front().range().max;
  for (const auto& frame : frames) {
    least = std::min(least, static_cast<double>(frame.range().min));
    most = std::max(most, static_cast<double>(frame.range().max));
  }
  return {16, true, most > least ? (most - least) / 65535.0 : 1.0, least};
}

}  // namespace palpate::imaging
