#include "surfeit/line_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "view/svg_document.h"

namespace surfeit {
namespace {

// In pixels of the document. A plot is a panel: title, legend, labels of markers, frame, ticks.
constexpr double kWidth = 860, kTitleHeight = 44, kPanelHeight = 440;
constexpr double kTitleY = 16, kLegendY = 40, kMarkersY = 64;  // from the top of the panel
constexpr double kLeft = 84, kRight = 825, kFrameTop = 104, kFrameBottom = 384;
constexpr int kMarkerRows = 3;
constexpr double kRowHeight = 16;
constexpr double kCharacterWidth = 6.7;  // of 12-pixel sans serif on average: to keep texts apart

// Told apart by those who are colour-blind too (Okabe and Ito, 2008).
constexpr std::array<const char*, 5> kColors = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                "#56b4e9"};
constexpr const char* kMarkerColor = "#555555";
constexpr const char* kGridColor = "#dddddd";

using Anchor = SvgDocument::Anchor;

// From values to pixels. Ranges are never empty, and above 0 on a logarithmic axis.
struct Axis {
  double least, most;
  bool is_logarithmic;
  double least_px, most_px;

  static bool canShow(double value, bool is_logarithmic) {
    return std::isfinite(value) && (!is_logarithmic || value > 0);
  }
  bool shows(double value) const { return value >= least && value <= most; }
  double px(double value) const {
    const double share =
        is_logarithmic ? (std::log(value) - std::log(least)) / (std::log(most) - std::log(least))
                       : (value - least) / (most - least);
    return least_px + share * (most_px - least_px);
  }
};

struct Range {
  double least = HUGE_VAL, most = -HUGE_VAL;
  bool isEmpty() const { return least > most; }
  void add(double value, bool is_logarithmic) {
    if (!Axis::canShow(value, is_logarithmic)) return;
    least = std::min(least, value);
    most = std::max(most, value);
  }
};

struct Tick {
  double value;
  std::string label;
};

std::string bytesLabel(double bytes) {
  constexpr std::array<const char*, 7> kUnits = {"B", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
  std::size_t unit = 0;
  for (; bytes >= 1024 && unit + 1 < kUnits.size(); ++unit) bytes /= 1024;
  return fmt::format("{:.4g} {}", bytes, kUnits[unit]);
}

// Powers of two, few enough that their labels have room.
std::vector<Tick> byteTicks(const Axis& axis) {
  constexpr double kMostTicks = 10;
  const double first = std::log2(axis.least), last = std::log2(axis.most);
  const double step = std::max(1.0, std::ceil((last - first) / kMostTicks));
  std::vector<Tick> ticks;
  for (double power = std::ceil(first / step) * step; power <= last; power += step) {
    ticks.push_back({std::exp2(power), bytesLabel(std::exp2(power))});
  }
  return ticks;
}

// The least of 1, 2 or 5 times a power of ten that divides a length into ten steps at most.
double linearStep(double length) {
  const double least = length / 10;
  const double power = std::pow(10, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= least * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

std::vector<Tick> valueTicks(const LinePlot& plot, const Axis& axis) {
  std::vector<Tick> ticks;
  const auto add = [&](double value) {
    ticks.push_back({value, fmt::format("{:g}{}", value, plot.value_unit)});
  };
  if (axis.is_logarithmic) {
    const long first = std::lround(std::log10(axis.least));
    const long last = std::lround(std::log10(axis.most));
    const long step = (last - first) / 10 + 1;
    for (long power = first; power <= last; power += step) add(std::pow(10, power));
  } else {
    const double step = linearStep(axis.most - axis.least);
    const long last = std::lround(axis.most / step);
    for (long count = std::lround(axis.least / step); count <= last; ++count) {
      add(double(count) * step);
    }
  }
  return ticks;
}

Axis bytesAxis(const LinePlot& plot) {
  Range range;
  for (const PlotSeries& series : plot.series) {
    for (const PlotPoint& point : series.points) range.add(point.bytes, true);
  }
  for (const PlotMarker& marker : plot.markers) range.add(marker.bytes, true);
  if (range.isEmpty()) range = {1, 1024};
  if (range.most < 2 * range.least) range = {range.least / 2, range.most * 2};
  return {range.least, range.most, true, kLeft, kRight};
}

// Begins and ends at a tick.
Axis valueAxis(const LinePlot& plot, double top) {
  Range range;
  for (const PlotSeries& series : plot.series) {
    for (const PlotPoint& point : series.points) range.add(point.value, plot.is_logarithmic);
  }
  if (plot.is_logarithmic) {
    if (range.isEmpty()) range = {0.1, 1};
    range.least = std::pow(10, std::floor(std::log10(range.least)));
    range.most = std::pow(10, std::ceil(std::log10(range.most)));
    if (range.least == range.most) range.least /= 10;
  } else {
    range.add(0, false);
    if (range.least == range.most) range.most = 1;
    const double step = linearStep(range.most - range.least);
    range.least = step * std::floor(range.least / step * (1 - 1e-9));
    range.most = step * std::ceil(range.most / step * (1 - 1e-9));
  }
  return {range.least, range.most, plot.is_logarithmic, top + kFrameBottom, top + kFrameTop};
}

void drawLegend(SvgDocument& svg, const LinePlot& plot, double y) {
  double x = kLeft;
  for (std::size_t index = 0; index < plot.series.size(); ++index) {
    const PlotSeries& series = plot.series[index];
    const char* color = kColors[index % kColors.size()];
    if (series.has_line) {
      svg.addCurve(std::array{SvgPoint{x, y - 4}, SvgPoint{x + 22, y - 4}}, color);
    } else {
      svg.addDot({x + 11, y - 4}, color);
    }
    svg.addText({x + 28, y}, series.label, {});
    x += 50 + kCharacterWidth * double(series.label.size());
  }
}

void drawFrame(SvgDocument& svg, const LinePlot& plot, const Axis& bytes, const Axis& value,
               double top) {
  const double bottom = top + kFrameBottom;
  for (const Tick& tick : byteTicks(bytes)) {
    const double x = bytes.px(tick.value);
    svg.addLine({x, top + kFrameTop}, {x, bottom}, kGridColor);
    svg.addText({x, bottom + 18}, tick.label, {.anchor = Anchor::kMiddle});
  }
  for (const Tick& tick : valueTicks(plot, value)) {
    const double y = value.px(tick.value);
    svg.addLine({kLeft, y}, {kRight, y}, kGridColor);
    svg.addText({kLeft - 8, y + 4}, tick.label, {.anchor = Anchor::kEnd});
  }
  svg.addRectangle({kLeft, top + kFrameTop}, {kRight, bottom}, "black");
  svg.addText({(kLeft + kRight) / 2, bottom + 38}, plot.bytes_label, {.anchor = Anchor::kMiddle});
  svg.addText({20, top + (kFrameTop + kFrameBottom) / 2}, plot.value_label,
              {.anchor = Anchor::kMiddle, .is_upward = true});
}

// Labels step down from marker to marker: each lies right of the lines before it and above those
// after it.
void drawMarkers(SvgDocument& svg, const LinePlot& plot, const Axis& bytes, double top) {
  int row = 0;
  for (const PlotMarker& marker : plot.markers) {
    if (!bytes.shows(marker.bytes)) continue;
    const double x = bytes.px(marker.bytes);
    const double y = top + kMarkersY + kRowHeight * row;
    svg.addLine({x, y - 10}, {x, top + kFrameBottom}, kMarkerColor, "5 4");
    const bool has_room = x + kCharacterWidth * double(marker.label.size()) < kWidth;
    svg.addText({has_room ? x + 5 : x - 5, y}, marker.label,
                {.anchor = has_room ? Anchor::kStart : Anchor::kEnd, .color = kMarkerColor});
    row = (row + 1) % kMarkerRows;
  }
}

void drawSeries(SvgDocument& svg, const PlotSeries& series, const char* color, const Axis& bytes,
                const Axis& value) {
  std::vector<SvgPoint> points;
  for (const PlotPoint& point : series.points) {
    if (!bytes.shows(point.bytes) || !value.shows(point.value)) continue;
    points.push_back({bytes.px(point.bytes), value.px(point.value)});
    if (!series.has_line) svg.addDot(points.back(), color);
  }
  if (series.has_line && !points.empty()) svg.addCurve(points, color);
}

void drawPlot(SvgDocument& svg, const LinePlot& plot, double top) {
  const Axis bytes = bytesAxis(plot), value = valueAxis(plot, top);
  svg.addText({kLeft, top + kTitleY}, plot.title, {.is_bold = true});
  drawLegend(svg, plot, top + kLegendY);
  drawFrame(svg, plot, bytes, value, top);
  drawMarkers(svg, plot, bytes, top);
  for (std::size_t index = 0; index < plot.series.size(); ++index) {
    drawSeries(svg, plot.series[index], kColors[index % kColors.size()], bytes, value);
  }
}

}  // namespace

std::string encodeSvg(std::string_view title, const std::vector<LinePlot>& plots) {
  SvgDocument svg(title, kWidth, kTitleHeight + kPanelHeight * double(plots.size()));
  svg.addText({kWidth / 2, 26}, title, {.anchor = Anchor::kMiddle, .size = 16});
  double top = kTitleHeight;
  for (const LinePlot& plot : plots) {
    drawPlot(svg, plot, top);
    top += kPanelHeight;
  }
  return svg.encode();
}

}  // namespace surfeit
