#pragma once

#include <filesystem>
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

/// A file that a header names, which must lie in the header's own folder (or
/// below it) and be another file. Throws Error(input): "bad-header" for a way
/// out of the folder, "not-found" where it is missing.
std::filesystem::path companion(const std::filesystem::path& header, const std::string& name);

}  // namespace palpate::imaging::reading
