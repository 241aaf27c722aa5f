// The pass over all rows of a text that tells what its columns are.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "cloud/ply/ply_number.h"
#include "cloud/text/xyz_header.h"
#include "cloud/text/xyz_layout.h"

namespace surfeit {
namespace {

bool isHexColor(std::string_view comment) {
  constexpr std::string_view kDigits = "0123456789abcdefABCDEF";
  return (comment.size() == 7 || comment.size() == 9) && comment.front() == '#' &&
         comment.find_first_not_of(kDigits, 1) == comment.npos;
}

constexpr int kFloatDigits = 6;    // so many are given back by every float
constexpr int kDoubleDigits = 15;  // and by every double

bool isShortNumber(std::string_view word) {
  int digits = 0;
  for (const char c : word) {
    if (c == 'e' || c == 'E') return false;
    digits += c >= '0' && c <= '9' ? 1 : 0;
  }
  return digits <= kFloatDigits;
}

// Whether a word is a whole number of more digits than the double that it became: it has others.
bool isRoundedWhole(std::string_view word, double value) {
  if (word.starts_with('-') || word.starts_with('+')) word.remove_prefix(1);
  constexpr double kMostExact = 9007199254740992;  // 2^53
  if (word.size() <= kDoubleDigits || std::abs(value) < kMostExact) return false;
  if (!std::all_of(word.begin(), word.end(), [](char c) { return c >= '0' && c <= '9'; })) {
    return false;
  }
  word.remove_prefix(std::min(word.find_first_not_of('0'), word.size()));
  return fmt::format("{:.0f}", std::abs(value)) != word;
}

class XyzScanner {
 public:
  XyzScanner(std::span<const TextColumn> columns, std::uint64_t pts_count)
      : columns_(columns), values_(columns.size()), counted_(pts_count) {
    table_.columns.resize(columns.size());
    table_.are_unit_vectors.assign(columns.size(), true);
    has_any_vector_.assign(columns.size(), false);
    table_.scan_count = pts_count > 0 ? 1 : 0;
  }

  // Takes the values of a line; false when it is not as the columns say.
  bool takeRow(std::string_view line) {
    const char* at = line.data();
    const char* const end = at + line.size();
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      while (at < end && isTextBlank(*at)) ++at;
      const bool has_comma = i > 0 && at < end && isTextComma(*at);
      if (has_comma) ++at;
      while (at < end && isTextBlank(*at)) ++at;
      const char* word_end = at;
      while (word_end < end && !isTextBlank(*word_end) && !isTextComma(*word_end)) ++word_end;
      if (word_end == at && !has_comma) return false;
      if (columns_[i].is_kept && !takeCell({at, word_end}, i)) return false;
      at = word_end;
    }
    while (at < end && (isTextBlank(*at) || isTextComma(*at))) ++at;
    if (at < end) {
      const std::string_view rest(at, static_cast<std::size_t>(end - at));
      if (at == line.data() || !isTextComment(rest)) return false;
      if (!isTextBlank(at[-1]) && !isTextComma(at[-1])) return false;
      ++table_.commented_rows;
      table_.colored_rows += isHexColor(rest) ? 1 : 0;
    }
    takeVectors();
    ++table_.row_count;
    ++rows_of_scan_;
    return true;
  }

  void takeCount(std::uint64_t count) {
    checkCount();
    ++table_.scan_count;
    counted_ = count;
    rows_of_scan_ = 0;
  }

  XyzTable finish() {
    checkCount();
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const bool is_triple = i + 3 <= columns_.size() && columns_[i].is_kept &&
                             columns_[i + 1].is_kept && columns_[i + 2].is_kept;
      table_.are_unit_vectors[i] = is_triple && has_any_vector_[i] && table_.are_unit_vectors[i];
      table_.columns[i].are_numbers = columns_[i].is_kept;
    }
    return std::move(table_);
  }

  std::uint64_t rowCount() const { return table_.row_count; }
  XyzTable& table() { return table_; }

 private:
  bool takeCell(std::string_view word, std::size_t i) {
    std::byte bytes[8];
    const char* const end = word.data() + word.size();
    if (!word.empty() && parseTextNumber(word.data(), end, ValueType::kFloat64, bytes) == end) {
      const double before = values_[i];
      std::memcpy(&values_[i], bytes, sizeof bytes);
      XyzColumn& column = table_.columns[i];
      column.counts_rows =
          column.counts_rows && (table_.row_count == 0 || values_[i] == before + 1);
      takeValue(word, values_[i], column);
      return true;
    }
    if (!columns_[i].takes_missing || !isMissingText(word)) return false;
    values_[i] = std::numeric_limits<double>::quiet_NaN();
    table_.columns[i].are_wholes = table_.columns[i].counts_rows = false;
    ++table_.columns[i].missing;
    return true;
  }

  static void takeValue(std::string_view word, double value, XyzColumn& column) {
    column.least = std::min(column.least, value);
    column.largest = std::max(column.largest, value);
    if (isRoundedWhole(word, value)) ++column.rounded;
    if (column.are_wholes) column.are_wholes = value == std::floor(value) && std::isfinite(value);
    if (column.are_floats && !isShortNumber(word)) column.are_floats = floatHolds(word);
  }

  void takeVectors() {
    for (std::size_t i = 3; i + 3 <= columns_.size(); ++i) {
      if (!table_.are_unit_vectors[i]) continue;
      const double square = values_[i] * values_[i] + values_[i + 1] * values_[i + 1] +
                            values_[i + 2] * values_[i + 2];
      // Points without a normal have zeros or nan
      if (square == 0 || std::isnan(square)) continue;
      has_any_vector_[i] = true;
      table_.are_unit_vectors[i] = std::abs(std::sqrt(square) - 1) <= 0.01;
    }
  }

  void checkCount() {
    if (table_.scan_count == 0 || counted_ == rows_of_scan_ || !table_.count_note.empty()) return;
    table_.count_note = fmt::format("scan {} counts {} points, {} follow: all that follow are read",
                                    table_.scan_count, counted_, rows_of_scan_);
  }

  std::span<const TextColumn> columns_;
  std::vector<double> values_;
  std::vector<bool> has_any_vector_;
  std::uint64_t counted_ = 0, rows_of_scan_ = 0;
  XyzTable table_;
};

std::uint64_t countOf(std::string_view word) {
  std::uint64_t count = 0;
  for (const char c : trimmedLine(word)) count = count * 10 + static_cast<std::uint64_t>(c - '0');
  return count;
}

}  // namespace

Result<XyzTable> scanXyz(LineSource& source, std::span<const TextColumn> columns, TextExtras extras,
                         std::uint64_t pts_count) {
  XyzScanner scanner(columns, pts_count);
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source.lines());
    if (lines.empty()) return scanner.finish();
    const char* at = lines.data();
    const char* const end = at + lines.size();
    std::uint64_t line_count = 0;
    while (at < end) {
      const void* const found = std::memchr(at, '\n', static_cast<std::size_t>(end - at));
      const char* const line_end = found ? static_cast<const char*>(found) : end;
      const std::string_view line(at, static_cast<std::size_t>(line_end - at));
      // Lines that hold no row are few, so they are looked at last
      const bool is_count = extras.has_counts && isTextCount(trimmedLine(line));
      if (is_count) {
        scanner.takeCount(countOf(line));
      } else if (scanner.takeRow(line)) {
        // Most lines are rows
      } else if (isTextExtra(line, extras)) {
        scanner.table().comment_lines += isTextComment(trimmedLine(line)) ? 1 : 0;
      } else {
        XyzTable table = scanner.finish();
        table.has_comma_in_refused = line.find(',') != line.npos;
        const std::vector<std::string_view> words = wordsOf(line, kMaxXyzColumns);
        const bool is_row = std::any_of(words.begin(), words.end(), isTextNumber);
        table.refusal = Status::corruption(fmt::format(
            "{}: row {} at line {}: {}{}", source.input().path(), table.row_count,
            source.lineNumber() + line_count, describeTextRow(line, columns),
            line.find('\0') != line.npos ? ": bytes of 0 are no text: was the file written whole?"
            : is_row                     ? ""
                                         : ": a # in front makes a comment of a line that is no "
                                           "row"));
        return table;
      }
      at = line_end + (found ? 1 : 0);
      ++line_count;
    }
    source.consume(lines.size(), line_count);
  }
}

}  // namespace surfeit
