#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace palpate::cli {

/// Strict numbers: the whole text, finite, inside the range; the dot is the
/// decimal point whatever the locale. All throw Error(usage) saying what is
/// accepted; the option's name is put before it by the parser.
double parse_number(const std::string& text, double low, double high, const std::string& unit = {});
std::int64_t parse_whole(const std::string& text, std::int64_t low, std::int64_t high);
std::uint64_t parse_seed(const std::string& text);
std::array<double, 3> parse_three(const std::string& text, double low, double high);

std::vector<std::string> split(const std::string& text, char separator);
std::string join(const std::vector<std::string>& words, const std::string& between);

/// One of `accepted`; a word of `later` is refused as not in this version yet.
std::string parse_choice(const std::string& text, const std::vector<std::string>& accepted,
                         const std::vector<std::string>& later = {});

/// Few digits, for people.
std::string shown(double value, int digits = 4);
std::string shown_bytes(double bytes);
std::string shown_count(std::uint64_t count);

}  // namespace palpate::cli
