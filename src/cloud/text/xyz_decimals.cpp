#include "cloud/text/xyz_decimals.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "core/text_case.h"

namespace surfeit {
namespace {

constexpr std::size_t kFirstLines = 1000;
constexpr std::size_t kMostValues = 256;
constexpr std::string_view kChoice =
    "say which: --text decimal-comma, or --text decimal-point where commas part values";

std::size_t digitsAt(std::string_view text) {
  const auto end = std::find_if_not(text.begin(), text.end(), isDigit);
  return static_cast<std::size_t>(end - text.begin());
}

// A word between semicolons, tabs and blanks, read as a number with a decimal comma.
struct CommaNumber {
  bool is_number = false;
  bool groups_no_thousands = false;  // 0,725 and 1,5 and 1234,567
};

CommaNumber readCommaNumber(std::string_view word) {
  if (!word.empty() && (word[0] == '-' || word[0] == '+')) word.remove_prefix(1);
  const std::size_t whole = digitsAt(word);
  const bool begins_with_zero = word.starts_with('0');
  word.remove_prefix(whole);
  std::size_t fraction = 0;
  const bool has_comma = word.starts_with(',');
  if (has_comma) {
    word.remove_prefix(1);
    fraction = digitsAt(word);
    word.remove_prefix(fraction);
  }
  const bool has_exponent = word.size() > 1 && (word[0] == 'e' || word[0] == 'E');
  if (has_exponent) {
    word.remove_prefix(1);
    if (word[0] == '-' || word[0] == '+') word.remove_prefix(1);
    const std::size_t exponent = digitsAt(word);
    if (exponent == 0) return {};
    word.remove_prefix(exponent);
  }
  CommaNumber number;
  number.is_number = word.empty() && whole + fraction > 0 && (!has_comma || fraction > 0);
  number.groups_no_thousands =
      has_comma && (fraction != 3 || whole == 0 || whole > 3 || begins_with_zero || has_exponent);
  return number;
}

struct Judge {
  bool has_comma = false;
  bool has_mixed_gaps = false;  // commas, and others between values without one
  bool has_semicolon = false;
  bool are_comma_numbers = true;
  bool group_no_thousands = false;
  bool are_pairs = true;  // an even number of whole numbers between commas, six or more
  std::size_t second_digits = 0;
  bool do_seconds_vary = false;
  std::uint64_t line_count = 0;
  std::string example;

  void take(std::string_view line) {
    ++line_count;
    const bool has_comma_here = line.find(',') != line.npos;
    has_semicolon = has_semicolon || line.find(';') != line.npos;
    takeWords(line, has_comma_here);
    if (!has_comma_here) return;
    if (example.empty()) example = quoteText(line);
    has_comma = true;
    if (are_pairs) takePairs(line);
  }

 private:
  void takeWords(std::string_view line, bool has_comma_here) {
    std::size_t words = 0;
    bool ended_with_comma = true;
    while (!line.empty()) {
      const std::size_t size = std::min(line.find_first_of("; \t\r"), line.size());
      const std::string_view word = line.substr(0, size);
      line.remove_prefix(std::min(size + 1, line.size()));
      if (word.empty()) continue;
      const CommaNumber number = readCommaNumber(word);
      are_comma_numbers = are_comma_numbers && number.is_number;
      group_no_thousands = group_no_thousands || number.groups_no_thousands;
      if (has_comma_here && words > 0 && !ended_with_comma && !word.starts_with(',')) {
        has_mixed_gaps = true;
      }
      ended_with_comma = word.ends_with(',');
      ++words;
    }
    if (words < 3) are_comma_numbers = false;
  }

  // The second numbers of pairs have as many digits everywhere, or zeros in front, if they are
  // decimals.
  void takePairs(std::string_view line) {
    const std::vector<std::string_view> words = wordsOf(line, kMostValues);
    are_pairs = words.size() >= 6 && words.size() % 2 == 0;
    for (std::size_t i = 0; are_pairs && i < words.size(); ++i) {
      const std::string_view word = words[i];
      const std::size_t sign = word.starts_with('-') && i % 2 == 0 ? 1 : 0;
      are_pairs = isTextCount(word.substr(sign));
      if (i % 2 == 0) continue;
      if (second_digits == 0) second_digits = word.size();
      do_seconds_vary = do_seconds_vary || word.size() != second_digits;
    }
  }
};

Status severalReadings(const LineSource& source, const Judge& judge, std::string_view readings) {
  return Status::corruption(
      fmt::format("{}: found {}: {}; {}", source.input().path(), judge.example, readings, kChoice));
}

}  // namespace

Result<TextDecimals> judgeDecimals(LineSource& source, bool has_names, bool all_lines) {
  const std::uint64_t offset = source.offset(), line_number = source.lineNumber();
  Judge judge;
  for (bool is_settled = false; !is_settled;) {
    SURFEIT_ASSIGN_OR_RETURN(std::string_view lines, source.lines());
    if (lines.empty()) break;
    std::uint64_t line_count = 0;
    const std::size_t bytes = lines.size();
    while (!lines.empty()) {
      const std::size_t end = std::min(lines.find('\n'), lines.size());
      const std::string_view line = withoutComment(trimmedLine(lines.substr(0, end)));
      lines.remove_prefix(std::min(end + 1, lines.size()));
      ++line_count;
      if (line.empty() || isTextComment(line) || isTextCount(line)) continue;
      judge.take(line);
      // Few lines settle what parts values; whether commas group thousands, every line may
      is_settled = !all_lines && judge.line_count >= kFirstLines && !judge.has_mixed_gaps;
      if (is_settled) break;
    }
    if (!is_settled) source.consume(bytes, line_count);
  }
  source.jumpTo(offset, line_number);

  if (!judge.has_comma) return TextDecimals::kUnknown;
  if (!judge.has_mixed_gaps) {
    if (!has_names && judge.are_pairs && judge.second_digits >= 2 && !judge.do_seconds_vary &&
        judge.line_count > 1) {
      return severalReadings(
          source, judge,
          "values are whole numbers, or commas stand before decimals as well as between values; "
          "where they do, write the file with other separators");
    }
    return TextDecimals::kPoint;
  }
  if (!judge.are_comma_numbers) {
    return severalReadings(source, judge,
                           "commas stand beside other separators, and are neither decimal commas "
                           "in all lines nor the only separators; commas or points that group "
                           "thousands are not read");
  }
  if (!judge.group_no_thousands && !judge.has_semicolon) {
    return severalReadings(source, judge,
                           "either commas stand before decimals (1,234 is 1.234) or they group "
                           "thousands (1,234 is 1234), which is not read");
  }
  return TextDecimals::kComma;
}

}  // namespace surfeit
