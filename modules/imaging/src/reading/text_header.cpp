#include "text_header.hpp"

#include "parsed.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
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

}  // namespace palpate::imaging::reading
