#include "palpate/visualization/chart.hpp"

#include "palpate/core/error.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>

namespace palpate::visualization {
namespace {

using Color = std::array<int, 3>;
constexpr Color black{0, 0, 0};
constexpr Color blue{0, 114, 178};

bool is(const core::Picture& picture, int x, int y, const Color& color) {
  const auto at = 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width_px) +
                       static_cast<std::size_t>(x));
  for (std::size_t channel = 0; channel < 3; ++channel)
    if (std::abs(static_cast<int>(picture.rgba[at + channel]) - color[channel]) > 40) return false;
  return true;
}

std::size_t count(const core::Picture& picture, const Color& color, int x0, int y0, int x1, int y1) {
  std::size_t found = 0;
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x)
      if (is(picture, x, y, color)) ++found;
  return found;
}

Chart rising() {
  Chart chart;
  chart.title = "Title";
  chart.x = {"Time (s)", false, {{0.0, 10.0}}};
  chart.y = {"x (mm)", false, {{0.0, 10.0}}};
  chart.series = {{"first", {0.0, 10.0}, {0.0, 10.0}, true, false, false, 1}};
  return chart;
}

using Labels = std::vector<std::string>;

TEST(ChartTicks, StandAtRoundNumbers) {
  EXPECT_EQ(chart_ticks(0.0, 4.0, false).labels,
            (Labels{"0.0", "0.5", "1.0", "1.5", "2.0", "2.5", "3.0", "3.5", "4.0"}));
  EXPECT_EQ(chart_ticks(-6.0, 8.0, false).labels, (Labels{"−6", "−4", "−2", "0", "2", "4", "6", "8"}));
  EXPECT_EQ(chart_ticks(0.0, 21000.0, false, 5).labels,
            (Labels{"0", "5000", "10\u2009000", "15\u2009000", "20\u2009000"}));
  EXPECT_EQ(chart_ticks(-0.012, 0.012, false, 4).labels, (Labels{"−0.01", "0.00", "0.01"}));
}

TEST(ChartTicks, StandAtPowersOfTenOnALogarithmicAxis) {
  EXPECT_EQ(chart_ticks(0.0008, 0.02, true).labels, (Labels{"0.001", "0.002", "0.005", "0.01", "0.02"}));
  EXPECT_EQ(chart_ticks(900.0, 2e6, true).labels, (Labels{"10³", "10⁴", "10⁵", "10⁶"}));
  EXPECT_EQ(chart_ticks(1e-12, 1.0, true, 6).labels,
            (Labels{"10⁻¹²", "10⁻¹⁰", "10⁻⁸", "10⁻⁶", "10⁻⁴", "10⁻²", "10⁰"}));
}

TEST(ChartTicks, StandAtRoundNumbersWhereALogarithmicAxisIsShort) {
  EXPECT_EQ(chart_ticks(14.5, 19.3, true).labels, (Labels{"15", "16", "17", "18", "19"}));
}

TEST(ChartTicks, RefuseWhatIsNoRange) {
  EXPECT_THROW(chart_ticks(1.0, 1.0, false), core::Error);
  EXPECT_THROW(chart_ticks(0.0, 1.0, true), core::Error);
}

TEST(Chart, DrawsALineWhereItsValuesAre) {
  const auto picture = draw_chart(rising(), {600, 400});
  ASSERT_EQ(picture.width_px, 600);
  ASSERT_EQ(picture.height_px, 400);
  ASSERT_EQ(picture.rgba.size(), 600U * 400U * 4U);
  EXPECT_TRUE(is(picture, 0, 0, {255, 255, 255}));
  EXPECT_TRUE(is(picture, 599, 399, {255, 255, 255}));
  // Half of 1200 x 800: the axes from (67, 352) to (578, 36).
  for (const double part : {0.1, 0.3, 0.5, 0.7, 0.9}) {
    const int x = static_cast<int>(67 + part * (578 - 67));
    const int y = static_cast<int>(352 - part * (352 - 36));
    EXPECT_GT(count(picture, blue, x - 3, y - 3, x + 4, y + 4), 4U) << part;
  }
  EXPECT_EQ(count(picture, blue, 80, 40, 250, 200), 0U) << "nothing above the line at the left";
  EXPECT_GT(count(picture, black, 250, 0, 400, 30), 50U) << "the title";
  EXPECT_GT(count(picture, black, 250, 370, 400, 400), 30U) << "the axis' title";
  EXPECT_GT(count(picture, black, 0, 150, 20, 250), 30U) << "the other axis' title";
}

TEST(Chart, DrawsTheSameTwice) {
  EXPECT_EQ(draw_chart(rising(), {400, 320}).rgba, draw_chart(rising(), {400, 320}).rgba);
}

TEST(Chart, LeavesOutWhatCannotBeShown) {
  Chart chart = rising();
  chart.y.logarithmic = true;
  chart.y.range = {{1.0, 10.0}};
  chart.series = {{"whole", {1.0, 3.0, 5.0, 9.0}, {2.0, std::nan(""), -1.0, 2.0}, true, false, false, 1}};
  const auto picture = draw_chart(chart, {600, 400});
  // From the first to the last that can be: level at log 2.
  const int y = static_cast<int>(352 - std::log10(2.0) * (352 - 36));
  EXPECT_GE(count(picture, blue, 300, y - 3, 340, y + 4), 40U) << "a row of pixels at the least";
}

TEST(Chart, BreaksADashedLineUp) {
  Chart chart = rising();
  chart.series.front().y = {5.0, 5.0};
  const auto whole = count(draw_chart(chart, {600, 400}), blue, 67, 180, 578, 210);
  chart.series.front().dashed = true;
  const auto dashed = count(draw_chart(chart, {600, 400}), blue, 67, 180, 578, 210);
  // 14 of 22 pixels are drawn.
  EXPECT_NEAR(static_cast<double>(dashed) / static_cast<double>(whole), 14.0 / 22.0, 0.08);
}

TEST(Chart, NamesItsSeriesInALegend) {
  Chart chart = rising();
  const auto one = count(draw_chart(chart, {600, 400}), black, 75, 40, 300, 100);
  chart.series.push_back({"second", {0.0, 10.0}, {0.0, 9.0}, true, true, false, {}});
  const auto two = count(draw_chart(chart, {600, 400}), black, 75, 40, 300, 100);
  EXPECT_EQ(one, 0U);
  EXPECT_GT(two, 30U) << "its words, in the upper left corner, where no line is";
}

TEST(Chart, RefusesWhatItCannotDraw) {
  Chart chart = rising();
  EXPECT_THROW(draw_chart(chart, {100, 100}), core::Error);
  chart.series.front().y.pop_back();
  EXPECT_THROW(draw_chart(chart), core::Error);
  chart = rising();
  chart.y.range.reset();
  chart.series.front().y = {std::nan(""), std::nan("")};
  EXPECT_THROW(draw_chart(chart), core::Error);
}

TEST(Chart, CanBeStopped) {
  const core::CancelToken cancel;
  cancel.cancel();
  EXPECT_THROW(draw_chart(rising(), {}, core::Progress({}, cancel)), core::Error);
}

}  // namespace
}  // namespace palpate::visualization
