#pragma once

#include "palpate/core/picture.hpp"
#include "palpate/core/progress.hpp"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace palpate::visualization {

struct ChartAxis {
  std::string title;  ///< with its unit: "Time step (s)"
  bool logarithmic = false;
  /// What is shown; around all values where absent. What lies beyond is cut off.
  std::optional<std::array<double, 2>> range;
};

struct ChartSeries {
  std::string name;  ///< in the legend
  std::vector<double> x;
  std::vector<double> y;  ///< pairs that are not finite, or not above 0 on a logarithmic axis, are left out
  bool line = true;
  bool markers = true;
  bool dashed = false;
  /// Of the eight colours; series that belong together may share one. The
  /// series' place in the chart where absent.
  std::optional<int> color;
};

/// Curves over one pair of axes, as a journal prints them: black on white,
/// colours that colour-blind eyes keep apart (Okabe and Ito), a marker of its
/// own for each series.
struct Chart {
  std::string title;
  ChartAxis x;
  ChartAxis y;
  std::vector<ChartSeries> series;
};

struct ChartSize {
  int width_px = 1200;  ///< 320..4096
  int height_px = 800;
};

/// Draws offscreen as draw_picture does, by VTK's charts; text grows with the
/// picture. Throws Error(usage) for a size out of range, Error(internal) for
/// series of unequal lengths or a chart without a single value,
/// Error(internal, "no-renderer") where nothing can draw, Error(cancelled).
core::Picture draw_chart(const Chart& chart, const ChartSize& size = {}, const core::Progress& progress = {});

/// Where an axis from `low` to `high` is marked, and with which words: at
/// multiples of 1, 2 or 5 times a power of ten; on a logarithmic axis at
/// powers of ten, between which 2 and 5 are marked where there are few.
struct ChartTicks {
  std::vector<double> places;
  std::vector<std::string> labels;
};
ChartTicks chart_ticks(double low, double high, bool logarithmic, int most = 8);

}  // namespace palpate::visualization
