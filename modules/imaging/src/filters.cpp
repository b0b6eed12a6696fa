#include "palpate/imaging/filters.hpp"

#include "filter_steps.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string_view>
#include <utility>

namespace palpate::imaging {
namespace {

std::string number_text(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

std::string range_text(const FilterParameter& parameter) {
  return (parameter.whole_number ? "a whole number from " : "a number from ") + number_text(parameter.min) +
         " to " + number_text(parameter.max) + (parameter.unit.empty() ? "" : " " + parameter.unit);
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t n = 0; n < words.size(); ++n) {
    if (n > 0) text += n + 1 == words.size() ? " and " : ", ";
    text += words[n];
  }
  return text;
}

std::string names_of(const std::vector<FilterDescription>& all) {
  std::vector<std::string> names;
  for (const auto& filter : all) names.push_back(filter.name);
  return joined(names);
}

std::string names_of(const std::vector<FilterParameter>& all) {
  std::vector<std::string> names;
  for (const auto& parameter : all) names.push_back(parameter.name + " (" + range_text(parameter) + ")");
  return joined(names);
}

const FilterEntry& entry_of(const std::string& name) {
  const auto& all = filter_entries();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const auto& entry) { return entry.description.name == name; });
  if (found == all.end())
    core::throw_usage("There is no filter \"" + name + "\"; there are " + names_of(filters()) + ".");
  return *found;
}

/// "radius" stands for "radius_voxels": the name up to its unit.
bool names_parameter(const FilterParameter& parameter, const std::string& key) {
  return key == parameter.name || key == parameter.name.substr(0, parameter.name.rfind('_'));
}

const FilterParameter& parameter_of(const FilterDescription& filter, const std::string& key) {
  const auto found = std::find_if(filter.parameters.begin(), filter.parameters.end(),
                                  [&](const auto& parameter) { return names_parameter(parameter, key); });
  if (found == filter.parameters.end())
    core::throw_usage("The filter " + filter.name + " has no parameter \"" + key + "\"; it takes " +
                      names_of(filter.parameters) + ".");
  return *found;
}

void check_value(const FilterDescription& filter, const FilterParameter& parameter, double value) {
  const bool fits = std::isfinite(value) && value >= parameter.min && value <= parameter.max &&
                    (!parameter.whole_number || value == std::floor(value));
  if (!fits)
    core::throw_usage("The filter " + filter.name + " cannot take " + parameter.name + "=" +
                      number_text(value) + "; it must be " + range_text(parameter) + ".");
}

double parse_value(const FilterDescription& filter, const FilterParameter& parameter, std::string_view text) {
  double value = 0.0;
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, value);
  if (parsed.ec != std::errc() || parsed.ptr != end)
    core::throw_usage("The filter " + filter.name + " cannot take " + parameter.name + "=" +
                      std::string(text) + "; it must be " + range_text(parameter) + ".");
  check_value(filter, parameter, value);
  return value;
}

}  // namespace

FilterStep parse_filter(const std::string& text) {
  const auto colon = text.find(':');
  const FilterDescription& filter = entry_of(text.substr(0, colon)).description;
  FilterStep step{filter.name, {}};
  if (colon == std::string::npos) return step;
  std::size_t begin = colon + 1;
  while (true) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string assignment = text.substr(begin, end - begin);
    const auto equals = assignment.find('=');
    if (equals == std::string::npos)
      core::throw_usage("In the filter \"" + text + "\", \"" + assignment +
                        "\" is not of the form key=value; " + filter.name + " takes " +
                        names_of(filter.parameters) + ".");
    const FilterParameter& parameter = parameter_of(filter, assignment.substr(0, equals));
    const double value = parse_value(filter, parameter, std::string_view(assignment).substr(equals + 1));
    if (!step.parameters.emplace(parameter.name, value).second)
      core::throw_usage("In the filter \"" + text + "\", " + parameter.name + " is given twice.");
    if (end == text.size()) return step;
    begin = end + 1;
  }
}

std::string to_string(const FilterStep& step) {
  std::string text = step.name;
  char separator = ':';
  for (const auto& [name, value] : step.parameters) {
    text += separator + name + "=" + number_text(value);
    separator = ',';
  }
  return text;
}

PreparedStep prepare(const FilterStep& step) {
  const FilterEntry& entry = entry_of(step.name);
  const FilterDescription& filter = entry.description;
  FilterParameters complete;
  for (const auto& [key, value] : step.parameters) {
    const FilterParameter& parameter = parameter_of(filter, key);
    check_value(filter, parameter, value);
    if (!complete.emplace(parameter.name, value).second)
      core::throw_usage("The filter " + filter.name + " is given " + parameter.name + " twice.");
  }
  for (const auto& parameter : filter.parameters) complete.emplace(parameter.name, parameter.standard);
  return {&entry, std::move(complete)};
}

}  // namespace palpate::imaging
