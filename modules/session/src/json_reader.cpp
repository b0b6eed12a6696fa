#include "json_reader.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

namespace palpate::session {
namespace {

std::string kind_of(const nlohmann::json& value) {
  if (value.is_null()) return "nothing (null)";
  if (value.is_number()) return "the number " + value.dump();
  if (value.is_string()) return "a text";
  return std::string("a value of type ") + value.type_name();
}

std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

std::string range_text(double low, double high) {
  std::ostringstream text;
  text << "a number from " << low << " to " << high;
  return text.str();
}

}  // namespace

void refuse(const std::string& place, const std::string& why) { core::throw_usage(place + ": " + why); }

nlohmann::json parse_json(const std::string& text, const std::string& what) {
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& error) {
    const std::size_t end = std::min(text.size(), error.byte == 0 ? std::size_t{0} : error.byte - 1);
    const auto until = text.begin() + static_cast<std::ptrdiff_t>(end);
    const auto line = std::count(text.begin(), until, '\n') + 1;
    const auto line_start = text.rfind('\n', end == 0 ? 0 : end - 1);
    const std::size_t column = line == 1 ? end + 1 : end - line_start;
    refuse("line " + std::to_string(line) + ", column " + std::to_string(column),
           what + " is not valid JSON there.");
  } catch (const nlohmann::json::out_of_range&) {
    refuse(what, "a number in it is too large to be one.");
  }
}

ObjectReader::ObjectReader(const nlohmann::json& value, std::string place)
    : value_(value), place_(std::move(place)) {
  if (!value_.is_object())
    refuse(place_.empty() ? "the outermost value" : place_,
           "an object in braces is needed, not " + kind_of(value_) + ".");
}

std::string ObjectReader::place_of(const std::string& key) const {
  return place_.empty() ? key : place_ + "." + key;
}

bool ObjectReader::has(const std::string& key) {
  known_.insert(key);
  const auto found = value_.find(key);
  return found != value_.end() && !found->is_null();
}

const nlohmann::json& ObjectReader::at(const std::string& key) {
  if (!has(key)) refuse(place_of(key), "this is needed and missing.");
  return *value_.find(key);
}

ObjectReader ObjectReader::object(const std::string& key) { return {at(key), place_of(key)}; }

void ObjectReader::finish() const {
  for (const auto& [key, unused] : value_.items())
    if (known_.count(key) == 0)
      refuse(place_of(key), "unknown here; known are " +
                                listed(std::vector<std::string>(known_.begin(), known_.end())) + ".");
}

void ObjectReader::read(const std::string& key, std::string& value) {
  if (!has(key)) return;
  const auto& found = at(key);
  if (!found.is_string()) refuse(place_of(key), "a text is needed, not " + kind_of(found) + ".");
  value = found.get<std::string>();
}

void ObjectReader::read(const std::string& key, bool& value) {
  if (!has(key)) return;
  const auto& found = at(key);
  if (!found.is_boolean()) refuse(place_of(key), "true or false is needed, not " + kind_of(found) + ".");
  value = found.get<bool>();
}

void ObjectReader::read(const std::string& key, double& value, double low, double high) {
  if (has(key)) value = number(at(key), place_of(key), low, high);
}

void ObjectReader::read(const std::string& key, int& value, int low, int high) {
  if (has(key)) value = static_cast<int>(whole(at(key), place_of(key), low, high));
}

void ObjectReader::read(const std::string& key, std::uint64_t& value) {
  if (!has(key)) return;
  const auto& found = at(key);
  if (!found.is_number_unsigned())
    refuse(place_of(key), "a whole number that is not negative is needed, not " + kind_of(found) + ".");
  value = found.get<std::uint64_t>();
}

void ObjectReader::read_word(const std::string& key, std::size_t& index,
                             const std::vector<std::string>& words) {
  if (has(key)) index = word(at(key), place_of(key), words);
}

std::size_t ObjectReader::word(const nlohmann::json& value, const std::string& place,
                               const std::vector<std::string>& words) {
  if (!value.is_string()) refuse(place, "a text is needed, not " + kind_of(value) + ".");
  const auto text = value.get<std::string>();
  const auto found = std::find(words.begin(), words.end(), text);
  if (found == words.end())
    refuse(place, "\"" + text + "\" is not accepted; this version has " + listed(words) + ".");
  return static_cast<std::size_t>(found - words.begin());
}

double ObjectReader::number(const nlohmann::json& value, const std::string& place, double low, double high) {
  if (!value.is_number()) refuse(place, range_text(low, high) + " is needed, not " + kind_of(value) + ".");
  const double number = value.get<double>();
  if (!std::isfinite(number) || number < low || number > high)
    refuse(place, range_text(low, high) + " is needed, not " + value.dump() + ".");
  return number;
}

std::int64_t ObjectReader::whole(const nlohmann::json& value, const std::string& place, std::int64_t low,
                                 std::int64_t high) {
  const bool fits = value.is_number_unsigned()
                        ? value.get<std::uint64_t>() <= static_cast<std::uint64_t>(high)
                        : value.is_number_integer() && value.get<std::int64_t>() <= high;
  if (!fits || value.get<std::int64_t>() < low)
    refuse(place, "a whole number from " + std::to_string(low) + " to " + std::to_string(high) +
                      " is needed, not " + kind_of(value) + ".");
  return value.get<std::int64_t>();
}

}  // namespace palpate::session
