#include "view/svg_document.h"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <string_view>

namespace surfeit {
namespace {

TEST(SvgDocument, WritesWhatIsAdded) {
  SvgDocument svg("t", 100, 50);
  svg.addText({10, 20}, "a<b", {.anchor = SvgDocument::Anchor::kEnd, .size = 9, .is_upward = true});
  svg.addLine({1, 2}, {3, 4.5}, "red", "5 4");
  svg.addRectangle({1, 2}, {4, 8}, "blue");
  svg.addCurve(std::array<SvgPoint, 2>{{{1, 2}, {3.25, 4}}}, "#123456");
  svg.addDot({7, 8}, "green");
  EXPECT_EQ(svg.encode(), R"svg(<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" width="100" height="50" viewBox="0 0 100 50">
<title>t</title>
<rect width="100" height="50" fill="white"/>
<text transform="translate(10.0 20.0) rotate(-90)" text-anchor="end" font-family="sans-serif" font-size="9" fill="black">a&lt;b</text>
<line x1="1.0" y1="2.0" x2="3.0" y2="4.5" stroke="red" stroke-dasharray="5 4"/>
<rect x="1.0" y="2.0" width="3.0" height="6.0" fill="none" stroke="blue"/>
<polyline fill="none" stroke="#123456" stroke-width="2" points="1.00,2.00 3.25,4.00 "/>
<circle cx="7.0" cy="8.0" r="4" stroke="white" fill="green"/>
</svg>
)svg");
}

// A file name may hold any bytes.
TEST(SvgDocument, TextsThatAreNoCharactersBecomeQuestionMarks) {
  const auto titleOf = [](std::string_view text) {
    const std::string svg = SvgDocument(text, 100, 50).encode();
    const std::size_t begin = svg.find("<title>") + 7;
    return svg.substr(begin, svg.find("</title>") - begin);
  };
  // 2, 3 and 4 bytes, the least and the most of each kind
  for (const char* text : {"\xc2\x80 \xdf\xbf", "\xe0\xa0\x80 \xef\xbf\xbd \xed\x9f\xbf",
                           "\xf0\x90\x80\x80 \xf4\x8f\xbf\xbf", "\xe2\x89\xa5 1"}) {
    EXPECT_EQ(titleOf(text), text);
  }
  EXPECT_EQ(titleOf(std::string_view("a\0b\x01\n", 5)), "a?b??");
  EXPECT_EQ(titleOf("\xff\x80 \xe2\x89"), "?? ??");       // no lead, cut off
  EXPECT_EQ(titleOf("\xe2\x89<"), "??&lt;");              // interrupted
  EXPECT_EQ(titleOf("\xc1\xbf \xe0\x9f\xbf"), "?? ???");  // longer than need be
  EXPECT_EQ(titleOf("\xed\xa0\x80"), "???");              // a surrogate
  EXPECT_EQ(titleOf("\xef\xbf\xbe"), "???");              // U+FFFE
  EXPECT_EQ(titleOf("\xf4\x90\x80\x80"), "????");         // beyond Unicode
}

}  // namespace
}  // namespace surfeit
