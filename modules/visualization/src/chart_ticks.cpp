#include "palpate/core/error.hpp"
#include "palpate/visualization/chart.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace palpate::visualization {
namespace {

std::string power_of_ten(int exponent) {
  static constexpr std::array<const char*, 10> digits{"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = "10";
  if (exponent < 0) text += "⁻";
  for (const char digit : std::to_string(std::abs(exponent)))
    text += digits[static_cast<std::size_t>(digit - '0')];
  return text;
}

/// With as many decimals as `step` needs; thousands apart from ten thousand on.
std::string plain(double value, double step) {
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, std::abs(value));
  std::string words = text;
  if (std::abs(value) >= 1e4 && decimals == 0)
    for (int place = static_cast<int>(words.size()) - 3; place > 0; place -= 3)
      words.insert(static_cast<std::size_t>(place), "\u2009");
  const bool is_zero = words.find_first_not_of("0.") == std::string::npos;
  return value < 0.0 && !is_zero ? "−" + words : words;
}

/// m times ten to the exponent, m being 1, 2 or 5.
std::string on_log_axis(int m, int exponent, bool written_out) {
  if (written_out) return plain(m * std::pow(10.0, exponent), std::pow(10.0, exponent));
  return (m == 1 ? "" : std::to_string(m) + "·") + power_of_ten(exponent);
}

ChartTicks linear_ticks(double low, double high, int most) {
  const double rough = (high - low) / most;
  const double decade = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * decade;
  for (const double m : {1.0, 2.0, 5.0})
    if (m * decade >= rough * (1.0 - 1e-9)) {
      step = m * decade;
      break;
    }
  ChartTicks ticks;
  const double slack = 1e-9 * (high - low);
  for (double n = std::ceil((low - slack) / step); n * step <= high + slack; n += 1.0) {
    ticks.places.push_back(n * step);
    ticks.labels.push_back(plain(n * step, step));
  }
  return ticks;
}

ChartTicks log_ticks(double low, double high, int most) {
  const double slack = 1e-9;
  const double decades = std::log10(high / low);
  // The whole powers alone, or every second, third ... of them, where there are many.
  const int every = std::max(1, static_cast<int>(std::ceil((decades + 1.0) / (most + 1.0))));
  std::vector<int> steps{1};
  const bool written_out = low >= 0.9e-4 && high < 1e5;  // all numbers of an axis alike
  if (decades * 3.0 <= most) steps = {1, 2, 5};
  ChartTicks ticks;
  for (int exponent = static_cast<int>(std::floor(std::log10(low))); exponent <= std::log10(high) + slack;
       ++exponent) {
    if (exponent % every != 0) continue;
    for (const int m : steps) {
      const double place = m * std::pow(10.0, exponent);
      if (place < low * (1.0 - slack) || place > high * (1.0 + slack)) continue;
      ticks.places.push_back(place);
      ticks.labels.push_back(on_log_axis(m, exponent, written_out));
    }
  }
  return ticks;
}

}  // namespace

ChartTicks chart_ticks(double low, double high, bool logarithmic, int most) {
  if (!(high > low) || !std::isfinite(high - low) || (logarithmic && !(low > 0.0)) || most < 1)
    throw core::Error(core::ErrorKind::internal, "chart-range", "An axis of a chart has no range.");
  if (logarithmic) {
    ChartTicks ticks = log_ticks(low, high, most);
    if (ticks.places.size() > 2) return ticks;  // else the axis spans too little for them
  }
  return linear_ticks(low, high, most);
}

}  // namespace palpate::visualization
