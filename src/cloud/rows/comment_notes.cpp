#include "cloud/rows/comment_notes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <string_view>

#include "cloud/rows/crs_units.h"
#include "cloud/rows/row_layout.h"
#include "core/crs_comment.h"
#include "core/group_comment.h"
#include "surfeit/length_unit.h"

namespace surfeit {
namespace {

// Longer ones are prose.
constexpr std::size_t kMostWords = 12;

// In lower case, between blanks and signs; numbers keep their points and signs.
std::vector<std::string> wordsOfComment(std::string_view comment) {
  std::vector<std::string> words(1);
  for (const char c : comment) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_of_word = std::isalnum(byte) != 0 || c == '.' || c == '-' || c == '+';
    if (is_of_word) {
      words.back() += static_cast<char>(std::tolower(byte));
    } else if (!words.back().empty()) {
      words.emplace_back();
    }
  }
  if (words.back().empty()) words.pop_back();
  return words;
}

bool isOneOf(std::string_view word, std::span<const std::string_view> words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

// Behind "unit" or "units"; nullptr where there is none.
const LengthUnit* unitOf(std::span<const std::string> words) {
  constexpr std::string_view kUnits[] = {"unit", "units"};
  const auto unit = std::find_if(words.begin(), words.end(),
                                 [&](const std::string& word) { return isOneOf(word, kUnits); });
  for (auto at = unit; at != words.end(); ++at) {
    if (*at == "in" && at + 1 != words.end()) continue;  // units in mm
    if (const LengthUnit* const known = findLengthUnit(*at)) return known;
  }
  return nullptr;
}

// Whether the words are a shift and three numbers behind it that are not all 0.
bool isShift(std::span<const std::string> words) {
  constexpr std::string_view kShifts[] = {"shift", "offset", "globalshift", "global_shift"};
  const auto shift = std::find_if(words.begin(), words.end(),
                                  [&](const std::string& word) { return isOneOf(word, kShifts); });
  if (words.end() - shift != 4) return false;
  bool is_zero = true;
  for (const std::string& word : words.last(3)) {
    double number = 0;
    const std::size_t sign = word.starts_with('+') ? 1 : 0;
    const auto [end, error] =
        std::from_chars(word.data() + sign, word.data() + word.size(), number);
    if (error != std::errc() || end != word.data() + word.size()) return false;
    is_zero = is_zero && number == 0;
  }
  return !is_zero;
}

}  // namespace

std::vector<std::string> notesOfComments(std::span<const std::string> comments) {
  std::vector<std::string> notes;
  for (const std::string& comment : comments) {
    if (statedGroupName(comment)) continue;
    if (comment.starts_with(kCrsComment)) {
      std::string note =
          noteOfCrsUnits(crsUnitsOfText(std::string_view(comment).substr(kCrsComment.size())));
      if (!note.empty()) notes.push_back(std::move(note));
      continue;
    }
    const std::vector<std::string> words = wordsOfComment(comment);
    if (words.size() > kMostWords) continue;
    if (const LengthUnit* const unit = unitOf(words); unit != nullptr && unit->metres != 1) {
      notes.push_back(fmt::format(
          "lengths are in {}, as the comment {} says, and stay so: convert --units {}:m "
          "scales them",
          unit->plural, quoteText(comment), unit->option));
    }
    if (isShift(words)) {
      notes.push_back(fmt::format(
          "the comment {} is not applied: positions stay as the file has them, and convert "
          "--transform moves them",
          quoteText(comment)));
    }
  }
  return notes;
}

}  // namespace surfeit
