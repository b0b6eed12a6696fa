#include "palpate/evaluation/result.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace palpate::evaluation {
namespace {

template <typename Named>
const Named& named(const std::vector<Named>& all, const std::string& name, const std::string& where) {
  const auto at = std::find_if(all.begin(), all.end(), [&](const Named& one) { return one.name == name; });
  if (at == all.end())
    throw core::Error(core::ErrorKind::internal, "no-such-name",
                      "There is no " + name + " in " + where + ".");
  return *at;
}

/// The same text whatever the locale.
std::string ten_digits(double value) {
  std::array<char, 40> text{};
  const auto result =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 10);
  return {text.data(), result.ptr};
}

}  // namespace

const Column& Table::column(const std::string& column_name) const {
  return named(columns, column_name, name);
}

const Finding& Result::finding(const std::string& finding_name) const {
  return named(findings, finding_name, name);
}

std::string to_csv(const Table& table) {
  std::string text;
  for (const auto& column : table.columns) {
    text += (&column == &table.columns.front() ? "" : ",") + column.name;
    if (!column.unit.empty()) text += " (" + column.unit + ")";
  }
  text += "\n";
  for (std::size_t row = 0; row < table.rows(); ++row) {
    for (const auto& column : table.columns) {
      if (&column != &table.columns.front()) text += ",";
      const double value = column.values.at(row);
      if (!std::isnan(value)) text += ten_digits(value);
    }
    text += "\n";
  }
  return text;
}

}  // namespace palpate::evaluation
