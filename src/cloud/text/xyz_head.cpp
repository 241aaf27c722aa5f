#include "cloud/text/xyz_head.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "cloud/rows/row_layout.h"
#include "cloud/text/text_rows.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxComments = 64;
// Well-known text of coordinate reference systems is long.
constexpr std::size_t kMaxCommentChars = 65535;

bool beginsWithNumbers(std::span<const std::string_view> words) {
  return words.size() >= 3 && std::all_of(words.begin(), words.begin() + 3, isTextNumber);
}

// Whether the line names columns nan, inf and the like, which are numbers elsewhere.
bool namesNumbers(std::string_view line) {
  const bool has_digits =
      std::any_of(line.begin(), line.end(), [](char c) { return c >= '0' && c <= '9'; });
  return !has_digits && !parseXyzHeader(line).file_names.empty();
}

// The line by which spreadsheets tell each other what parts values: "sep=;".
bool isSeparatorLine(std::string_view line) {
  if (line.starts_with('"') && line.ends_with('"') && line.size() > 1) {
    line = line.substr(1, line.size() - 2);
  }
  return line.size() <= 5 && (line.starts_with("sep=") || line.starts_with("SEP="));
}

std::string textOfComment(std::string_view line) {
  line = line.substr(0, kMaxCommentChars);
  while (line.starts_with('#') || line.starts_with('%') || line.starts_with('/')) {
    line.remove_prefix(1);
  }
  std::string text(trimmedLine(line));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' && c > '\0'; }, ' ');
  return text;
}

}  // namespace

// Three numbers, or numbers where the names have a position; quotes are passed over, and commas may
// stand before decimals.
bool XyzHead::isData(std::string_view line) const {
  std::string text(line);
  std::replace(text.begin(), text.end(), '"', ' ');
  if (isDataOf(wordsOf(text, kMaxXyzColumns + 1))) return true;
  if (isDataOf(wordsOf(withoutComment(text), kMaxXyzColumns + 1))) return true;
  std::replace(text.begin(), text.end(), ',', '.');
  return isDataOf(wordsOf(text, kMaxXyzColumns + 1));
}

bool XyzHead::isDataOf(std::span<const std::string_view> words) const {
  if (beginsWithNumbers(words)) return true;
  const auto numbers = std::count_if(words.begin(), words.end(), isTextNumber);
  if (takes_words_ && numbers >= 3) return true;
  if (!hasNames()) {
    return !other_names_.empty() && words.size() == other_names_.size() && numbers >= 3;
  }
  if (words.size() != header_.names.size()) return false;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& name = header_.names[i];
    if ((name == "x" || name == "y" || name == "z") && !isTextNumber(words[i])) return false;
  }
  return true;
}

XyzHead::Line XyzHead::take(std::string_view line) {
  line = trimmedLine(line);
  const bool is_empty = line.find_first_not_of(" \t,;|") == line.npos;
  if (is_empty || (isSeparatorLine(line) && !hasNames())) return Line::kHead;
  if (isTextComment(line)) {
    endNames();
    named_in_comment_ = true;
    last_comment_ = textOfComment(line);
    header_line_ = std::string(line.substr(0, kMaxCommentChars));
    header_ = parseXyzHeader(line);
    return Line::kHead;
  }
  if (isData(line) && !namesNumbers(line)) return Line::kData;
  if (hasNames() && !has_units_ && addUnits(line, header_)) {
    has_units_ = true;
    return Line::kHead;
  }
  if (isTextCount(line) && !has_count_) {
    has_count_ = true;
    for (const char c : line) count_ = count_ * 10 + static_cast<std::uint64_t>(c - '0');
    return Line::kHead;
  }
  XyzHeader header = parseXyzHeader(line);
  if (header.file_names.empty()) {
    // One line of words may name columns, if lines of as many values follow
    const std::vector<std::string_view> words = wordsOf(line, kMaxXyzColumns + 1);
    const bool has_numbers = std::any_of(words.begin(), words.end(), isTextNumber);
    if (hasNames() || !other_names_.empty() || words.size() < 3 || has_numbers) {
      return Line::kUnknown;
    }
    other_names_.assign(words.begin(), words.end());
    return Line::kHead;
  }
  if (hasNames() && !named_in_comment_) return Line::kUnknown;  // names of another table
  endNames();
  named_in_comment_ = false;
  header_line_ = std::string(line.substr(0, kMaxCommentChars));
  header_ = std::move(header);
  return Line::kHead;
}

void XyzHead::end(std::size_t column_count) {
  if (header_.file_names.empty()) endNames();
  if (column_count == 0 || header_.file_names.empty()) return;
  if (header_.file_names.size() != column_count) {
    XyzHeader other = parseXyzHeader(header_line_, column_count);
    if (other.file_names.size() == column_count) header_ = std::move(other);
  }
  if (!named_in_comment_ || header_.file_names.size() == column_count) {
    keepComment(textOfComment(trimmedLine(header_.comment)));
    return;
  }
  if (hasNames()) {
    note_ = fmt::format("the comment {} names {} columns, lines have {} values: it names none",
                        quoteText(last_comment_), header_.names.size(), column_count);
  }
  endNames();
}

// The last comment turned out to be one.
void XyzHead::endNames() {
  header_ = {};
  keepComment(std::move(last_comment_));
  last_comment_.clear();
}

void XyzHead::keepComment(std::string comment) {
  if (comment.empty()) return;
  if (comments_.size() < kMaxComments) {
    comments_.push_back(std::move(comment));
  } else {
    ++lost_comments_;
  }
}

}  // namespace surfeit
