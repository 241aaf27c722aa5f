#include "tools/frames.h"

#include <fmt/format.h>

#include <charconv>
#include <unordered_set>

namespace surfeit {
namespace {

// A place for the number of a frame: `length` characters of the name.
struct FramePlace {
  std::size_t length = 0;  // 0: none
  int width = 0;           // digits, filled with zeros
};

bool isDigit(char c) { return c >= '0' && c <= '9'; }
bool isLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

// %d, %04d. Blanks in names of files are nobody's wish, so %4d is none.
FramePlace percentPlace(std::string_view text) {
  std::size_t i = 1;
  int width = 0;
  if (i < text.size() && text[i] == '0') {
    for (++i; i < text.size() && i < 4 && isDigit(text[i]); ++i) width = 10 * width + text[i] - '0';
    if (width == 0) return {};
  }
  if (i >= text.size() || text[i] != 'd') return {};
  return {i + 1, width};
}

// $F, $F4. A letter or digit behind belongs to another variable, such as $FPS.
FramePlace variablePlace(std::string_view text) {
  if (text.size() < 2 || text[1] != 'F') return {};
  const bool has_width = text.size() > 2 && text[2] >= '1' && text[2] <= '9';
  const std::size_t length = has_width ? 3 : 2;
  if (text.size() > length && (isDigit(text[length]) || isLetter(text[length]))) return {};
  return {length, has_width ? text[2] - '0' : 0};
}

// The place that `text` begins with.
FramePlace placeAt(std::string_view text) {
  if (text[0] == '%') return percentPlace(text);
  if (text[0] == '$') return variablePlace(text);
  if (text[0] != '#') return {};
  const std::size_t count = std::min(text.find_first_not_of('#'), text.size());
  return {count, int(std::min<std::size_t>(count, 99))};
}

// Takes a number from the front of `text`; false where there is none.
bool takeNumber(std::string_view& text, int& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || number > kLargestFrame || number < -kLargestFrame) return false;
  text.remove_prefix(std::size_t(end - text.data()));
  return true;
}

bool takeCharacter(std::string_view& text, char c) {
  if (text.empty() || text[0] != c) return false;
  text.remove_prefix(1);
  return true;
}

struct FrameRange {
  int first = 0, last = 0, step = 1;
};

// "7", "1-240" or "1-240x2"
Result<FrameRange> parseRange(std::string_view text) {
  std::string_view rest = text;
  FrameRange range;
  bool ok = takeNumber(rest, range.first);
  range.last = range.first;
  if (ok && takeCharacter(rest, '-')) {
    ok = takeNumber(rest, range.last);
    if (ok && takeCharacter(rest, 'x')) ok = takeNumber(rest, range.step) && range.step > 0;
  }
  if (!ok || !rest.empty()) {
    return Status::invalidArgument(fmt::format(
        "found \"{}\", expected frames such as 1-240, 1-240x2 (every second) or 1,5,10-20", text));
  }
  if (range.last < range.first) {
    return Status::invalidArgument(fmt::format(
        "found \"{}\", expected the lower number first: {}-{}", text, range.last, range.first));
  }
  return range;
}

}  // namespace

std::string SequenceFrame::label() const {
  return fmt::format("frame {} ({} of {})", number, index, count);
}

Result<std::vector<int>> parseFrames(std::string_view text) {
  std::vector<int> frames;
  std::unordered_set<int> known;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    SURFEIT_ASSIGN_OR_RETURN(const FrameRange range, parseRange(text.substr(begin, end - begin)));
    for (int frame = range.first; frame <= range.last; frame += range.step) {
      if (known.insert(frame).second) frames.push_back(frame);
      if (frames.size() > kMostFrames) {
        return Status::invalidArgument(
            fmt::format("found \"{}\", more than {} frames: divide them", text, kMostFrames));
      }
    }
    begin = end + 1;
  }
  return frames;
}

std::string describeFrames(const std::vector<int>& frames) {
  std::string text;
  for (std::size_t begin = 0, end = 0; begin < frames.size(); begin = end) {
    end = begin + 1;
    while (end < frames.size() && frames[end] == frames[end - 1] + 1) ++end;
    text += fmt::format("{}{}", text.empty() ? "" : ",", frames[begin]);
    if (end - begin > 1) text += fmt::format("-{}", frames[end - 1]);
  }
  return text;
}

bool hasFramePattern(std::string_view name) {
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (placeAt(name.substr(i)).length > 0) return true;
  }
  return false;
}

std::string frameName(std::string_view name, int frame) {
  std::string result;
  for (std::size_t i = 0; i < name.size();) {
    const FramePlace place = placeAt(name.substr(i));
    if (place.length > 0) {
      result += fmt::format("{:0{}}", frame, place.width);
    } else {
      result += name[i];
    }
    i += std::max<std::size_t>(place.length, 1);
  }
  return result;
}

}  // namespace surfeit
