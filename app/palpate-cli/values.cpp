#include "values.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>

namespace palpate::cli {
namespace {

std::string plain(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.10g", value);
  return text.data();
}

template <typename Number>
bool whole_text(const std::string& text, Number& number) {
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, number);
  return result.ec == std::errc() && result.ptr == end;
}

}  // namespace

double parse_number(const std::string& text, double low, double high, const std::string& unit) {
  double number = 0.0;
  if (!whole_text(text, number) || !std::isfinite(number) || number < low || number > high)
    core::throw_usage("a number from " + plain(low) + " to " + plain(high) +
                      (unit.empty() ? "" : " " + unit) + " is needed, not \"" + text + "\".");
  return number;
}

std::int64_t parse_whole(const std::string& text, std::int64_t low, std::int64_t high) {
  std::int64_t number = 0;
  if (!whole_text(text, number) || number < low || number > high)
    core::throw_usage("a whole number from " + std::to_string(low) + " to " + std::to_string(high) +
                      " is needed, not \"" + text + "\".");
  return number;
}

std::uint64_t parse_seed(const std::string& text) {
  std::uint64_t number = 0;
  if (!whole_text(text, number))
    core::throw_usage("a whole number from 0 to " +
                      std::to_string(std::numeric_limits<std::uint64_t>::max()) + " is needed, not \"" +
                      text + "\".");
  return number;
}

std::array<double, 3> parse_three(const std::string& text, double low, double high) {
  const auto parts = split(text, ',');
  if (parts.size() != 3) core::throw_usage("three numbers X,Y,Z are needed, not \"" + text + "\".");
  return {parse_number(parts[0], low, high), parse_number(parts[1], low, high),
          parse_number(parts[2], low, high)};
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char letter : text) {
    if (letter == separator)
      parts.emplace_back();
    else
      parts.back() += letter;
  }
  return parts;
}

std::string join(const std::vector<std::string>& words, const std::string& between) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

std::string parse_choice(const std::string& text, const std::vector<std::string>& accepted,
                         const std::vector<std::string>& later) {
  if (std::find(accepted.begin(), accepted.end(), text) != accepted.end()) return text;
  const std::string list = join(accepted, ", ");
  if (std::find(later.begin(), later.end(), text) != later.end())
    core::throw_usage("this version does not have \"" + text + "\" yet; it has " + list + ".");
  core::throw_usage("\"" + text + "\" is not accepted; accepted: " + list + ".");
}

std::string shown(double value, int digits) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, value);
  return text.data();
}

std::string shown_bytes(double bytes) {
  constexpr std::array<const char*, 5> units{"bytes", "KiB", "MiB", "GiB", "TiB"};
  std::size_t unit = 0;
  while (bytes >= 1024.0 && unit + 1 < units.size()) {
    bytes /= 1024.0;
    ++unit;
  }
  return shown(bytes, 4) + " " + units[unit];
}

std::string shown_count(std::uint64_t count) {
  std::string digits = std::to_string(count);
  for (int place = static_cast<int>(digits.size()) - 3; place > 0; place -= 3)
    digits.insert(static_cast<std::size_t>(place), " ");
  return digits;
}

}  // namespace palpate::cli
