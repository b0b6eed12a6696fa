#include "palpate/visualization/chart.hpp"

#include "offscreen.hpp"
#include "text_image.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Core>
#include <vtkAxis.h>
#include <vtkBrush.h>
#include <vtkChartXY.h>
#include <vtkContext2D.h>
#include <vtkContextActor.h>
#include <vtkContextItem.h>
#include <vtkContextScene.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkPen.h>
#include <vtkPlotLine.h>
#include <vtkPlotPoints.h>
#include <vtkRenderer.h>
#include <vtkStringArray.h>
#include <vtkTable.h>
#include <vtkTextProperty.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::visualization {
namespace {

/// Okabe and Ito's colours without their yellow, which is lost on white.
constexpr std::array<Rgba, 8> colors{{{0, 0, 0, 255},
                                      {0, 114, 178, 255},
                                      {213, 94, 0, 255},
                                      {0, 158, 115, 255},
                                      {204, 121, 167, 255},
                                      {230, 159, 0, 255},
                                      {86, 180, 233, 255},
                                      {110, 110, 110, 255}}};
constexpr std::array<int, 3> marker_styles{vtkPlotPoints::CIRCLE, vtkPlotPoints::SQUARE,
                                           vtkPlotPoints::DIAMOND};

/// Drawn so many times larger and averaged: smooth lines whatever the driver does.
constexpr int oversampling = 2;

constexpr double line_width = 3.4;  // in a picture of 1200 x 800
constexpr double marker_width = 15.0;

using Range = std::array<double, 2>;

/// A value's place along the axis that VTK sees; VTK is given logarithms, so
/// that range and marks are ours.
double along(const ChartAxis& axis, double value) { return axis.logarithmic ? std::log10(value) : value; }

bool can_show(const ChartAxis& axis, double value) {
  return std::isfinite(value) && (!axis.logarithmic || value > 0.0);
}

void check(const Chart& chart, const ChartSize& size) {
  for (const int px : {size.width_px, size.height_px})
    if (px < 320 || px > 4096)
      core::throw_usage("A chart of " + std::to_string(size.width_px) + "x" + std::to_string(size.height_px) +
                        " pixels was asked for; width and height must be 320 to 4096.");
  for (const auto& series : chart.series)
    if (series.x.size() != series.y.size())
      throw core::Error(core::ErrorKind::internal, "chart-series",
                        "The series " + series.name + " has " + std::to_string(series.x.size()) + " x and " +
                            std::to_string(series.y.size()) + " y.");
}

/// In the axis' own values.
Range range_of(const Chart& chart, bool of_x) {
  const ChartAxis& axis = of_x ? chart.x : chart.y;
  if (axis.range) return *axis.range;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const auto& series : chart.series)
    for (std::size_t n = 0; n < series.x.size(); ++n) {
      if (!can_show(chart.x, series.x[n]) || !can_show(chart.y, series.y[n])) continue;
      const double place = along(axis, of_x ? series.x[n] : series.y[n]);
      low = std::min(low, place);
      high = std::max(high, place);
    }
  if (!(high >= low))
    throw core::Error(core::ErrorKind::internal, "chart-empty",
                      "The chart \"" + chart.title + "\" has nothing to show.");
  // Values that begin near zero are shown from zero.
  const bool from_zero = !axis.logarithmic && low >= 0.0 && low <= 0.3 * high && high > 0.0;
  const double breadth = high > low ? high - low : std::max(1e-6, std::abs(high));
  const double air = 0.05 * breadth;
  low = from_zero ? 0.0 : low - air;
  high += air;
  return axis.logarithmic ? Range{std::pow(10.0, low), std::pow(10.0, high)} : Range{low, high};
}

void set_text(vtkTextProperty* property, int size_px, bool bold = false) {
  property->SetFontFamilyToArial();
  if (const std::string file = font_file(bold); !file.empty()) {
    property->SetFontFamily(VTK_FONT_FILE);
    property->SetFontFile(file.c_str());
  }
  property->SetFontSize(size_px);
  property->SetBold(bold ? 1 : 0);
  property->SetColor(0.0, 0.0, 0.0);
}

Rgba color_of(const Chart& chart, std::size_t series) {
  const auto number = static_cast<std::size_t>(chart.series[series].color.value_or(static_cast<int>(series)));
  return colors[number % colors.size()];
}
int marker_of(std::size_t series) { return marker_styles[series % marker_styles.size()]; }

/// Where things lie in the picture.
struct Frame {
  double unit = 1.0;  ///< pixels of this picture for one of a picture of 1200 x 800
  float left = 0.0F, bottom = 0.0F, width = 0.0F, height = 0.0F;
  Range x{}, y{};  ///< as VTK sees them

  float px(double at_1200_by_800) const { return static_cast<float>(at_1200_by_800 * unit); }
  Eigen::Vector2d pixel(double u, double v) const {
    return {static_cast<double>(width) * (u - x[0]) / (x[1] - x[0]),
            static_cast<double>(height) * (v - y[0]) / (y[1] - y[0])};
  }
};

/// Titles and legend. VTK's own lay the titles over the numbers and make the
/// markers of the legend too small to be told apart.
class ChartWords : public vtkContextItem {
 public:
  static ChartWords* New();
  vtkTypeMacro(ChartWords, vtkContextItem)

      void set(const Chart& chart, const Frame& frame) {
    chart_ = &chart;
    frame_ = &frame;
  }

  bool Paint(vtkContext2D* painter) override {
    const Frame& f = *frame_;
    text(painter, 28.0, true, VTK_TEXT_CENTERED, VTK_TEXT_TOP);
    painter->DrawString(f.left + f.width / 2.0F, f.bottom + f.height + f.px(52.0), chart_->title);
    text(painter, 26.0, false, VTK_TEXT_CENTERED, VTK_TEXT_BOTTOM);
    painter->DrawString(f.left + f.width / 2.0F, f.px(14.0), chart_->x.title);
    text(painter, 26.0, false, VTK_TEXT_CENTERED, VTK_TEXT_TOP);
    painter->GetTextProp()->SetOrientation(90.0);
    painter->DrawString(f.px(14.0), f.bottom + f.height / 2.0F, chart_->y.title);
    painter->GetTextProp()->SetOrientation(0.0);
    if (chart_->series.size() > 1) legend(painter);
    return true;
  }

 protected:
  ChartWords() = default;
  ~ChartWords() override = default;

 private:
  void text(vtkContext2D* painter, double size, bool bold, int horizontal, int vertical) const {
    set_text(painter->GetTextProp(), static_cast<int>(std::lround(size * frame_->unit)), bold);
    painter->GetTextProp()->SetJustification(horizontal);
    painter->GetTextProp()->SetVerticalJustification(vertical);
  }

  /// In the corner where the fewest values lie.
  void legend(vtkContext2D* painter) {
    const Frame& f = *frame_;
    text(painter, 22.0, false, VTK_TEXT_LEFT, VTK_TEXT_CENTERED);
    float widest = 0.0F;
    for (const auto& series : chart_->series) {
      std::array<float, 4> bounds{};
      painter->ComputeStringBounds(series.name, bounds.data());
      widest = std::max(widest, bounds[2]);
    }
    const float line = f.px(33.0);
    const float width = widest + f.px(98.0);
    const float height = line * static_cast<float>(chart_->series.size()) + f.px(14.0);
    const int corner = emptiest(width / f.width, height / f.height);
    const float gap = f.px(14.0);
    const float x = (corner & 1) != 0 ? f.left + f.width - width - gap : f.left + gap;
    const float y = (corner & 2) != 0 ? f.bottom + f.height - height - gap : f.bottom + gap;
    painter->GetBrush()->SetColor(255, 255, 255, 235);
    painter->GetPen()->SetLineType(vtkPen::SOLID_LINE);
    painter->GetPen()->SetColor(170, 170, 170, 255);
    painter->GetPen()->SetWidth(f.px(1.2));
    painter->DrawRect(x, y, width, height);
    for (std::size_t n = 0; n < chart_->series.size(); ++n)
      entry(painter, n, x + f.px(14.0), y + height - f.px(7.0) - line * (static_cast<float>(n) + 0.5F));
  }

  void entry(vtkContext2D* painter, std::size_t n, float x, float y) const {
    const ChartSeries& series = chart_->series[n];
    const Rgba color = color_of(*chart_, n);
    const float length = frame_->px(58.0);
    painter->GetPen()->SetColor(color.r, color.g, color.b, 255);
    painter->GetPen()->SetWidth(frame_->px(line_width));
    if (series.line && !series.dashed) painter->DrawLine(x, y, x + length, y);
    if (series.line && series.dashed)
      for (const double part : {0.0, 22.0, 44.0})
        painter->DrawLine(x + frame_->px(part), y, x + frame_->px(part + 14.0), y);
    if (series.markers) {
      std::array<float, 2> middle{x + length / 2.0F, y};
      painter->GetBrush()->SetColor(color.r, color.g, color.b, 255);
      painter->GetPen()->SetWidth(frame_->px(marker_width));
      painter->DrawMarkers(marker_of(n), false, middle.data(), 1);
    }
    painter->DrawString(x + length + frame_->px(14.0), y, series.name);
  }

  /// 1: at the right, 2: at the top.
  int emptiest(float width, float height) const {
    std::array<int, 4> crowd{};
    for (const auto& series : chart_->series)
      for (std::size_t n = 0; n < series.x.size(); ++n) {
        if (!can_show(chart_->x, series.x[n]) || !can_show(chart_->y, series.y[n])) continue;
        const Eigen::Vector2d at =
            frame_->pixel(along(chart_->x, series.x[n]), along(chart_->y, series.y[n]));
        const double u = at.x() / static_cast<double>(frame_->width);
        const double v = at.y() / static_cast<double>(frame_->height);
        for (int corner = 0; corner < 4; ++corner) {
          const double to_side = (corner & 1) != 0 ? 1.0 - u : u;
          const double to_end = (corner & 2) != 0 ? 1.0 - v : v;
          if (to_side > -0.01 && to_side < static_cast<double>(width) + 0.04 && to_end > -0.01 &&
              to_end < static_cast<double>(height) + 0.04)
            ++crowd[static_cast<std::size_t>(corner)];
        }
      }
    int best = 3;
    for (const int corner : {2, 1, 0})
      if (crowd[static_cast<std::size_t>(corner)] < crowd[static_cast<std::size_t>(best)]) best = corner;
    return best;
  }

  const Chart* chart_ = nullptr;
  const Frame* frame_ = nullptr;
};
vtkStandardNewMacro(ChartWords)

    using Line = std::vector<Eigen::Vector2d>;  ///< as VTK sees it; NaN between pieces

/// The pieces of a line that a pen leaves which is lifted now and then.
Line dashes_of(const Line& line, const Frame& frame) {
  const double period = static_cast<double>(frame.px(22.0));
  const double drawn = static_cast<double>(frame.px(14.0));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Line dashes;
  double walked = 0.0;  // pixels since the last dash began
  for (std::size_t n = 0; n + 1 < line.size(); ++n) {
    const double length =
        (frame.pixel(line[n + 1].x(), line[n + 1].y()) - frame.pixel(line[n].x(), line[n].y())).norm();
    double done = 0.0;
    while (done < length) {
      const bool down = walked < drawn;
      const double ends = std::min(length, done + (down ? drawn : period) - walked);
      if (down) {
        dashes.emplace_back(line[n] + done / length * (line[n + 1] - line[n]));
        dashes.emplace_back(line[n] + ends / length * (line[n + 1] - line[n]));
      } else {
        dashes.emplace_back(dashes.empty() ? line[n].x() : dashes.back().x(), nan);
      }
      walked += ends - done;
      if (walked >= period * (1.0 - 1e-12)) walked = 0.0;
      if (ends <= done) break;
      done = ends;
    }
  }
  return dashes;
}

/// The most letters that a mark of the axis has.
double longest_label(const ChartAxis& axis, const Range& range) {
  std::ptrdiff_t longest = 0;
  for (const auto& label : chart_ticks(range[0], range[1], axis.logarithmic).labels)
    longest = std::max(longest, std::count_if(label.begin(), label.end(), [](char byte) {
                         return (static_cast<unsigned char>(byte) & 0xC0U) != 0x80U;  // starts a letter
                       }));
  return static_cast<double>(longest);
}

class ChartDrawing {
 public:
  ChartDrawing(const Chart& chart, int width_px, int height_px) : chart_(chart) {
    frame_.unit = std::min(width_px / 1200.0, height_px / 800.0);
    const Range x = range_of(chart, true);
    const Range y = range_of(chart, false);
    frame_.x = {along(chart.x, x[0]), along(chart.x, x[1])};
    frame_.y = {along(chart.y, y[0]), along(chart.y, y[1])};
    frame_.left = frame_.px(std::max(134.0, 66.0 + 13.5 * longest_label(chart.y, y)));
    frame_.bottom = frame_.px(96.0);
    frame_.width = static_cast<float>(width_px) - frame_.left - frame_.px(44.0);
    frame_.height =
        static_cast<float>(height_px) - frame_.bottom - frame_.px(chart.title.empty() ? 30.0 : 72.0);
    plot_->SetAutoSize(false);
    plot_->SetLayoutStrategy(vtkChart::AXES_TO_RECT);
    plot_->SetSize(vtkRectf(frame_.left, frame_.bottom, frame_.width, frame_.height));
    plot_->SetInteractive(false);
    plot_->SetShowLegend(false);
    set_axis(vtkAxis::BOTTOM, chart.x, x, frame_.x, 9);
    set_axis(vtkAxis::LEFT, chart.y, y, frame_.y, 8);
    for (const int other : {vtkAxis::TOP, vtkAxis::RIGHT}) plot_->GetAxis(other)->SetVisible(false);
    for (std::size_t n = 0; n < chart.series.size(); ++n) add_series(n);
    words_->set(chart_, frame_);
    actor_->GetScene()->AddItem(plot_);
    actor_->GetScene()->AddItem(words_);
    renderer_->AddActor(actor_);
    renderer_->SetBackground(1.0, 1.0, 1.0);
  }
  ChartDrawing(const ChartDrawing&) = delete;
  ChartDrawing& operator=(const ChartDrawing&) = delete;

  vtkRenderer& renderer() const { return *renderer_; }

 private:
  void set_axis(int which, const ChartAxis& axis, const Range& range, const Range& seen, int most) {
    vtkAxis* drawn = plot_->GetAxis(which);
    drawn->SetBehavior(vtkAxis::FIXED);
    drawn->SetRange(seen[0], seen[1]);
    drawn->SetTitle("");
    set_text(drawn->GetLabelProperties(), static_cast<int>(std::lround(23.0 * frame_.unit)));
    const ChartTicks ticks = chart_ticks(range[0], range[1], axis.logarithmic, most);
    vtkNew<vtkDoubleArray> places;
    vtkNew<vtkStringArray> labels;
    for (std::size_t n = 0; n < ticks.places.size(); ++n) {
      places->InsertNextValue(along(axis, ticks.places[n]));
      labels->InsertNextValue(ticks.labels[n]);
    }
    drawn->SetCustomTickPositions(places, labels);
    drawn->GetPen()->SetColor(0, 0, 0);
    drawn->GetPen()->SetWidth(frame_.px(2.0));
    drawn->GetGridPen()->SetColor(225, 225, 225);
    drawn->GetGridPen()->SetWidth(frame_.px(1.2));
    drawn->SetTickLength(frame_.px(9.0));
    drawn->SetLabelOffset(frame_.px(14.0));
  }

  vtkPlot* add_plot(const Line& line, int kind, std::size_t series) {
    vtkNew<vtkDoubleArray> x;
    vtkNew<vtkDoubleArray> y;
    x->SetName("x");
    y->SetName("y");
    for (const auto& place : line) {
      x->InsertNextValue(place.x());
      y->InsertNextValue(place.y());
    }
    vtkNew<vtkTable> table;
    table->AddColumn(x);
    table->AddColumn(y);
    vtkPlot* plot = plot_->AddPlot(kind);
    plot->SetInputData(table, 0, 1);
    const Rgba color = color_of(chart_, series);
    plot->SetColor(color.r, color.g, color.b, 255);
    return plot;
  }

  void add_series(std::size_t n) {
    const ChartSeries& series = chart_.series[n];
    Line line;
    // Far beyond the picture a place has no pixel number.
    const double far = 50.0 * (frame_.y[1] - frame_.y[0]);
    for (std::size_t at = 0; at < series.x.size(); ++at)
      if (can_show(chart_.x, series.x[at]) && can_show(chart_.y, series.y[at]))
        line.emplace_back(along(chart_.x, series.x[at]),
                          std::clamp(along(chart_.y, series.y[at]), frame_.y[0] - far, frame_.y[1] + far));
    if (line.empty()) return;
    if (series.line) {
      vtkPlot* plot = add_plot(series.dashed ? dashes_of(line, frame_) : line, vtkChart::LINE, n);
      plot->SetWidth(frame_.px(line_width));
    }
    if (series.markers) {
      auto* points = vtkPlotPoints::SafeDownCast(add_plot(line, vtkChart::POINTS, n));
      points->SetMarkerStyle(marker_of(n));
      points->SetMarkerSize(frame_.px(marker_width));
    }
  }

  const Chart& chart_;
  Frame frame_;
  vtkNew<vtkChartXY> plot_;
  vtkNew<ChartWords> words_;
  vtkNew<vtkContextActor> actor_;
  vtkNew<vtkRenderer> renderer_;
};

/// Averages blocks of pixels; opaque, from bottom row first to top row first.
core::Picture reduced(const std::vector<std::uint8_t>& rgba, const ChartSize& size) {
  core::Picture picture;
  picture.width_px = size.width_px;
  picture.height_px = size.height_px;
  picture.rgba.reserve(static_cast<std::size_t>(size.width_px) * static_cast<std::size_t>(size.height_px) *
                       4);
  const int row = size.width_px * oversampling;
  for (int y = size.height_px - 1; y >= 0; --y)
    for (int x = 0; x < size.width_px; ++x) {
      std::array<int, 3> sum{};
      for (int dy = 0; dy < oversampling; ++dy)
        for (int dx = 0; dx < oversampling; ++dx) {
          const auto at = (static_cast<std::size_t>(y * oversampling + dy) * static_cast<std::size_t>(row) +
                           static_cast<std::size_t>(x * oversampling + dx)) *
                          4;
          for (std::size_t channel = 0; channel < 3; ++channel) sum[channel] += rgba[at + channel];
        }
      constexpr int count = oversampling * oversampling;
      for (const int channel : sum)
        picture.rgba.push_back(static_cast<std::uint8_t>((channel + count / 2) / count));
      picture.rgba.push_back(255);
    }
  return picture;
}

}  // namespace

core::Picture draw_chart(const Chart& chart, const ChartSize& size, const core::Progress& progress) {
  check(chart, size);
  core::Picture picture;
  progress.report(0.0, "Drawing");
  on_own_thread([&] {
    OffscreenCanvas canvas;
    {
      const int width = size.width_px * oversampling;
      const int height = size.height_px * oversampling;
      const ChartDrawing drawing(chart, width, height);
      picture = reduced(canvas.draw(drawing.renderer(), width, height), size);
    }
    canvas.release();
  });
  return picture;
}

}  // namespace palpate::visualization
