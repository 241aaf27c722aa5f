// Writes SVG: lines, dots and texts, as text that every browser and converter understands.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace surfeit {

// In pixels from the top left corner.
struct SvgPoint {
  double x = 0, y = 0;
};

// One thread at a time. Later things are drawn over earlier ones. The same calls give the same
// bytes.
class SvgDocument {
 public:
  enum class Anchor { kStart, kMiddle, kEnd };

  // The part of a text at its position, and what it looks like.
  struct TextStyle {
    Anchor anchor = Anchor::kStart;
    std::string_view color = "black";
    double size = 12;
    bool is_bold = false;
    bool is_upward = false;  // turned to be read from below
  };

  // A white page. The title is what a browser calls it; it is not drawn.
  SvgDocument(std::string_view title, double width, double height);

  // Any bytes will do for a text: they are taken as UTF-8 and escaped, and what is no character, or
  // none that XML can hold, becomes a question mark. Colors and dashes are SVG's own words.
  void addText(SvgPoint at, std::string_view text, const TextStyle& style);
  void addLine(SvgPoint begin, SvgPoint end, std::string_view color,
               std::string_view dashes = "none");
  void addRectangle(SvgPoint least, SvgPoint most, std::string_view color);
  void addCurve(std::span<const SvgPoint> points, std::string_view color);  // thicker than a line
  void addDot(SvgPoint at, std::string_view color);

  // The whole file.
  std::string encode() const { return elements_ + "</svg>\n"; }

 private:
  std::string elements_;  // the first one still open
};

}  // namespace surfeit
