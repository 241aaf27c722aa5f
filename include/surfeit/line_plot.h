// Line plots as SVG: measured and predicted quantities against a size in bytes, such as those of
// surfeit/tune.h. Needs the component `view`. Safe from any thread.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "surfeit/api.h"

namespace surfeit {

// A size and what was found for it.
struct PlotPoint {
  double bytes = 0;
  double value = 0;
};

struct PlotSeries {
  std::string label;              // in the legend
  std::vector<PlotPoint> points;  // in rising order of bytes where a line joins them
  bool has_line = true;           // a line, for what is predicted; else dots, for what is measured
};

// A vertical line at a size of note.
struct PlotMarker {
  std::string label;  // beside the line
  double bytes = 0;
};

// Sizes go along a logarithmic axis. Values do too when `is_logarithmic`; else their axis includes
// 0.
struct LinePlot {
  std::string title;
  std::string bytes_label;  // of the axis; the ticks carry the units
  std::string value_label;
  std::string value_unit;  // appended to every tick, such as "%"
  bool is_logarithmic = false;
  std::vector<PlotSeries> series;
  std::vector<PlotMarker> markers;  // in rising order of bytes
};

// One SVG document with the plots below each other. Texts may be any bytes: they are taken as
// UTF-8. The same plots give the same bytes. Points and markers that an axis cannot show are left
// out: those not finite, and on logarithmic axes those not above 0.
SURFEIT_API std::string encodeSvg(std::string_view title, const std::vector<LinePlot>& plots);

}  // namespace surfeit
