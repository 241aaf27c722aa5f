#include "cloud/ply/ply_positions.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/ply/ply_number.h"

namespace surfeit {
namespace {

constexpr std::size_t kSamples = 16, kSampleBytes = 16 << 10;

bool isFloatPosition(const RowProperty& property) {
  const std::string_view name = property.name;
  return property.type == ValueType::kFloat32 && !property.is_list &&
         (name == "x" || name == "y" || name == "z" || name == "X" || name == "Y" || name == "Z");
}

// Whether some position in the lines of a text needs more than a float. Lines that may be parts of
// lines are left out: the last one, and the first one where the text does not begin a line.
bool needsDoubles(std::string_view text, bool begins_line, const std::vector<bool>& is_position) {
  if (!begins_line) text.remove_prefix(std::min(text.size(), text.find_first_of("\r\n")));
  text = text.substr(0, text.find_last_of("\r\n") + 1);
  std::size_t column = 0;
  for (std::size_t at = 0; at < text.size();) {
    const char c = text[at];
    if (c == '\n' || c == '\r') column = 0;
    if (c == '\n' || c == '\r' || c == ' ' || c == '\t') {
      ++at;
      continue;
    }
    const std::size_t end = std::min(text.size(), text.find_first_of(" \t\r\n", at));
    if (column < is_position.size() && is_position[column] &&
        !floatHolds(text.substr(at, end - at))) {
      return true;
    }
    ++column;
    at = end;
  }
  return false;
}

}  // namespace

Status widenPositions(ByteInput& file, PlyHeader& header) {
  if (header.encoding != PlyEncoding::kAscii) return {};
  const auto element =
      std::find_if(header.elements.begin(), header.elements.end(), [](const RowLayout& each) {
        return !each.hasLists() &&
               std::any_of(each.properties.begin(), each.properties.end(), isFloatPosition);
      });
  if (element == header.elements.end() || element->count == 0) return {};
  std::vector<bool> is_position;
  for (const RowProperty& property : element->properties) {
    is_position.push_back(isFloatPosition(property));
  }

  const std::uint64_t begin = header.data_offset;
  const std::uint64_t data_bytes = file.size().value_or(begin) - begin;
  std::string text(kSampleBytes, '\0');
  for (std::size_t i = 0; i < kSamples; ++i) {
    const std::uint64_t at = begin + data_bytes / kSamples * i;
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t size,
                             file.readSome(at, std::as_writable_bytes(std::span(text))));
    if (needsDoubles(std::string_view(text).substr(0, size), i == 0, is_position)) {
      for (RowProperty& property : element->properties) {
        if (isFloatPosition(property)) property.type = ValueType::kFloat64;
      }
      packRow(*element);
      return {};
    }
    if (data_bytes <= kSampleBytes) break;
  }
  return {};
}

}  // namespace surfeit
