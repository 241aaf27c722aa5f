#include "io/formats/xyz_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "io/formats/counted_row_reader.h"
#include "io/formats/property_renames.h"
#include "io/formats/text_rows.h"
#include "io/formats/xyz_layout.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxComments = 64, kMaxCommentChars = 1024;
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

bool beginsWithNumbers(std::string_view line, std::size_t count) {
  const std::vector<std::string_view> words = wordsOf(line, count);
  return words.size() == count && std::all_of(words.begin(), words.end(), isXyzNumber);
}

// The count in front of the points of a PTS file.
bool isPtsCount(std::string_view line) {
  return beginsWithNumbers(line, 1) && line.find_first_not_of("0123456789") == line.npos;
}

std::string textOfComment(std::string_view line) {
  line = line.substr(0, kMaxCommentChars);
  while (line.starts_with('#') || line.starts_with('/')) line.remove_prefix(1);
  std::string text(trimmedLine(line));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' && c > '\0'; }, ' ');
  return text;
}

// Takes the lines in front of the data, one by one.
class HeadParser {
 public:
  enum class Line { kHead, kData, kUnknown };

  // What a line is: of the head, the first of the data, or neither.
  Line take(std::string_view line) {
    line = trimmedLine(line);
    if (line.empty()) return Line::kHead;
    if (isTextComment(line)) {
      endNames();
      named_in_comment_ = true;
      last_comment_ = textOfComment(line);
      names_ = xyzHeaderNames(line);
      return Line::kHead;
    }
    if (beginsWithNumbers(line, 3)) return Line::kData;
    if (isPtsCount(line) && !has_count_) {
      has_count_ = true;
      return Line::kHead;
    }
    std::vector<std::string> names = xyzHeaderNames(line);
    if (names.empty()) return Line::kUnknown;
    endNames();
    named_in_comment_ = false;
    names_ = std::move(names);
    return Line::kHead;
  }

  // With the number of columns of the data, 0 when there is none: a comment that names others is
  // none that names columns.
  void end(std::size_t column_count) {
    if (named_in_comment_ && column_count > 0 && names_.size() != column_count) endNames();
  }

  bool hasNames() const { return !names_.empty(); }
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<std::string>& comments() const { return comments_; }

 private:
  // The last comment turned out to be one
  void endNames() {
    names_.clear();
    if (!last_comment_.empty() && comments_.size() < kMaxComments) {
      comments_.push_back(std::move(last_comment_));
    }
    last_comment_.clear();
  }

  std::vector<std::string> names_, comments_;
  std::string last_comment_;
  bool named_in_comment_ = false, has_count_ = false;
};

class XyzReader final : public CountedRowReader {
 public:
  explicit XyzReader(ByteInput input) : source_(std::move(input)) {
    path_ = source_.input().path();
    format_name_ = "text";
    element_.name = "vertex";
  }

  Status open(const RowReaderOptions& options) {
    SURFEIT_RETURN_IF_ERROR(readHead());
    SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source_.lines());
    std::vector<XyzColumn> sample = sampleXyz(lines);
    if (sample.size() > kMaxXyzColumns) {
      return Status::corruption(fmt::format("{}: line {}: more than {} values, expected fewer",
                                            path_, data_line_, kMaxXyzColumns));
    }
    head_.end(sample.size());
    if (!sample.empty() && head_.hasNames() && head_.names().size() != sample.size()) {
      return Status::corruption(fmt::format("{}: line {}: {} values, expected {} as the header has",
                                            path_, data_line_, sample.size(),
                                            head_.names().size()));
    }
    if (sample.empty()) sample.resize(head_.names().size());
    const std::vector<std::string> names =
        head_.hasNames() ? head_.names() : nameXyzColumns(sample);
    comments_ = head_.comments();

    SURFEIT_ASSIGN_OR_RETURN(const XyzScan scan, scanXyz(source_, wholeColumns(sample, names)));
    element_.count = scan.row_count;
    SURFEIT_RETURN_IF_ERROR(
        setColumns(names, typeXyzColumns(sample, names, scan), options.channels));
    return moveTo(0);
  }

 private:
  // Up to the first line of data, whose place is kept.
  Status readHead() {
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source_.lines());
      const std::size_t end = std::min(lines.find('\n'), lines.size());
      std::string_view line = lines.substr(0, end);
      if (source_.offset() == 0 && line.starts_with(kByteOrderMark)) {
        line.remove_prefix(kByteOrderMark.size());
        if (!lines.empty()) source_.consume(kByteOrderMark.size(), 0);
      }
      const HeadParser::Line kind = lines.empty() ? HeadParser::Line::kData : head_.take(line);
      if (lines.empty() && !head_.hasNames()) {
        return Status::corruption(fmt::format("{}: found no line of numbers", path_));
      }
      if (kind == HeadParser::Line::kUnknown) {
        return Status::corruption(
            fmt::format("{}: line {}: found {}, expected three numbers or names of columns with x, "
                        "y and z",
                        path_, source_.lineNumber(), quotePlyText(line)));
      }
      if (kind == HeadParser::Line::kData) {
        data_offset_ = source_.offset();
        data_line_ = source_.lineNumber();
        return {};
      }
      source_.consume(line.size() + (end < lines.size() ? 1 : 0), 1);
    }
  }

  Status setColumns(const std::vector<std::string>& names, const std::vector<PlyType>& types,
                    std::span<const ChannelRename> renames) {
    // As the file has them
    PlyElement all;
    for (std::size_t i = 0; i < names.size(); ++i) {
      PlyProperty property;
      property.name = names[i];
      property.type = types[i];
      all.properties.push_back(std::move(property));
    }

    // As they are called
    const std::vector<std::string> called = renamedProperties(all, renames);
    std::vector<TextColumn> columns;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!called[i].empty() && element_.find(called[i]) != nullptr) {
        return Status::corruption(fmt::format(
            "{}: column {} would be a second {}, expected another name", path_, i + 1, called[i]));
      }
      columns.push_back({names[i], types[i], element_.row_bytes, !called[i].empty()});
      if (called[i].empty()) continue;
      element_.properties.push_back(all.properties[i]);
      element_.properties.back().name = called[i];
      packPlyRow(element_);
    }
    SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(element_, path_));
    parser_.emplace(std::move(columns), element_.row_bytes, true);
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
  HeadParser head_;
  std::uint64_t data_offset_ = 0, data_line_ = 1;
  std::optional<TextRowParser> parser_;
};

}  // namespace

bool recognisesXyz(std::string_view first_bytes) {
  const bool is_cut = first_bytes.size() >= kMagicBytes;
  if (first_bytes.starts_with(kByteOrderMark)) first_bytes.remove_prefix(kByteOrderMark.size());
  for (const char c : first_bytes) {
    if ((c >= '\0' && c < ' ' && c != '\t' && c != '\r' && c != '\n') || c == '\x7f') return false;
  }
  HeadParser head;
  bool has_any = false;
  while (!first_bytes.empty()) {
    const std::size_t end = first_bytes.find('\n');
    if (end == first_bytes.npos && is_cut) {
      // Who knows what the rest of the line is, but for a comment it does not matter
      has_any = has_any || isTextComment(trimmedLine(first_bytes));
      break;
    }
    const HeadParser::Line kind = head.take(first_bytes.substr(0, end));
    if (kind != HeadParser::Line::kHead) return kind == HeadParser::Line::kData;
    has_any = true;
    first_bytes.remove_prefix(std::min(end, first_bytes.size() - 1) + 1);
  }
  return head.hasNames() || (has_any && is_cut);
}

Result<std::unique_ptr<RowReader>> openXyz(const std::string& path,
                                           const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
  auto reader = std::make_unique<XyzReader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
