#include "view/svg_document.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace surfeit {
namespace {

// Length of the character that the text begins with; 0 when it does not begin with one in UTF-8, or
// with one that XML 1.0 does not allow (section 2.2).
std::size_t characterLength(std::string_view text) {
  constexpr std::array<std::uint32_t, 5> kLeast = {0, 0x20, 0x80, 0x800, 0x10000};
  const auto lead = static_cast<unsigned char>(text[0]);
  const std::size_t length = lead < 0x80   ? 1
                             : lead < 0xc0 ? 0
                             : lead < 0xe0 ? 2
                             : lead < 0xf0 ? 3
                             : lead < 0xf8 ? 4
                                           : 0;
  if (length == 0 || length > text.size()) return 0;
  std::uint32_t code = length == 1 ? lead : lead & (0x7fu >> length);
  for (const char next : text.substr(1, length - 1)) {
    const auto byte = static_cast<unsigned char>(next);
    if ((byte & 0xc0) != 0x80) return 0;
    code = code << 6 | (byte & 0x3f);
  }
  const bool is_surrogate = code >= 0xd800 && code < 0xe000;
  const bool is_allowed = code < 0x110000 && !is_surrogate && code != 0xfffe && code != 0xffff;
  return is_allowed && code >= kLeast[length] ? length : 0;
}

std::string escaped(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t length = characterLength(text);
    const std::string_view character = text.substr(0, length);
    if (character == "&") {
      result += "&amp;";
    } else if (character == "<") {
      result += "&lt;";
    } else if (character == ">") {
      result += "&gt;";
    } else {
      result += length == 0 ? "?" : character;
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return result;
}

std::string_view anchorName(SvgDocument::Anchor anchor) {
  switch (anchor) {
    case SvgDocument::Anchor::kStart:
      return "start";
    case SvgDocument::Anchor::kMiddle:
      return "middle";
    case SvgDocument::Anchor::kEnd:
      return "end";
  }
  return "";
}

}  // namespace

SvgDocument::SvgDocument(std::string_view title, double width, double height) {
  elements_ = fmt::format(
      R"(<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" width="{0:g}" height="{1:g}" viewBox="0 0 {0:g} {1:g}">
<title>{2}</title>
<rect width="{0:g}" height="{1:g}" fill="white"/>
)",
      width, height, escaped(title));
}

void SvgDocument::addText(SvgPoint at, std::string_view text, const TextStyle& style) {
  elements_ +=
      fmt::format(R"(<text transform="translate({:.1f} {:.1f}){}" text-anchor="{}" )", at.x, at.y,
                  style.is_upward ? " rotate(-90)" : "", anchorName(style.anchor));
  elements_ +=
      fmt::format(R"(font-family="sans-serif" font-size="{:g}"{} fill="{}">{}</text>)", style.size,
                  style.is_bold ? R"( font-weight="bold")" : "", style.color, escaped(text));
  elements_ += '\n';
}

void SvgDocument::addLine(SvgPoint begin, SvgPoint end, std::string_view color,
                          std::string_view dashes) {
  elements_ += fmt::format(R"(<line x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}" )", begin.x,
                           begin.y, end.x, end.y);
  elements_ += fmt::format(R"(stroke="{}" stroke-dasharray="{}"/>)", color, dashes);
  elements_ += '\n';
}

void SvgDocument::addRectangle(SvgPoint least, SvgPoint most, std::string_view color) {
  elements_ += fmt::format(R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" )",
                           least.x, least.y, most.x - least.x, most.y - least.y);
  elements_ += fmt::format(R"(fill="none" stroke="{}"/>)", color);
  elements_ += '\n';
}

void SvgDocument::addCurve(std::span<const SvgPoint> points, std::string_view color) {
  elements_ += fmt::format(R"(<polyline fill="none" stroke="{}" stroke-width="2" points=")", color);
  for (const SvgPoint& point : points) elements_ += fmt::format("{:.2f},{:.2f} ", point.x, point.y);
  elements_ += "\"/>\n";
}

void SvgDocument::addDot(SvgPoint at, std::string_view color) {
  elements_ += fmt::format(R"(<circle cx="{:.1f}" cy="{:.1f}" r="4" stroke="white" fill="{}"/>)",
                           at.x, at.y, color);
  elements_ += '\n';
}

}  // namespace surfeit
