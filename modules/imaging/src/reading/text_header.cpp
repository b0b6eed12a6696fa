#include "text_header.hpp"

#include "parsed.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <map>
#include <sstream>

namespace palpate::imaging::reading {

std::string trimmed(const std::string& text) {
  const char* space = " \t\r\n\v\f";
  const auto first = text.find_first_not_of(space);
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(space) - first + 1);
}

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

std::optional<double> number(const std::string& word) {
  const char* begin = word.data() + (!word.empty() && word[0] == '+' ? 1 : 0);
  const char* end = word.data() + word.size();
  double value = 0.0;
  const auto result = std::from_chars(begin, end, value);
  if (result.ec != std::errc() || result.ptr != end) return std::nullopt;
  return value;
}

std::optional<long long> whole_number(const std::string& word) {
  const char* begin = word.data() + (!word.empty() && word[0] == '+' ? 1 : 0);
  const char* end = word.data() + word.size();
  long long value = 0;
  const auto result = std::from_chars(begin, end, value);
  if (result.ec != std::errc() || result.ptr != end) return std::nullopt;
  return value;
}

std::string whole_text(double value) {
  std::ostringstream text;
  text.precision(0);
  text << std::fixed << std::trunc(value);
  return text.str();
}

std::filesystem::path companion(const std::filesystem::path& header, const std::string& name) {
  namespace fs = std::filesystem;
  const fs::path given(name);
  const std::string shown = name.size() > 120 ? name.substr(0, 120) + "..." : name;
  const bool climbs = std::find(given.begin(), given.end(), fs::path("..")) != given.end();
  if (given.empty() || given.is_absolute() || climbs)
    fail("bad-header", header,
         "names a data file outside its own folder (" + shown +
             "), which is not followed. Put both into one folder.");
  std::error_code error;
  const fs::path folder = fs::weakly_canonical(fs::absolute(header).parent_path(), error);
  const fs::path data = fs::weakly_canonical(folder / given, error);
  const auto status = fs::status(data, error);
  if (error || !fs::is_regular_file(status))
    fail("not-found", header,
         "needs its voxels from " + shown + ", which is missing. Put both into one folder.");
  const auto difference = std::mismatch(folder.begin(), folder.end(), data.begin(), data.end());
  if (difference.first != folder.end())
    fail("bad-header", header, "names a data file that leads out of its own folder (" + shown + ").");
  if (fs::equivalent(data, header, error)) fail("bad-header", header, "names itself as its data file.");
  return data;
}

HeaderLines::HeaderLines(const std::filesystem::path& path) : path_(path), file_(path, std::ios::binary) {
  if (!file_) fail("not-found", path, "cannot be opened. Check that it is there and may be read.");
}

std::optional<std::string> HeaderLines::next() {
  // A transform for each of thousands of frames makes a long header; no line of it is this long.
  constexpr std::uint64_t longest_header = std::uint64_t{64} << 20;
  constexpr std::size_t longest_line = std::size_t{1} << 20;
  std::string line;
  char c = 0;
  bool any = false;
  while (file_.get(c)) {
    any = true;
    ++position_;
    if (c == '\n') break;
    line.push_back(c);
    if (line.size() > longest_line || position_ > longest_header)
      fail("bad-header", path_, "has a header that does not end, or a line of it that does not.");
  }
  if (!any) return std::nullopt;
  if (!line.empty() && line.back() == '\r') line.pop_back();
  return line;
}

std::optional<std::string> filled_pattern(const std::string& pattern, long long value) {
  std::string name;
  bool filled = false;
  for (std::size_t n = 0; n < pattern.size(); ++n) {
    if (pattern[n] != '%') {
      name.push_back(pattern[n]);
      continue;
    }
    if (++n < pattern.size() && pattern[n] == '%') {
      name.push_back('%');
      continue;
    }
    if (filled || value < 0) return std::nullopt;
    char padding = ' ';
    if (n < pattern.size() && pattern[n] == '.') ++n, padding = '0';
    while (n < pattern.size() && pattern[n] == '0') ++n, padding = '0';
    std::size_t width = 0;
    while (n < pattern.size() && pattern[n] >= '0' && pattern[n] <= '9' && width < 100)
      width = 10 * width + static_cast<std::size_t>(pattern[n++] - '0');
    if (n >= pattern.size() || (pattern[n] != 'd' && pattern[n] != 'i' && pattern[n] != 'u') || width > 100)
      return std::nullopt;
    const std::string digits = std::to_string(value);
    if (digits.size() < width) name.append(width - digits.size(), padding);
    name += digits;
    filled = true;
  }
  if (!filled) return std::nullopt;
  return name;
}

std::vector<std::string> names_of_pattern(const std::string& pattern, long long first, long long last,
                                          long long step) {
  constexpr long long most = 1000000;
  constexpr long long largest = 1LL << 40;
  std::vector<std::string> names;
  if (step == 0 || std::abs(first) > largest || std::abs(last) > largest || std::abs(step) > largest)
    return names;
  if ((last - first) / step < 0 || (last - first) / step >= most) return names;
  for (long long n = 0; n <= (last - first) / step; ++n) {
    const auto name = filled_pattern(pattern, first + n * step);
    if (!name) return {};
    names.push_back(*name);
  }
  return names;
}

std::optional<double> millimetres_in(const std::string& unit) {
  static const std::map<std::string, double> units{
      {"mm", 1.0},          {"millimeter", 1.0}, {"millimeters", 1.0}, {"millimetre", 1.0},
      {"millimetres", 1.0}, {"cm", 10.0},        {"centimeter", 10.0}, {"centimeters", 10.0},
      {"dm", 100.0},        {"m", 1000.0},       {"meter", 1000.0},    {"meters", 1000.0},
      {"metre", 1000.0},    {"um", 1e-3},        {"\xC2\xB5m", 1e-3},  {"\xCE\xBCm", 1e-3},
      {"micron", 1e-3},     {"microns", 1e-3},   {"micrometer", 1e-3}, {"micrometers", 1e-3},
      {"nm", 1e-6},         {"in", 25.4},        {"inch", 25.4},       {"inches", 25.4}};
  const auto found = units.find(lower_case(trimmed(unit)));
  if (found == units.end()) return std::nullopt;
  return found->second;
}

std::optional<double> seconds_in(const std::string& unit) {
  static const std::map<std::string, double> units{
      {"s", 1.0},     {"sec", 1.0}, {"second", 1.0},       {"seconds", 1.0},       {"ms", 1e-3},
      {"msec", 1e-3}, {"us", 1e-6}, {"millisecond", 1e-3}, {"milliseconds", 1e-3}, {"min", 60.0}};
  const auto found = units.find(lower_case(trimmed(unit)));
  if (found == units.end()) return std::nullopt;
  return found->second;
}

}  // namespace palpate::imaging::reading
