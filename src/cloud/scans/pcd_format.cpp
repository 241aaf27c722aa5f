#include "cloud/scans/pcd_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>
#include <utility>

#include "cloud/ply/ply_number.h"
#include "cloud/rows/row_layout.h"
#include "cloud/text/text_rows.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxHeaderBytes = 256 << 10;

std::optional<StoredType> storedTypeOf(char kind, std::size_t bytes) {
  for (int i = 0; i <= static_cast<int>(StoredType::kFloat64); ++i) {
    const auto type = static_cast<StoredType>(i);
    const std::string_view name = storedTypeName(type);
    const char kind_of_type = name.starts_with("float") ? 'F' : name.starts_with('u') ? 'U' : 'I';
    const bool is_known = type != StoredType::kFloat16;  // PCL has none
    if (is_known && kind_of_type == kind && storedBytes(type) == bytes) return type;
  }
  return std::nullopt;
}

class HeaderParser {
 public:
  HeaderParser(std::string_view text, const std::string& path) : text_(text), path_(path) {}

  Result<PcdHeader> parse() {
    for (bool has_data = false; !has_data;) {
      SURFEIT_RETURN_IF_ERROR(nextLine());
      const std::string_view line = trimmedLine(line_);
      if (line.empty() || line.starts_with('#')) continue;
      SURFEIT_RETURN_IF_ERROR(parseLine(line, has_data));
    }
    SURFEIT_RETURN_IF_ERROR(makeFields());
    SURFEIT_RETURN_IF_ERROR(makeCount());
    header_.data_offset = next_;
    header_.data_line = line_number_ + 1;
    return std::move(header_);
  }

 private:
  Status nextLine() {
    ++line_number_;
    const std::size_t end = text_.find('\n', next_);
    if (end == text_.npos) {
      return Status::corruption(
          fmt::format("{}: header line {}: found no line end in the first {} bytes, expected the "
                      "header up to 'DATA'",
                      path_, line_number_, text_.size()));
    }
    line_ = text_.substr(next_, end - next_);
    next_ = end + 1;
    return {};
  }

  Status unexpected(std::string_view expected) const {
    return Status::corruption(fmt::format("{}: header line {}: found {}, expected {}", path_,
                                          line_number_, quoteText(line_), expected));
  }

  Status parseLine(std::string_view line, bool& has_data) {
    std::vector<std::string_view> words = wordsOf(line, kMaxPcdValues + 2);
    const std::string_view key = words.front();
    words.erase(words.begin());
    if (key == "FIELDS" || key == "COLUMNS") {
      if (words.empty() || words.size() > kMaxPcdValues) {
        return unexpected(fmt::format("1 to {} names", kMaxPcdValues));
      }
      names_.assign(words.begin(), words.end());
      return {};
    }
    if (key == "SIZE") return parseNumbers(words, sizes_);
    if (key == "COUNT") return parseNumbers(words, counts_);
    if (key == "WIDTH") return parseNumber(words, width_);
    if (key == "HEIGHT") return parseNumber(words, height_);
    if (key == "POINTS") return parseNumber(words, points_);
    if (key == "TYPE") {
      types_.clear();
      for (const std::string_view word : words) {
        if (word != "F" && word != "I" && word != "U") return unexpected("types F, I or U");
        types_ += word;
      }
      return {};
    }
    if (key == "VERSION") {
      header_.version = words.empty() ? "" : quoteText(words.front());
      if (header_.version.size() > 2) {
        header_.version = header_.version.substr(1, header_.version.size() - 2);
      }
      return {};
    }
    if (key == "VIEWPOINT") {
      constexpr double kOrigin[] = {0, 0, 0, 1, 0, 0, 0};
      header_.has_view_point =
          !std::equal(words.begin(), words.end(), std::begin(kOrigin), std::end(kOrigin),
                      [](std::string_view word, double expected) {
                        std::byte value[8];
                        return parsePlyNumber(word, ValueType::kFloat64, value) &&
                               rowValue(value, ValueType::kFloat64) == expected;
                      });
      return {};
    }
    if (key == "DATA") {
      has_data = true;
      return parseData(words.empty() ? std::string_view() : words.front());
    }
    return unexpected(
        "VERSION, FIELDS, SIZE, TYPE, COUNT, WIDTH, HEIGHT, VIEWPOINT, POINTS or DATA");
  }

  Status parseData(std::string_view encoding) {
    header_.is_compressed = encoding == "binary_compressed";
    if (encoding != "ascii" && encoding != "binary" && !header_.is_compressed) {
      return unexpected("DATA ascii, binary or binary_compressed");
    }
    header_.is_text = encoding == "ascii";
    return {};
  }

  static bool toNumber(std::string_view word, std::uint64_t& number) {
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    return error == std::errc{} && end == word.data() + word.size();
  }
  Status parseNumber(std::span<const std::string_view> words,
                     std::optional<std::uint64_t>& number) const {
    std::uint64_t value = 0;
    if (words.size() != 1 || !toNumber(words[0], value)) return unexpected("a number below 2^64");
    number = value;
    return {};
  }
  Status parseNumbers(std::span<const std::string_view> words,
                      std::vector<std::uint64_t>& numbers) const {
    numbers.clear();
    for (const std::string_view word : words) {
      std::uint64_t number = 0;
      if (!toNumber(word, number)) return unexpected("numbers");
      numbers.push_back(number);
    }
    return {};
  }

  // Called at DATA, the line that errors name from here on.
  Status makeFields() {
    if (counts_.empty()) counts_.assign(names_.size(), 1);
    if (names_.empty() || sizes_.size() != names_.size() || types_.size() != names_.size() ||
        counts_.size() != names_.size()) {
      return unexpected(
          fmt::format("as many sizes, types and counts as fields before it ({}, {}, "
                      "{}, {})",
                      sizes_.size(), types_.size(), counts_.size(), names_.size()));
    }
    std::uint64_t values = 0, words = 0, bytes = 0;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      const std::optional<StoredType> type = storedTypeOf(types_[i], sizes_[i]);
      if (!type) {
        return unexpected(fmt::format("a known type for field {}, which has type {} and size {}",
                                      quoteText(names_[i]), types_[i], sizes_[i]));
      }
      if (counts_[i] > kMaxPcdRecordBytes) return tooLarge();
      PcdField field{names_[i], *type, static_cast<std::size_t>(counts_[i])};
      if (!field.isPadding()) values += counts_[i];
      if (header_.is_text) words += counts_[i];  // they are taken one by one, padding or not
      bytes += counts_[i] * sizes_[i];
      if (std::max(values, words) > kMaxPcdValues || bytes > kMaxPcdRecordBytes) return tooLarge();
      header_.fields.push_back(std::move(field));
    }
    if (values == 0) return unexpected("fields with values before it");
    return {};
  }

  Status tooLarge() const {
    return unexpected(fmt::format("points of at most {} values and {} bytes before it",
                                  kMaxPcdValues, kMaxPcdRecordBytes));
  }

  Status makeCount() {
    if (width_ && height_) {
      if (*height_ != 0 && *width_ > std::numeric_limits<std::uint64_t>::max() / *height_) {
        return unexpected("width times height below 2^64 before it");
      }
      const std::uint64_t count = *width_ * *height_;
      if (points_ && *points_ != count) {
        header_.grid_count = count;
      } else {
        points_ = count;
      }
    }
    if (!points_) return unexpected("POINTS, or WIDTH and HEIGHT, before it");
    header_.count = *points_;
    return {};
  }

  std::string_view text_;
  const std::string& path_;
  std::size_t next_ = 0;  // first byte of the next line
  std::uint64_t line_number_ = 0;
  std::string_view line_;
  std::vector<std::string> names_;
  std::vector<std::uint64_t> sizes_, counts_;
  std::string types_;
  std::optional<std::uint64_t> width_, height_, points_;
  PcdHeader header_;
};

}  // namespace

bool PcdField::isPackedColor() const {
  return (name == "rgb" || name == "rgba") && count == 1 && storedBytes(type) == 4;
}

bool recognisesPcd(std::string_view first_bytes) {
  if (first_bytes.starts_with("# .PCD")) return true;
  const bool begins_so = first_bytes.starts_with('#') || first_bytes.starts_with("VERSION ");
  return begins_so &&
         (first_bytes.find("\nFIELDS ") != first_bytes.npos ||
          first_bytes.find("\nCOLUMNS ") != first_bytes.npos) &&
         first_bytes.find("\nSIZE ") != first_bytes.npos;
}

Result<PcdHeader> readPcdHeader(ByteInput& input) {
  std::string text(kMaxHeaderBytes, '\0');
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                           input.readSome(0, std::as_writable_bytes(std::span(text))));
  text.resize(got);
  return HeaderParser(text, input.path()).parse();
}

}  // namespace surfeit
