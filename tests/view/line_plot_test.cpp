#include "surfeit/line_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

namespace surfeit {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kMiB = 1 << 20;

LinePlot testPlot() {
  LinePlot plot;
  plot.title = "Surfel pages";
  plot.bytes_label = "cache size";
  plot.value_label = "miss ratio";
  plot.value_unit = "%";
  plot.is_logarithmic = true;
  PlotSeries predicted{"predicted", {}, true};
  for (double mib = 1; mib <= 4096; mib *= 2) {
    predicted.points.push_back({mib * kMiB, 60 / (1 + mib / 8) - 0.1});
  }
  plot.series = {predicted, {"measured", {{16 * kMiB, 21}, {256 * kMiB, 1.7}}, false}};
  plot.markers = {{"knee", 300 * kMiB}, {"recommended --memory", 512 * kMiB}};
  return plot;
}

std::size_t countOf(const std::string& text, std::string_view wanted) {
  std::size_t count = 0;
  for (std::size_t at = text.find(wanted); at != std::string::npos;
       at = text.find(wanted, at + 1)) {
    ++count;
  }
  return count;
}

// The number of the first attribute of that name after `at`.
double attributeAfter(const std::string& svg, std::size_t at, const std::string& name) {
  const std::string start = " " + name + "=\"";
  return std::strtod(svg.c_str() + svg.find(start, at) + start.size(), nullptr);
}

// Fails unless every element is closed in order and every attribute is quoted. Enough XML for what
// an encoder can get wrong.
void expectWellFormed(const std::string& xml) {
  std::vector<std::string> open;
  std::size_t at = xml.find("?>");
  ASSERT_NE(at, std::string::npos);
  for (at += 2; at < xml.size();) {
    const std::size_t begin = xml.find('<', at);
    const std::string text = xml.substr(at, begin - at);
    EXPECT_EQ(text.find('>'), std::string::npos) << text;
    for (std::size_t i = text.find('&'); i != std::string::npos; i = text.find('&', i + 1)) {
      const std::string entity = text.substr(i, text.find(';', i) - i);
      EXPECT_THAT(entity, ::testing::AnyOf("&amp", "&lt", "&gt", "&quot"));
    }
    if (begin == std::string::npos) break;
    const std::size_t end = xml.find('>', begin);
    ASSERT_NE(end, std::string::npos);
    const std::string tag = xml.substr(begin + 1, end - begin - 1);
    ASSERT_EQ(tag.find('<'), std::string::npos) << tag;
    EXPECT_EQ(countOf(tag, "\"") % 2, 0u) << tag;
    EXPECT_EQ(countOf(tag, "=\""), countOf(tag, "\"") / 2) << tag;
    if (tag[0] == '/') {
      ASSERT_FALSE(open.empty());
      EXPECT_EQ(open.back(), tag.substr(1));
      open.pop_back();
    } else if (tag.back() != '/') {
      open.push_back(tag.substr(0, tag.find(' ')));
    }
    at = end + 1;
  }
  EXPECT_TRUE(open.empty());
}

TEST(LinePlot, ShowsAllThatItWasGiven) {
  const std::vector<LinePlot> plots = {testPlot(), testPlot()};
  const std::string svg = encodeSvg("cathedral.sft", plots);
  expectWellFormed(svg);
  for (const char* text :
       {"cathedral.sft", "Surfel pages", "cache size", "miss ratio", "predicted", "measured",
        "knee", "recommended --memory", ">64 MiB<", ">4 GiB<", ">0.01%<", ">10%<", ">100%<"}) {
    EXPECT_THAT(svg, HasSubstr(text));
  }
  EXPECT_EQ(countOf(svg, "<polyline"), 4u);  // a curve and one in the legend, each twice
  EXPECT_EQ(countOf(svg, "<circle"), 6u);    // two dots and one in the legend, each twice
  EXPECT_EQ(countOf(svg, "stroke-dasharray=\"5 4\""), 4u);
}

TEST(LinePlot, SamePlotsGiveSameBytes) {
  const std::vector<LinePlot> plots = {testPlot()};
  EXPECT_EQ(encodeSvg("a", plots), encodeSvg("a", plots));
}

TEST(LinePlot, DotsLieWhereTheTicksSay) {
  LinePlot plot;
  plot.value_unit = "%";
  plot.series = {{"hit rate", {{1, 0}, {32, 50}, {1024, 100}}, false}};
  const std::string svg = encodeSvg("", std::vector{plot});
  const std::size_t legend = svg.find("<circle"), first = svg.find("<circle", legend + 1);
  const std::size_t second = svg.find("<circle", first + 1);
  const std::size_t third = svg.find("<circle", second + 1);
  EXPECT_NEAR(attributeAfter(svg, second, "cx"),
              (attributeAfter(svg, first, "cx") + attributeAfter(svg, third, "cx")) / 2, 0.1);
  EXPECT_NEAR(attributeAfter(svg, second, "cy"),
              (attributeAfter(svg, first, "cy") + attributeAfter(svg, third, "cy")) / 2, 0.1);
  EXPECT_GT(attributeAfter(svg, first, "cy"), attributeAfter(svg, third, "cy"));

  // A label is written 4 below its line
  const std::string translate = "translate(76.0 ";
  const std::size_t label = svg.rfind(translate, svg.find(">100%<"));
  EXPECT_NEAR(std::strtod(svg.c_str() + label + translate.size(), nullptr),
              attributeAfter(svg, third, "cy") + 4, 0.1);
}

TEST(LinePlot, TextsAreEscaped) {
  LinePlot plot = testPlot();
  plot.title = "<b>\"R&D\"</b>";
  plot.series[0].label = "a < b & c";
  plot.markers[0].label = "]]> &";
  const std::string svg = encodeSvg("A&B <.sft>", std::vector{plot});
  expectWellFormed(svg);
  EXPECT_THAT(svg, HasSubstr("&lt;b&gt;\"R&amp;D\"&lt;/b&gt;"));
  EXPECT_THAT(svg, HasSubstr("a &lt; b &amp; c"));
  EXPECT_THAT(svg, HasSubstr("]]&gt; &amp;"));
  EXPECT_THAT(svg, HasSubstr("<title>A&amp;B &lt;.sft&gt;</title>"));
}

TEST(LinePlot, LeavesOutWhatAnAxisCannotShow) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  LinePlot plot = testPlot();
  plot.series[0].points = {{0, 1}, {kMiB, 0}, {kMiB, kNan}, {kInfinity, 1}, {-1, 1}, {kMiB, -2}};
  plot.series[1].points = {{kMiB, 1}, {2 * kMiB, kInfinity}};
  plot.markers = {{"nowhere", 0}, {"never", kNan}};
  const std::string svg = encodeSvg("", std::vector{plot});
  expectWellFormed(svg);
  EXPECT_EQ(countOf(svg, "<polyline"), 1u);  // in the legend only
  EXPECT_EQ(countOf(svg, "<circle"), 2u);
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
  EXPECT_THAT(svg, Not(HasSubstr("nowhere")));
}

TEST(LinePlot, PlotsWithoutPointsOrWithOneAreDrawn) {
  for (const bool is_logarithmic : {false, true}) {
    LinePlot plot;
    plot.is_logarithmic = is_logarithmic;
    for (const std::vector<PlotPoint>& points :
         {std::vector<PlotPoint>{}, std::vector<PlotPoint>{{kMiB, 0}},
          std::vector<PlotPoint>{{kMiB, 1}}, std::vector<PlotPoint>{{1, 1e-300}, {1e18, 1e300}}}) {
      plot.series = {{"one", points, true}, {"two", points, false}};
      const std::string svg = encodeSvg("", std::vector{plot});
      expectWellFormed(svg);
      EXPECT_THAT(svg, Not(HasSubstr("nan")));
      EXPECT_THAT(svg, Not(HasSubstr("inf")));
      EXPECT_LT(countOf(svg, "<text"), 60u);
    }
  }
  expectWellFormed(encodeSvg("", {}));
}

}  // namespace
}  // namespace surfeit
