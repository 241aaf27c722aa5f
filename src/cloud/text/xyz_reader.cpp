#include "cloud/text/xyz_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "cloud/parts/counted_row_reader.h"
#include "cloud/parts/property_renames.h"
#include "cloud/text/text_rows.h"
#include "cloud/text/xyz_decimals.h"
#include "cloud/text/xyz_head.h"
#include "cloud/text/xyz_layout.h"
#include "cloud/text/xyz_units.h"
#include "core/assert.h"

namespace surfeit {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
// The first row, or names of columns, come before.
constexpr std::uint64_t kMostHeadBytes = 1 << 20;

bool hasCommasInAndOutOfQuotes(std::string_view line) {
  bool is_quoted = false, has_inner = false, has_outer = false;
  for (const char c : line) {
    if (c == '"') is_quoted = !is_quoted;
    if (c == ',') (is_quoted ? has_inner : has_outer) = true;
  }
  return has_inner && has_outer;
}

constexpr const char* kAnglesAdvice =
    ", which are angles, expected lengths: reproject them first, to UTM for example; or, where "
    "they "
    "are no angles, name the columns (--channels 1=x,2=y,3=z)";

class XyzReader final : public CountedRowReader {
 public:
  explicit XyzReader(ByteInput input) : source_(std::move(input)) {
    path_ = source_.input().path();
    format_name_ = "text";
    element_.name = "vertex";
  }

  Status open(const RowReaderOptions& options) {
    renames_ = options.channels;
    if (hasNumbers()) head_.takeWords();
    SURFEIT_RETURN_IF_ERROR(readHead());
    SURFEIT_RETURN_IF_ERROR(chooseDecimals());
    SURFEIT_RETURN_IF_ERROR(readFirstRow());
    SURFEIT_ASSIGN_OR_RETURN(XyzTable table, scan());
    if (!table.refusal.ok() && table.has_comma_in_refused && decimals_ == TextDecimals::kUnknown) {
      // Commas that come late may be decimal commas as well
      SURFEIT_RETURN_IF_ERROR(moveTo(0));
      SURFEIT_ASSIGN_OR_RETURN(decimals_, judgeDecimals(source_, head_.hasNames(), true));
      if (decimals_ == TextDecimals::kComma) {
        takeDecimalCommas();
        SURFEIT_ASSIGN_OR_RETURN(table, scan());
      }
    }
    SURFEIT_RETURN_IF_ERROR(table.refusal);
    SURFEIT_RETURN_IF_ERROR(nameColumns(table));
    noteScans(table);
    noteMissing(table);
    noteRounded(table);
    noteComments(table);
    element_.count = table.row_count;
    SURFEIT_RETURN_IF_ERROR(setColumns(names_, typeXyzColumns(table, names_)));
    return moveTo(0);
  }

 private:
  // Up to the first line of data, whose place is kept.
  Status readHead() {
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source_.lines());
      if (source_.offset() > kMostHeadBytes) {
        return Status::corruption(
            fmt::format("{}: found no line of numbers in {} bytes, expected one in the first {}",
                        path_, source_.offset(), kMostHeadBytes));
      }
      const std::size_t end = std::min(lines.find('\n'), lines.size());
      std::string_view line = lines.substr(0, end);
      if (source_.offset() == 0 && line.starts_with(kByteOrderMark)) {
        line.remove_prefix(kByteOrderMark.size());
        source_.consume(kByteOrderMark.size(), 0);
      }
      const XyzHead::Line kind = lines.empty() ? XyzHead::Line::kData : head_.take(line);
      if (lines.empty() && !head_.hasNames()) {
        return Status::corruption(fmt::format("{}: found no line of numbers", path_));
      }
      if (kind == XyzHead::Line::kUnknown) {
        return Status::corruption(fmt::format(
            "{}: line {}: found {}, expected three numbers or names of columns with x, y and z{}",
            path_, source_.lineNumber(), quoteText(line), adviceFor(line)));
      }
      if (kind == XyzHead::Line::kData) {
        if (renames_.empty() && hasAngles(line)) return angles(line);
        data_offset_ = source_.offset();
        data_line_ = source_.lineNumber();
        extras_.has_counts = head_.hasCount();
        return {};
      }
      source_.consume(line.size() + (end < lines.size() ? 1 : 0), 1);
    }
  }

  Status angles(std::string_view line) const {
    return Status::corruption(fmt::format("{}: line {}: found {}{}", path_, source_.lineNumber(),
                                          quoteText(line), kAnglesAdvice));
  }

  // How a line that is neither of the head nor a row can be read after all.
  static std::string adviceFor(std::string_view line) {
    if (hasAngles(line)) return kAnglesAdvice;
    if (std::any_of(line.begin(), line.end(), [](char c) { return (c & 0x80) != 0; })) {
      return ": it has characters that are not ASCII, such as blanks that do not break or other "
             "signs for minus: replace them";
    }
    if (line.find('\'') != line.npos) {
      return ": numbers have no apostrophes between thousands: leave them out (tr -d \"'\")";
    }
    const std::vector<std::string_view> words = wordsOf(line, kMaxXyzColumns);
    if (words.size() < 3 && std::all_of(words.begin(), words.end(), isTextNumber)) {
      return ": a place needs a third, 0 for flat clouds";
    }
    // Three numbers, one after another
    std::size_t first = 1, count = 0;
    for (std::size_t i = 0; i < words.size() && count < 3; ++i) {
      count = isTextNumber(words[i]) ? count + 1 : 0;
      first = i + 2 - std::min<std::size_t>(count, i + 1);
    }
    if (count < 3) {
      return "; blanks, tabs, commas, semicolons or bars part numbers, and a # in front makes a "
             "comment of a line";
    }
    return fmt::format(
        ": say which are the position: --channels {}=x,{}=y,{}=z (numbers of "
        "columns; NUMBER=- leaves one out)",
        first, first + 1, first + 2);
  }

  // What --text says, else what the lines tell.
  Status chooseDecimals() {
    SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source_.lines());
    const std::string_view line = lines.substr(0, lines.find('\n'));
    if (line.find('"') != line.npos) {
      if (hasCommasInAndOutOfQuotes(line)) {
        return Status::corruption(fmt::format(
            "{}: line {}: found {}: commas stand within quotes and between values, expected other "
            "separators",
            path_, data_line_, quoteText(line)));
      }
      source_.substitute('"', ' ');
    }
    for (const ChannelRename& rename : renames_) {
      if (rename.from != kTextChannel) continue;
      if (rename.to != kDecimalComma && rename.to != kDecimalPoint) {
        return Status::invalidArgument(fmt::format("text: found {}, expected {} or {}",
                                                   quoteText(rename.to), kDecimalComma,
                                                   kDecimalPoint));
      }
      decimals_ = rename.to == kDecimalComma ? TextDecimals::kComma : TextDecimals::kPoint;
    }
    if (decimals_ == TextDecimals::kComma) {
      source_.substitute(',', '.');
    } else if (decimals_ == TextDecimals::kUnknown) {
      SURFEIT_ASSIGN_OR_RETURN(decimals_, judgeDecimals(source_, head_.hasNames()));
      if (decimals_ == TextDecimals::kComma) takeDecimalCommas();
    }
    return {};
  }

  void takeDecimalCommas() {
    SURFEIT_ASSERT(source_.offset() == data_offset_);
    source_.substitute(',', '.');
    notes_.push_back(
        "commas are decimal commas (1,5 is 1.5): --text decimal-point if they are not");
  }

  // How many columns there are, what they are called until all rows are known, and which of them
  // hold no numbers.
  Status readFirstRow() {
    SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source_.lines());
    const std::string_view line = trimmedLine(lines.substr(0, lines.find('\n')));
    std::vector<std::string_view> words = wordsOf(line, kMaxXyzColumns + 1);
    // What looks like a comment is a value where there is a name for it
    const std::vector<std::string>& named = head_.header().file_names;
    const bool has_comment_names = std::any_of(named.begin(), named.end(),
                                               [](std::string_view s) { return isTextComment(s); });
    if (words.size() != named.size() || has_comment_names) {
      words = wordsOf(withoutComment(line), kMaxXyzColumns + 1);
    }
    const bool ends_with_empty = !line.empty() && isTextComma(line.back()) &&
                                 head_.header().file_names.size() == words.size() + 1;
    if (ends_with_empty) words.emplace_back();
    if (words.size() > kMaxXyzColumns) {
      return Status::corruption(fmt::format(
          "{}: line {}: more than {} values, expected fewer: `cut -d ' ' -f 1-{}` keeps "
          "the first",
          path_, data_line_, kMaxXyzColumns, kMaxXyzColumns));
    }
    if (decimals_ == TextDecimals::kComma && !words.empty() && words.size() < 3) {
      return Status::corruption(fmt::format(
          "{}: line {}: {} values, expected three or more, parted by semicolons, tabs or blanks "
          "where commas stand before decimals",
          path_, data_line_, words.size()));
    }
    head_.end(words.size());
    comments_ = head_.comments();
    if (!head_.note().empty()) notes_.push_back(head_.note());
    const XyzHeader& header = head_.header();
    if (!header.unit_note.empty()) notes_.push_back(header.unit_note);
    if (!header.repeat_note.empty() && !hasNumbers()) notes_.push_back(header.repeat_note);
    SURFEIT_RETURN_IF_ERROR(checkHead(words.size()));
    names_ = head_.header().names;
    if (names_.empty()) {
      for (std::size_t i = 0; i < words.size(); ++i) {
        names_.push_back(i < 3 ? std::string(1, static_cast<char>('x' + i))
                               : fmt::format("column {}", i + 1));
      }
    }
    typed_.resize(names_.size());
    for (std::size_t i = 0; i < names_.size(); ++i) {
      const bool is_text = i < words.size() && !isTextNumber(words[i]) && !isMissingText(words[i]);
      first_row_.push_back(
          {names_[i], ValueType::kFloat32, 0, !is_text && !isDropped(i), !isPlaceName(names_[i])});
    }
    return {};
  }

  // The column is not wanted: FROM=- with its name or number.
  bool isDropped(std::size_t column) const {
    return std::any_of(renames_.begin(), renames_.end(), [&](const ChannelRename& rename) {
      return rename.to == "-" &&
             (rename.from == fmt::format("{}", column + 1) ||
              (head_.hasNames() && (rename.from == names_[column] ||
                                    rename.from == head_.header().file_names[column])));
    });
  }

  Status checkHead(std::size_t column_count) const {
    const XyzHeader& header = head_.header();
    const std::size_t named = header.file_names.size();
    if (!header.refusal.empty() && !hasNumbers()) {
      return Status::corruption(
          fmt::format("{}: the names of the columns: {}", path_, header.refusal));
    }
    if (!head_.otherNames().empty() && header.names.empty() && !hasNumbers()) {
      return Status::corruption(
          fmt::format("{}: found columns named {}, expected one x, y and z each among them: say "
                      "which are the position: "
                      "--channels 1=x,2=y,3=z (numbers of columns)",
                      path_, quoteText(fmt::format("{}", fmt::join(head_.otherNames(), " ")))));
    }
    if (column_count == 0 || header.names.empty() || named == column_count) return {};
    return Status::corruption(fmt::format("{}: line {}: {} values, expected {} as the header has",
                                          path_, data_line_, column_count, named));
  }

  // Whether --channels names columns by number.
  bool hasNumbers() const {
    return std::any_of(renames_.begin(), renames_.end(),
                       [](const ChannelRename& rename) { return isTextCount(rename.from); });
  }

  Result<XyzTable> scan() {
    SURFEIT_RETURN_IF_ERROR(moveTo(0));
    return scanXyz(source_, first_row_, extras_, head_.count());
  }

  // By the header, by numbers in --channels, or by the values.
  Status nameColumns(XyzTable& table) {
    if (head_.hasNames()) {
      const XyzHeader& header = head_.header();
      for (ChannelRename& rename : renames_) {
        for (std::size_t i = 0; i < header.names.size(); ++i) {
          if (rename.from != header.file_names[i]) continue;
          typed_[i] = rename.from;
          rename.from = header.names[i];
        }
      }
      return nameNumbered();
    }
    if (hasNumbers()) {
      // A position named by numbers is nowhere else
      const bool has_place =
          std::any_of(renames_.begin(), renames_.end(), [](const ChannelRename& rename) {
            return isTextCount(rename.from) &&
                   (rename.to == "x" || rename.to == "y" || rename.to == "z");
          });
      const Status first = has_place ? Status() : checkFirstXyzColumn(table);
      if (!first.ok()) return Status::corruption(fmt::format("{}: {}", path_, first.message()));
      for (std::size_t i = has_place ? 0 : 3; i < names_.size(); ++i) {
        names_[i] = fmt::format("column_{}", i + 1);
      }
      return nameNumbered();
    }
    SURFEIT_RETURN_IF_ERROR(checkTexts());
    Result<std::vector<std::string>> names = nameXyzColumns(table, head_.hasCount());
    if (!names.ok()) {
      return Status::corruption(fmt::format("{}: {}", path_, names.status().message()));
    }
    names_ = std::move(*names);
    if (names_.size() > 3) {
      notes_.push_back(fmt::format(
          "columns have no names and are taken, by their values, for {}: --channels 4=NAME,... "
          "names them otherwise",
          fmt::join(names_, " ")));
    }
    return {};
  }

  // Columns that --channels names by their numbers.
  Status nameNumbered() {
    for (ChannelRename& rename : renames_) {
      for (std::size_t i = 0; i < names_.size(); ++i) {
        if (rename.from != fmt::format("{}", i + 1)) continue;
        if (rename.to == "-") {
          rename.from = names_[i];
        } else {
          names_[i] = rename.to;
          typed_[i] = rename.from;
        }
        break;
      }
    }
    return checkTexts();
  }

  // Only numbers become values of rows.
  Status checkTexts() const {
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (first_row_[i].is_kept) continue;
      const bool is_dropped =
          std::any_of(renames_.begin(), renames_.end(), [&](const ChannelRename& rename) {
            return rename.to == "-" && rename.from == names_[i];
          });
      if (is_dropped) continue;
      return Status::corruption(
          fmt::format("{}: line {}: found no number in column {} ({}), expected one: --channels "
                      "{}=- leaves the column out",
                      path_, data_line_, i + 1, names_[i], i + 1));
    }
    return {};
  }

  void noteScans(const XyzTable& table) {
    if (table.scan_count > 1) {
      notes_.push_back(
          fmt::format("{} scans, one after another, are read as one cloud", table.scan_count));
    }
    if (!table.count_note.empty()) notes_.push_back(table.count_note);
  }

  void noteRounded(const XyzTable& table) {
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (table.columns[i].rounded == 0) continue;
      notes_.push_back(fmt::format(
          "column {} ({}) has whole numbers beyond 2^53 in {} of {} rows, which doubles round: "
          "shorten them in the file, or leave the column out by --channels {}=-",
          i + 1, names_[i], table.columns[i].rounded, table.row_count, i + 1));
    }
  }

  // Those in front of the rows are kept.
  void noteComments(const XyzTable& table) {
    if (table.commented_rows > 0) {
      notes_.push_back(fmt::format("comments behind the values of {} of {} rows are not kept",
                                   table.commented_rows, table.row_count));
    }
    if (table.colored_rows > 0) {
      notes_.push_back(fmt::format(
          "{} of these comments look like colors (#ff8800), which are not read: write red, green "
          "and blue as three columns",
          table.colored_rows));
    }
    if (table.comment_lines > 0) {
      notes_.push_back(
          fmt::format("{} lines of comments among the rows are not kept", table.comment_lines));
    }
    if (head_.lostComments() > 0) {
      notes_.push_back(
          fmt::format("{} comments in front of the rows are not kept, for there are "
                      "more than {}",
                      head_.lostComments(), comments_.size()));
    }
  }

  void noteMissing(const XyzTable& table) {
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (table.columns[i].missing == 0) continue;
      notes_.push_back(
          fmt::format("column {} ({}) has no value in {} of {} rows: nan is read; --channels {}=- "
                      "leaves the column out",
                      i + 1, names_[i], table.columns[i].missing, table.row_count, i + 1));
    }
  }

  Status setColumns(const std::vector<std::string>& names, const std::vector<ValueType>& types) {
    // As the file has them
    RowLayout all;
    for (std::size_t i = 0; i < names.size(); ++i) {
      RowProperty property;
      property.name = names[i];
      property.type = types[i];
      all.properties.push_back(std::move(property));
    }

    // As they are called
    const std::vector<RowProperty> called = renamedProperties(all, renames_);
    std::vector<TextColumn> columns;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string& name = called[i].name;
      if (!name.empty() && element_.find(name) != nullptr) {
        return Status::corruption(fmt::format(
            "{}: column {} would be a second {}, expected another name", path_, i + 1, name));
      }
      columns.push_back({names[i], types[i], element_.row_bytes, !name.empty(),
                         isFloatType(types[i]) && !isPlaceName(name)});
      if (name.empty()) continue;
      element_.properties.push_back(called[i]);
      if (!typed_[i].empty()) element_.properties.back().typed = typed_[i];
      packRow(element_);
    }
    SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(element_, path_));
    parser_.emplace(std::move(columns), element_.row_bytes, extras_);
    return {};
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    return parser_->readRows(source_, row(), count, rows);
  }

  Status moveTo(std::uint64_t) override {
    source_.jumpTo(data_offset_, data_line_);
    return {};
  }

  Status checkEnd() override { return parser_->checkEnd(source_); }

  LineSource source_;
  XyzHead head_;
  std::vector<ChannelRename> renames_;
  TextDecimals decimals_ = TextDecimals::kUnknown;
  TextExtras extras_{true, false};
  std::vector<std::string> names_;
  std::vector<std::string> typed_;  // what --channels calls a column, where it names it
  std::vector<TextColumn> first_row_;
  std::uint64_t data_offset_ = 0, data_line_ = 1;
  std::optional<TextRowParser> parser_;
};

}  // namespace

bool recognisesXyz(std::string_view first_bytes) {
  if (first_bytes.starts_with('{') || first_bytes.starts_with('<')) return false;  // JSON, XML
  const bool is_cut = first_bytes.size() >= kMagicBytes;
  if (first_bytes.starts_with(kByteOrderMark)) first_bytes.remove_prefix(kByteOrderMark.size());
  for (const char c : first_bytes) {
    const bool is_of_lines = c == '\t' || c == '\r' || c == '\n' || c == '\x1a';
    if ((c >= '\0' && c < ' ' && !is_of_lines) || c == '\x7f') return false;
  }
  XyzHead head;
  bool has_any = false;
  while (!first_bytes.empty()) {
    const std::size_t end = first_bytes.find_first_of("\r\n");
    if (end == first_bytes.npos && is_cut) {
      // Who knows what the rest of the line is, but for a comment it does not matter
      has_any = has_any || isTextComment(trimmedLine(first_bytes));
      break;
    }
    const std::string_view line = first_bytes.substr(0, end);
    const XyzHead::Line kind = head.take(line);
    if (kind != XyzHead::Line::kHead) return kind == XyzHead::Line::kData;
    if (!line.empty()) has_any = true;
    first_bytes.remove_prefix(std::min(end, first_bytes.size() - 1) + 1);
  }
  return !head.header().file_names.empty() || (has_any && is_cut);
}

Result<std::unique_ptr<RowReader>> openXyz(const std::string& path,
                                           const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
  auto reader = std::make_unique<XyzReader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
