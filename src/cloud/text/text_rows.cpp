#include "cloud/text/text_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <type_traits>

#include "cloud/ply/ply_number.h"
#include "core/text_case.h"

namespace surfeit {
namespace {

constexpr bool endsWord(char c) { return isTextBlank(c) || isTextComma(c); }

const char* skipBlanks(const char* at, const char* end) {
  while (at < end && isTextBlank(*at)) ++at;
  return at;
}

const char* skipWord(const char* at, const char* end) {
  while (at < end && !endsWord(*at)) ++at;
  return at;
}

// Any number, by the rules of ascii PLY.
const char* parseAnyNumber(const char* at, const char* end, ValueType type, std::byte* out) {
  const char* const word_end = skipWord(at, end);
  const std::string_view word(at, static_cast<std::size_t>(word_end - at));
  return parsePlyNumber(word, type, out) ? word_end : nullptr;
}

// Powers of ten that are doubles.
constexpr double kTens[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                            1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
constexpr int kMostTens = 22;

// Digits taken together, with the sign and the power of ten that they are to be multiplied with.
struct Decimal {
  std::uint64_t digits = 0;
  int tens = 0;
  bool is_negative = false;
};

// Takes a number of up to 18 digits apart; nullptr for any other word.
const char* takeDecimal(const char* at, const char* end, Decimal& decimal) {
  decimal.is_negative = *at == '-';
  if (decimal.is_negative) ++at;
  const char* const whole = at;
  std::uint64_t digits = 0;
  while (at < end && isDigit(*at)) digits = digits * 10 + static_cast<std::uint64_t>(*at++ - '0');
  std::ptrdiff_t digit_count = at - whole;
  if (at < end && *at == '.') {
    const char* const fraction = ++at;
    while (at < end && isDigit(*at)) digits = digits * 10 + static_cast<std::uint64_t>(*at++ - '0');
    decimal.tens = -static_cast<int>(std::min<std::ptrdiff_t>(at - fraction, 1000));
    digit_count += at - fraction;
  }
  if (digit_count == 0 || digit_count > 18) return nullptr;
  decimal.digits = digits;
  if (at < end && (*at == 'e' || *at == 'E')) {
    if (++at < end && *at == '+' && at + 1 < end && at[1] != '-') ++at;
    int exponent = 0;
    const auto [exponent_end, error] = std::from_chars(at, end, exponent);
    if (error != std::errc{} || exponent < -1000 || exponent > 1000) return nullptr;
    decimal.tens += exponent;
    at = exponent_end;
  }
  return at;
}

// Most numbers of a cloud have few digits: those that are whole numbers below 2^53, times or
// divided by a power of ten that is a double, are rounded once, so the result is the nearest double
// (Clinger 1990). For floats it is rounded a second time, which is wrong only when the double is
// half way between two floats. All others go the long way; so do results near the ends of floats.
template <typename T>
const char* parseReal(const char* at, const char* end, ValueType type, std::byte* out) {
  Decimal decimal;
  const char* const number_end = at < end ? takeDecimal(at, end, decimal) : nullptr;
  // 1.5D+00 and 1.#QNAN go on
  const bool goes_on = number_end != nullptr && number_end < end &&
                       (*number_end == 'D' || *number_end == 'd' || *number_end == '#');
  if (number_end == nullptr || goes_on || decimal.digits > (std::uint64_t{1} << 53) ||
      decimal.tens < -kMostTens || decimal.tens > kMostTens) {
    return parseAnyNumber(at, end, type, out);
  }
  auto wide = static_cast<double>(decimal.digits);
  wide = decimal.tens < 0 ? wide / kTens[-decimal.tens] : wide * kTens[decimal.tens];
  if constexpr (std::is_same_v<T, float>) {
    constexpr std::uint64_t kBelowFloat = (std::uint64_t{1} << 29) - 1;
    const bool is_half_way =
        (std::bit_cast<std::uint64_t>(wide) & kBelowFloat) == (kBelowFloat + 1) / 2;
    if (is_half_way || (wide < 1e-37 && decimal.digits != 0)) {
      return parseAnyNumber(at, end, type, out);
    }
  }
  const T value = static_cast<T>(decimal.is_negative ? -wide : wide);
  std::memcpy(out, &value, sizeof value);
  return number_end;
}

template <typename T>
const char* parseInteger(const char* at, const char* end, ValueType type, std::byte* out) {
  T value = 0;
  const auto [number_end, error] = std::from_chars(at, end, value);
  if (error != std::errc{}) return parseAnyNumber(at, end, type, out);
  std::memcpy(out, &value, sizeof value);
  const char* value_end = number_end;
  if (value_end < end && *value_end == '.') {
    do ++value_end;
    while (value_end < end && *value_end == '0');
  }
  return value_end;
}

// Stores nan where the cell may lack a value and does.
bool storeMissing(const TextColumn& column, std::string_view word, bool has_comma, std::byte* row) {
  if (!column.takes_missing || !isMissingText(word) || (word.empty() && !has_comma)) return false;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  if (column.type == ValueType::kFloat64) {
    std::memcpy(row + column.offset, &kNan, sizeof kNan);
  } else {
    const auto nan = static_cast<float>(kNan);
    std::memcpy(row + column.offset, &nan, sizeof nan);
  }
  return true;
}

std::string_view withoutEnd(std::string_view lines, std::size_t& bytes) {
  const void* const end = std::memchr(lines.data(), '\n', lines.size());
  const std::size_t size =
      end ? static_cast<std::size_t>(static_cast<const char*>(end) - lines.data()) : lines.size();
  bytes = size + (end ? 1 : 0);
  return lines.substr(0, size);
}

}  // namespace

const char* parseTextNumber(const char* at, const char* end, ValueType type, std::byte* out) {
  return visitValueType(type, [=]<typename T>(std::type_identity<T>) {
    if constexpr (std::is_integral_v<T>)
      return parseInteger<T>(at, end, type, out);
    else
      return parseReal<T>(at, end, type, out);
  });
}

bool isTextNumber(std::string_view word) {
  std::byte value[8];
  return parsePlyNumber(word, ValueType::kFloat64, value);
}

bool isMissingText(std::string_view word) {
  constexpr std::string_view kMissing[] = {"", "-", "na", "n/a", "null", "none", "#n/a"};
  std::string lower(word.substr(0, 5));
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::find(std::begin(kMissing), std::end(kMissing), lower) != std::end(kMissing);
}

bool isTextCount(std::string_view word) {
  return !word.empty() && word.size() <= 18 && std::all_of(word.begin(), word.end(), isDigit);
}

std::string_view trimmedLine(std::string_view line) {
  while (!line.empty() && (isTextBlank(line.back()) || line.back() == '\n')) line.remove_suffix(1);
  while (!line.empty() && isTextBlank(line.front())) line.remove_prefix(1);
  return line;
}

bool isTextComment(std::string_view line) {
  return line.starts_with('#') || line.starts_with('%') || line.starts_with("//");
}

std::string_view withoutComment(std::string_view line) {
  for (std::size_t i = 1; i < line.size(); ++i) {
    if (endsWord(line[i - 1]) && isTextComment(line.substr(i)))
      return trimmedLine(line.substr(0, i));
  }
  return line;
}

std::vector<std::string_view> wordsOf(std::string_view line, std::size_t most) {
  std::vector<std::string_view> words;
  const char* at = line.data();
  const char* const end = at + line.size();
  at = skipBlanks(at, end);
  while (at < end && words.size() < most) {
    const char* const word_end = skipWord(at, end);
    words.emplace_back(at, static_cast<std::size_t>(word_end - at));
    at = skipBlanks(word_end, end);
    if (at < end && isTextComma(*at)) at = skipBlanks(at + 1, end);
  }
  return words;
}

void LineSource::jumpTo(std::uint64_t offset, std::uint64_t line_number) {
  // What follows in the buffer is kept: a small file is read once
  const std::uint64_t buffer_offset = offset_ - begin_;
  if (offset >= buffer_offset && offset - buffer_offset < lines_end_) {
    begin_ = static_cast<std::size_t>(offset - buffer_offset);
  } else {
    begin_ = lines_end_ = end_ = 0;
  }
  offset_ = offset;
  line_number_ = line_number;
}

Result<std::string_view> LineSource::lines() {
  if (begin_ == lines_end_) {
    // The begin of a line that was read already goes to the front
    const std::size_t rest = end_ - begin_;
    if (rest > 0) std::memmove(buffer_.data(), buffer_.data() + begin_, rest);
    begin_ = 0;
    SURFEIT_ASSIGN_OR_RETURN(
        const std::size_t got,
        input_.readSome(offset_ + rest, std::as_writable_bytes(std::span(buffer_).subspan(rest))));
    end_ = rest + got;
    adapt(rest);
    const std::string_view text(buffer_.data(), end_);
    const std::size_t last_end = text.rfind('\n');
    lines_end_ = last_end == std::string_view::npos ? 0 : last_end + 1;
    if (end_ < buffer_.size()) lines_end_ = end_;  // the file has ended
    if (lines_end_ == 0 && end_ > 0) {
      return Status::corruption(
          fmt::format("{}: line {} at {}: found more than {} bytes, expected "
                      "a line of numbers",
                      input_.path(), line_number_, offset_, kMostLineBytes));
    }
  }
  return std::string_view(buffer_.data() + begin_, lines_end_ - begin_);
}

// A CR that no LF follows ends a line, and substitutions are made, from byte `begin` of the buffer
// on. The CR that ended the part before is looked at again.
void LineSource::adapt(std::size_t begin) {
  char* const data = buffer_.data();
  std::size_t at = begin > 0 && data[begin - 1] == '\r' ? begin - 1 : begin;
  while (at + 1 < end_) {
    const void* const found = std::memchr(data + at, '\r', end_ - 1 - at);
    if (found == nullptr) break;
    at = static_cast<std::size_t>(static_cast<const char*>(found) - data);
    if (data[at + 1] != '\n') data[at] = '\n';
    ++at;
  }
  for (const Substitution& substitution : substitutions_) {
    std::replace(data + begin, data + end_, substitution.from, substitution.to);
  }
}

void LineSource::substitute(char from, char to) {
  substitutions_.push_back({from, to});
  std::replace(buffer_.data() + begin_, buffer_.data() + end_, from, to);
}

void LineSource::consume(std::size_t bytes, std::uint64_t line_count) {
  begin_ += bytes;
  offset_ += bytes;
  line_number_ += line_count;
}

bool parseTextRow(std::string_view line, std::span<const TextColumn> columns, std::byte* row) {
  const char* at = line.data();
  const char* const end = at + line.size();
  bool is_first = true;
  for (const TextColumn& column : columns) {
    at = skipBlanks(at, end);
    const bool has_comma = !is_first && at < end && isTextComma(*at);
    if (has_comma) at = skipBlanks(at + 1, end);
    is_first = false;
    const char* const word = at;
    if (!column.is_kept) {
      if (at == end && !has_comma) return false;
      at = skipWord(at, end);
      continue;
    }
    at = parseTextNumber(at, end, column.type, row + column.offset);
    if (at != nullptr && at != word && (at == end || endsWord(*at))) continue;
    at = skipWord(word, end);
    if (!storeMissing(column, {word, at}, has_comma, row)) return false;
  }

  // A comma may end the line, as some programs write it
  at = skipBlanks(at, end);
  if (at < end && isTextComma(*at)) at = skipBlanks(at + 1, end);
  return at == end || (endsWord(at[-1]) && isTextComment({at, static_cast<std::size_t>(end - at)}));
}

std::string describeTextRow(std::string_view line, std::span<const TextColumn> columns) {
  const std::vector<std::string_view> words = wordsOf(line, columns.size() + 1);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const std::string expected =
        fmt::format("{} of type {}", columns[i].name, valueTypeName(columns[i].type));
    if (i >= words.size()) return fmt::format("line ends early, expected {}", expected);
    std::byte value[8];
    const char* const word_end = words[i].data() + words[i].size();
    if (columns[i].takes_missing && isMissingText(words[i])) continue;
    if (columns[i].is_kept &&
        (words[i].empty() ||
         parseTextNumber(words[i].data(), word_end, columns[i].type, value) != word_end)) {
      return fmt::format("found {}, expected {}", quoteText(words[i]), expected);
    }
  }
  const std::string_view found = words.size() > columns.size() ? words.back() : line;
  return fmt::format("found {}, expected the end of the line{}", quoteText(found),
                     line.find(',') == line.npos
                         ? ""
                         : ": commas part values; where they stand before decimals, write points");
}

bool isTextExtra(std::string_view line, TextExtras extras) {
  const std::string_view text = trimmedLine(line);
  // ",,", too, and the mark of old programs at the end
  const bool is_empty = text == "\x1a" || text.find_first_not_of(" \t,;|") == text.npos;
  return is_empty || (extras.has_comments && isTextComment(text)) ||
         (extras.has_counts && isTextCount(text));
}

Status TextRowParser::readRows(LineSource& source, std::uint64_t first_row, std::size_t count,
                               std::byte* rows) const {
  for (std::size_t done = 0; done < count;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source.lines());
    if (lines.empty()) {
      return Status::corruption(
          fmt::format("{}: row {}: file ends early: line {}, expected {} more "
                      "rows",
                      source.input().path(), first_row + done, source.lineNumber(), count - done));
    }
    std::size_t used = 0;
    std::uint64_t line_count = 0;
    while (done < count && used < lines.size()) {
      std::size_t bytes = 0;
      const std::string_view line = withoutEnd(lines.substr(used), bytes);
      if (parseTextRow(line, columns_, rows + done * row_bytes_)) {
        ++done;
      } else if (!isTextExtra(line, extras_)) {
        return Status::corruption(fmt::format("{}: row {} at line {}: {}", source.input().path(),
                                              first_row + done, source.lineNumber() + line_count,
                                              describeTextRow(line, columns_)));
      }
      used += bytes;
      ++line_count;
    }
    source.consume(used, line_count);
  }
  return {};
}

Status TextRowParser::checkEnd(LineSource& source) const {
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source.lines());
    if (lines.empty()) return source.input().checkUnchanged();
    std::size_t bytes = 0;
    const std::string_view line = withoutEnd(lines, bytes);
    if (!isTextExtra(line, extras_)) {
      return Status::corruption(
          fmt::format("{}: line {}: found {} after the last row, expected the end of the file: the "
                      "header counts fewer rows",
                      source.input().path(), source.lineNumber(), quoteText(line)));
    }
    source.consume(bytes, 1);
  }
}

}  // namespace surfeit
