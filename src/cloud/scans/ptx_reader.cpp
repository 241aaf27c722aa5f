#include "cloud/scans/ptx_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "cloud/parts/counted_row_reader.h"
#include "cloud/parts/property_renames.h"
#include "cloud/text/text_rows.h"

namespace surfeit {
namespace {

constexpr std::size_t kPlainValues = 4, kColorValues = 7;
constexpr std::uint64_t kMostGridLines = std::uint64_t{1} << 31;
constexpr std::size_t kPoseLines = 4, kMatrixLines = 4;

// The numbers of a line; more than seven, or other words, make it empty.
struct Numbers {
  std::array<double, kColorValues> values{};
  std::size_t count = 0;
};

Numbers numbersOf(std::string_view line) {
  Numbers numbers;
  const char* at = line.data();
  const char* const end = at + line.size();
  for (;;) {
    while (at < end && isTextBlank(*at)) ++at;
    if (at == end) return numbers;
    if (numbers.count == numbers.values.size()) return {};
    std::byte bytes[8];
    at = parseTextNumber(at, end, ValueType::kFloat64, bytes);
    if (at == nullptr || (at < end && !isTextBlank(*at))) return {};
    std::memcpy(&numbers.values[numbers.count++], bytes, sizeof bytes);
  }
}

struct PtxPoint {
  double position[3];
  float intensity;
  std::uint8_t color[3];
};

// Goes through the scans, point by point.
class PtxCursor {
 public:
  explicit PtxCursor(ByteInput input) : source_(std::move(input)) {}

  const std::string& path() const { return source_.input().path(); }
  std::uint64_t scanCount() const { return scan_; }
  std::uint64_t emptyCount() const { return empty_; }
  bool hasColor() const { return values_ == kColorValues; }

  void rewind() {
    source_.jumpTo(0, 1);
    scan_ = empty_ = left_ = 0;
  }

  // The next point that is none of the empty ones; false at the end of the file.
  Result<bool> next(PtxPoint& point) {
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const bool has_line, takeLine());
      if (!has_line) {
        if (left_ == 0) return false;
        return damaged(fmt::format("file ends early, expected {} more points", left_));
      }
      if (left_ == 0) {
        SURFEIT_RETURN_IF_ERROR(readScanHead());
        continue;
      }
      --left_;
      const Numbers numbers = numbersOf(line_);
      const double* const value = numbers.values.data();
      if (numbers.count >= 3 && value[0] == 0 && value[1] == 0 && value[2] == 0) {
        ++empty_;
        continue;
      }
      SURFEIT_RETURN_IF_ERROR(checkValues(numbers));
      for (std::size_t i = 0; i < 3; ++i) {
        point.position[i] = value[0] * matrix_[0][i] + value[1] * matrix_[1][i] +
                            value[2] * matrix_[2][i] + matrix_[3][i];
      }
      point.intensity = static_cast<float>(value[3]);
      for (std::size_t i = 0; i < 3; ++i) {
        point.color[i] = hasColor() ? static_cast<std::uint8_t>(value[4 + i]) : std::uint8_t{0};
      }
      return true;
    }
  }

  Status checkUnchanged() const { return source_.input().checkUnchanged(); }

 private:
  Status damaged(std::string_view what) const {
    return Status::corruption(
        fmt::format("{}: scan {} at line {}: {}", path(), scan_, line_number_, what));
  }

  // The next line that is not empty, to line_.
  Result<bool> takeLine() {
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source_.lines());
      if (lines.empty()) return false;
      const std::size_t end = std::min(lines.find('\n'), lines.size());
      line_ = trimmedLine(lines.substr(0, end));
      line_number_ = source_.lineNumber();
      // The view of the line lasts until lines() is called again
      source_.consume(std::min(end + 1, lines.size()), 1);
      if (!line_.empty()) return true;
    }
  }

  Result<Numbers> headLine(std::size_t count, std::string_view what) {
    SURFEIT_ASSIGN_OR_RETURN(const bool has_line, takeLine());
    const Numbers numbers = has_line ? numbersOf(line_) : Numbers{};
    if (numbers.count != count) {
      return damaged(fmt::format("found {}, expected {} of {} numbers",
                                 has_line ? quoteText(line_) : "the end of the file", what, count));
    }
    return numbers;
  }

  // Its first line has been taken.
  Status readScanHead() {
    ++scan_;
    std::uint64_t grid[2] = {};
    for (std::size_t i = 0; i < 2; ++i) {
      if (i > 0) SURFEIT_RETURN_IF_ERROR(headLine(1, "the rows of the grid").status());
      if (!isTextCount(line_)) {
        return damaged(fmt::format("found {}, expected the {} of a scan's grid", quoteText(line_),
                                   i == 0 ? "columns" : "rows"));
      }
      for (const char c : line_) grid[i] = grid[i] * 10 + static_cast<std::uint64_t>(c - '0');
      if (grid[i] > kMostGridLines) {
        return damaged(
            fmt::format("found {} lines of a grid, expected at most {}", grid[i], kMostGridLines));
      }
    }
    left_ = grid[0] * grid[1];
    for (std::size_t i = 0; i < kPoseLines; ++i) {
      SURFEIT_RETURN_IF_ERROR(headLine(3, "the scanner's position or axis").status());
    }
    for (std::size_t i = 0; i < kMatrixLines; ++i) {
      SURFEIT_ASSIGN_OR_RETURN(const Numbers row, headLine(4, "a row of the matrix"));
      std::copy_n(row.values.begin(), 4, matrix_[i].begin());
      if (matrix_[i][3] != (i == 3 ? 1 : 0)) {
        return damaged(
            fmt::format("found {} at the end of row {} of the matrix, expected {}: the "
                        "translation stands in the last row",
                        matrix_[i][3], i + 1, i == 3 ? 1 : 0));
      }
    }
    return checkMatrix();
  }

  // One of zeros would put all points to one place.
  Status checkMatrix() const {
    const auto& m = matrix_;
    const double volume = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                          m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                          m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    if (std::isfinite(volume) && volume != 0) return {};
    return damaged(
        "found a matrix that leaves no volume, expected a rotation: where the points are in the "
        "world already, rows 1 0 0 0, 0 1 0 0, 0 0 1 0 and 0 0 0 1");
  }

  Status checkValues(const Numbers& numbers) {
    if (values_ == 0 && (numbers.count == kPlainValues || numbers.count == kColorValues)) {
      values_ = numbers.count;
    }
    if (numbers.count != values_ || values_ == 0) {
      return damaged(fmt::format(
          "found {}, expected {}", quoteText(line_),
          values_ == 0
              ? "4 or 7 numbers with points before decimals: x y z intensity, red green blue"
              : fmt::format("{} numbers as in the points before", values_)));
    }
    for (std::size_t i = kPlainValues; i < values_; ++i) {
      const double value = numbers.values[i];
      if (!(value >= 0 && value <= 255)) {
        return damaged(fmt::format("found a color of {}, expected 0 to 255", value));
      }
    }
    return {};
  }

  LineSource source_;
  std::string_view line_;
  std::uint64_t line_number_ = 1;
  std::uint64_t scan_ = 0, left_ = 0, empty_ = 0;  // left_: points of this scan
  std::size_t values_ = 0;                         // of every point; 0: not yet known
  std::array<std::array<double, 4>, kMatrixLines> matrix_{};
};

class PtxReader final : public CountedRowReader {
 public:
  explicit PtxReader(ByteInput input) : cursor_(std::move(input)) {
    path_ = cursor_.path();
    format_name_ = "PTX";
    element_.name = "vertex";
  }

  Status open(std::span<const ChannelRename> renames) {
    // Count what is there
    PtxPoint point;
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const bool has_point, cursor_.next(point));
      if (!has_point) break;
      ++element_.count;
    }
    if (cursor_.emptyCount() > 0) {
      notes_.push_back(fmt::format("{} of {} points are at 0 0 0, empty, and left out",
                                   cursor_.emptyCount(), element_.count + cursor_.emptyCount()));
    }
    if (cursor_.scanCount() > 1) {
      notes_.push_back(fmt::format("{} scans are one cloud, each where its matrix puts it",
                                   cursor_.scanCount()));
    }
    SURFEIT_RETURN_IF_ERROR(setColumns(renames));
    return moveTo(0);
  }

 private:
  Status setColumns(std::span<const ChannelRename> renames) {
    RowLayout all;
    const auto add = [&all](const char* name, ValueType type) {
      RowProperty property;
      property.name = name;
      property.type = type;
      all.properties.push_back(std::move(property));
    };
    for (const char* const name : {"x", "y", "z"}) add(name, ValueType::kFloat64);
    add("intensity", ValueType::kFloat32);
    if (cursor_.hasColor()) {
      for (const char* const name : {"red", "green", "blue"}) add(name, ValueType::kUint8);
    }
    const std::vector<RowProperty> renamed = renamedProperties(all, renames);
    for (std::size_t i = 0; i < renamed.size(); ++i) {
      if (renamed[i].name.empty()) {
        offsets_.push_back(kDropped);
        continue;
      }
      if (element_.find(renamed[i].name) != nullptr) {
        return Status::corruption(fmt::format("{}: {} would be a second {}, expected another name",
                                              path_, all.properties[i].name, renamed[i].name));
      }
      offsets_.push_back(element_.row_bytes);
      element_.properties.push_back(renamed[i]);
      packRow(element_);
    }
    return checkChannelsLeft(element_, path_);
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    for (std::size_t i = 0; i < count; ++i) {
      PtxPoint point{};
      SURFEIT_ASSIGN_OR_RETURN(const bool has_point, cursor_.next(point));
      if (!has_point) return damagedRow(row() + i, "file ends early");
      std::byte* const out = rows + i * element_.row_bytes;
      const auto store = [&](std::size_t column, const auto& value) {
        const bool is_kept = column < offsets_.size() && offsets_[column] != kDropped;
        if (is_kept) std::memcpy(out + offsets_[column], &value, sizeof value);
      };
      for (std::size_t axis = 0; axis < 3; ++axis) store(axis, point.position[axis]);
      store(3, point.intensity);
      for (std::size_t channel = 0; channel < 3; ++channel)
        store(4 + channel, point.color[channel]);
    }
    return {};
  }

  Status moveTo(std::uint64_t) override {
    cursor_.rewind();
    return {};
  }

  Status checkEnd() override { return cursor_.checkUnchanged(); }

  static constexpr std::size_t kDropped = static_cast<std::size_t>(-1);
  PtxCursor cursor_;
  std::vector<std::size_t> offsets_;  // of the columns in a row
};

}  // namespace

bool recognisesPtx(std::string_view first_bytes) {
  constexpr std::size_t kCounts[] = {1, 1, 3, 3, 3, 3, 4, 4, 4, 4};
  std::size_t line_count = 0;
  while (!first_bytes.empty() && line_count < std::size(kCounts)) {
    const std::size_t end = std::min(first_bytes.find_first_of("\r\n"), first_bytes.size());
    const std::string_view line = trimmedLine(first_bytes.substr(0, end));
    first_bytes.remove_prefix(std::min(end + 1, first_bytes.size()));
    if (line.empty()) continue;
    if (line_count < 2 ? !isTextCount(line) : numbersOf(line).count != kCounts[line_count]) {
      return false;
    }
    ++line_count;
  }
  return line_count >= 4;  // a cut head is told as one
}

Result<std::unique_ptr<RowReader>> openPtx(const std::string& path,
                                           const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
  auto reader = std::make_unique<PtxReader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options.channels));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
