#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

std::string trimmed(const std::string& text);
std::string lower_case(std::string text);
std::vector<std::string> words_of(const std::string& text);
/// The whole word as a number, or none.
std::optional<double> number(const std::string& word);
std::optional<long long> whole_number(const std::string& word);
/// A number of any size without its fraction.
std::string whole_text(double value);

/// A file that a header names, which must lie in the header's own folder (or
/// below it) and be another file. Links are followed first: one that leads out
/// of the folder is a way out of it by another name, and scans come in archives
/// that may hold links. Throws Error(input): "bad-header" for a way out of the
/// folder, "not-found" where it is missing.
std::filesystem::path companion(const std::filesystem::path& header, const std::string& name);

/// The lines of a text header, which may be followed by anything.
class HeaderLines {
 public:
  /// Throws Error(input, "not-found").
  explicit HeaderLines(const std::filesystem::path& path);
  /// The next line without its end, or none where the file ends. Throws
  /// Error(input, "bad-header") for a line or a header that is longer than any.
  std::optional<std::string> next();
  /// Where the next line begins.
  std::uint64_t position() const noexcept { return position_; }

 private:
  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t position_ = 0;
};

/// "slice%03d.raw" with a number in its one %d (%i, %u), or none for another pattern.
std::optional<std::string> filled_pattern(const std::string& pattern, long long value);
/// A pattern with first, last and step; empty where it names none or absurdly many.
std::vector<std::string> names_of_pattern(const std::string& pattern, long long first, long long last,
                                          long long step);

/// Millimetres in a unit of length ("mm", "cm", "m", "um", ...), or none for a word that is no such unit.
std::optional<double> millimetres_in(const std::string& unit);
/// Seconds in a unit of time.
std::optional<double> seconds_in(const std::string& unit);

}  // namespace palpate::imaging::reading
