// Rows of numbers as lines of text (xyz, ascii PCD): the lines of a file, a block of them at a
// time, and lines turned into rows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// Between values: blanks, tabs, and at most one comma, semicolon or bar. A carriage return is a
// blank.
constexpr bool isTextBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
constexpr bool isTextComma(char c) { return c == ',' || c == ';' || c == '|'; }
// A line without the blanks around it.
std::string_view trimmedLine(std::string_view line);
// Whether a line, trimmed, is a comment: it begins with #, % or //.
bool isTextComment(std::string_view line);
// The line up to a comment behind values, which begins with #, % or // behind a blank or comma.
std::string_view withoutComment(std::string_view line);
// The words of a line; an empty one between two commas. No more than `most`.
std::vector<std::string_view> wordsOf(std::string_view line, std::size_t most);

// Whether a word is a number, by the rules of ascii PLY.
bool isTextNumber(std::string_view word);
// Whether a cell of a table says that it has no value: nothing between commas, NA, N/A, #N/A, null,
// none, or a dash.
bool isMissingText(std::string_view word);
// Whether a word is digits only, 18 at most: a count.
bool isTextCount(std::string_view word);

// The lines of a file in order: they end with LF, CR LF or CR. One thread at a time; takes 256 KiB.
class LineSource {
 public:
  static constexpr std::size_t kMostLineBytes = 256 << 10;

  explicit LineSource(ByteInput input) : input_(std::move(input)) {}

  ByteInput& input() { return input_; }
  const ByteInput& input() const { return input_; }
  // Of the first line that has not been consumed, and its number from 1.
  std::uint64_t offset() const { return offset_; }
  std::uint64_t lineNumber() const { return line_number_; }
  // Goes on with the line at `offset`, whose number is `line_number`.
  void jumpTo(std::uint64_t offset, std::uint64_t line_number);

  // Whole lines from here on, with their ends; the last of the file may lack it. At least one
  // unless the file ends here. The view lasts until consume has passed all of it, or jumpTo.
  // kCorruption when a line is longer than kMostLineBytes.
  Result<std::string_view> lines();
  // Passes over the first `bytes` of lines(): `line_count` whole lines.
  void consume(std::size_t bytes, std::uint64_t line_count);
  // From here on, every `from` is seen as `to`: decimal commas as points.
  void substitute(char from, char to);

 private:
  void adapt(std::size_t begin);

  struct Substitution {
    char from, to;
  };
  std::vector<Substitution> substitutions_;
  ByteInput input_;
  std::uint64_t offset_ = 0, line_number_ = 1;
  // buffer_[begin_, lines_end_) are whole lines, up to end_ follows what has been read of the next
  std::vector<char> buffer_ = std::vector<char>(kMostLineBytes);
  std::size_t begin_ = 0, lines_end_ = 0, end_ = 0;
};

// A value of every line, behind the last of which a comment may stand. Words of columns that are
// not kept are passed over unseen; they may be empty between commas.
struct TextColumn {
  std::string name;  // for messages
  ValueType type = ValueType::kFloat32;
  std::size_t offset = 0;  // in a row
  bool is_kept = true;
  // Cells without a value (isMissingText) are nan. Of reals.
  bool takes_missing = false;
};

// Turns a line, without its end, into a row; false when it is not as the columns say. Reals are
// rounded to nearest, and are infinite or zero where too large or too small; nan and inf are read.
// Integers may be written with zeros after a point: 235.000.
bool parseTextRow(std::string_view line, std::span<const TextColumn> columns, std::byte* row);
// The number at the begin of [at, end): returns its end, or nullptr.
const char* parseTextNumber(const char* at, const char* end, ValueType type, std::byte* out);
// Why parseTextRow refused a line: "found 'a', expected y of type float".
std::string describeTextRow(std::string_view line, std::span<const TextColumn> columns);

// Lines between rows besides empty ones.
struct TextExtras {
  bool has_comments = false;
  bool has_counts = false;  // lines of one whole number, the counts of PTS; rows have more values
};

// Whether a line holds no row.
bool isTextExtra(std::string_view line, TextExtras extras);

// Reads rows from lines. Empty lines and extras are skipped.
class TextRowParser {
 public:
  TextRowParser(std::vector<TextColumn> columns, std::size_t row_bytes, TextExtras extras)
      : columns_(std::move(columns)), row_bytes_(row_bytes), extras_(extras) {}

  // The next `count` rows; the first is row `first_row` of the file in messages. kCorruption for
  // lines that are not as the columns say, and when the file ends early.
  Status readRows(LineSource& source, std::uint64_t first_row, std::size_t count,
                  std::byte* rows) const;
  // kCorruption unless nothing but empty lines and extras is left.
  Status checkEnd(LineSource& source) const;

 private:
  std::vector<TextColumn> columns_;
  std::size_t row_bytes_;
  TextExtras extras_;
};

}  // namespace surfeit
