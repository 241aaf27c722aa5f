#include "cloud/ply/ply_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <set>
#include <utility>

namespace surfeit {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";
constexpr std::size_t kUsualHeaderBytes = 16 << 10;

constexpr const char* kElementNames[] = {"vertex", "point", "points", "surfel"};

// Takes the first word off the line; empty at its end.
std::string_view takeWord(std::string_view& line) {
  const std::size_t begin = std::min(line.find_first_not_of(kBlanks), line.size());
  const std::size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

std::string_view encodingName(PlyEncoding encoding) {
  switch (encoding) {
    case PlyEncoding::kAscii:
      return "ascii";
    case PlyEncoding::kBinaryLittleEndian:
      return "binary_little_endian";
    case PlyEncoding::kBinaryBigEndian:
      break;
  }
  return "binary_big_endian";
}

// Of programs that write types which the format does not have.
WideInteger wideIntegerFromName(std::string_view name) {
  if (name == "int64" || name == "long" || name == "longlong") return WideInteger::kSigned;
  if (name == "uint64" || name == "ulong" || name == "ulonglong") return WideInteger::kUnsigned;
  return WideInteger::kNone;
}

std::optional<PlyEncoding> encodingFromName(std::string_view name) {
  for (const PlyEncoding encoding :
       {PlyEncoding::kAscii, PlyEncoding::kBinaryLittleEndian, PlyEncoding::kBinaryBigEndian}) {
    if (name == encodingName(encoding)) return encoding;
  }
  return std::nullopt;
}

// Reads the header line by line; each handler gets the words after its keyword.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, const std::string& path) : text_(text), path_(path) {}

  Result<PlyHeader> parse() {
    // Old programs end lines with CR alone
    const std::size_t first_end = text_.find_first_of("\r\n");
    const bool is_cr = first_end != text_.npos && text_[first_end] == '\r' &&
                       text_.substr(first_end + 1, 1) != "\n";
    line_end_ = is_cr ? '\r' : '\n';
    SURFEIT_RETURN_IF_ERROR(nextLine());
    if (line_.substr(0, line_.find_last_not_of(kBlanks) + 1) != "ply") return unexpected("'ply'");
    for (;;) {
      SURFEIT_RETURN_IF_ERROR(nextLine());
      std::string_view rest = line_;
      const std::string_view keyword = takeWord(rest);
      if (keyword == "end_header") {
        if (!trimmed(rest).empty()) return unexpected("nothing after 'end_header'");
        break;
      }
      SURFEIT_RETURN_IF_ERROR(parseLine(keyword, rest));
    }
    SURFEIT_RETURN_IF_ERROR(finishElement());
    if (!has_format_) return unexpected("a 'format' line before it");
    header_.data_offset = next_;
    return std::move(header_);
  }

 private:
  Status parseLine(std::string_view keyword, std::string_view rest) {
    if (keyword.empty()) return {};
    if (keyword == "obj_info" && !trimmed(rest).empty()) {
      header_.comments.push_back(fmt::format("obj_info {}", trimmed(rest)));
    }
    if (keyword == "obj_info") return {};
    if (keyword == "comment") {
      if (!trimmed(rest).empty()) header_.comments.emplace_back(trimmed(rest));
      return {};
    }
    if (keyword == "format") return parseFormat(rest);
    if (keyword == "element") return parseElement(rest);
    if (keyword == "property") return parseProperty(rest);
    return unexpected("'format', 'comment', 'obj_info', 'element', 'property' or 'end_header'");
  }

  Status parseFormat(std::string_view rest) {
    const std::optional<PlyEncoding> encoding = encodingFromName(takeWord(rest));
    if (has_format_) return unexpected("a single 'format' line");
    if (!encoding || trimmed(rest) != "1.0") {
      return unexpected(
          "'format' with 'ascii', 'binary_little_endian' or 'binary_big_endian', then '1.0'");
    }
    header_.encoding = *encoding;
    has_format_ = true;
    return {};
  }

  Status parseElement(std::string_view rest) {
    SURFEIT_RETURN_IF_ERROR(finishElement());
    RowLayout element;
    element.name = takeWord(rest);
    const std::string_view count = takeWord(rest);
    const char* const count_end = count.data() + count.size();
    const auto [end, error] = std::from_chars(count.data(), count_end, element.count);
    if (!isPropertyName(element.name) || error != std::errc{} || end != count_end ||
        !trimmed(rest).empty()) {
      return unexpected("'element', a name and a count below 2^64");
    }
    if (!element_names_.insert(element.name).second) return unexpected("a new element name");
    header_.elements.push_back(std::move(element));
    property_names_.clear();
    return {};
  }

  Status parseProperty(std::string_view rest) {
    if (header_.elements.empty()) return unexpected("an 'element' line first");
    RowProperty property;
    std::string_view type_name = takeWord(rest);
    if (type_name == "list") {
      property.is_list = true;
      const std::optional<ValueType> count_type = valueTypeFromName(takeWord(rest));
      if (!count_type || isFloatType(*count_type)) {
        return unexpected("an integer type for the length of the list");
      }
      property.count_type = *count_type;
      type_name = takeWord(rest);
    }
    property.wide = wideIntegerFromName(type_name);
    const std::optional<ValueType> type =
        property.wide == WideInteger::kNone ? valueTypeFromName(type_name) : ValueType::kFloat64;
    if (!type) {
      return unexpected(
          "a type: char, uchar, short, ushort, int, uint, int64, uint64, float or double");
    }
    property.type = *type;
    property.name = takeWord(rest);
    if (!isPropertyName(property.name) || !trimmed(rest).empty())
      return unexpected("one property name");
    if (!property_names_.insert(property.name).second) {
      return unexpected(fmt::format("a new property name for element {}",
                                    quoteText(header_.elements.back().name)));
    }
    header_.elements.back().properties.push_back(std::move(property));
    return {};
  }

  // Rows without values would make a count that the file's size cannot bound.
  Status finishElement() {
    if (header_.elements.empty()) return {};
    RowLayout& element = header_.elements.back();
    if (element.properties.empty() && element.count > 0) {
      return unexpected(fmt::format("a 'property' line for element {} of {} rows",
                                    quoteText(element.name), element.count));
    }
    packRow(element);
    return {};
  }

  Status nextLine() {
    ++line_number_;
    const std::size_t end = text_.find(line_end_, next_);
    if (end == std::string_view::npos) {
      return Status::corruption(
          fmt::format("{}: header line {}: found no line end in the first {} bytes, expected {}",
                      path_, line_number_, text_.size(),
                      line_number_ == 1 ? "'ply'" : "the header up to 'end_header'"));
    }
    line_ = text_.substr(next_, end - next_);
    if (line_.ends_with('\r')) line_.remove_suffix(1);
    next_ = end + 1;
    return {};
  }

  Status unexpected(std::string_view expected) const {
    return Status::corruption(fmt::format("{}: header line {}: found {}, expected {}", path_,
                                          line_number_, quoteText(line_), expected));
  }

  std::string_view text_;
  const std::string& path_;
  char line_end_ = '\n';
  std::size_t next_ = 0;  // first byte of the next line
  std::uint64_t line_number_ = 0;
  std::string_view line_;
  PlyHeader header_;
  bool has_format_ = false;
  // A header of 1 MiB may declare 60000 properties: sets keep the check for twins cheap
  std::set<std::string> element_names_, property_names_;
};

}  // namespace

std::optional<std::size_t> PlyHeader::findElement(std::string_view element) const {
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (elements[i].name == element) return i;
  }
  return std::nullopt;
}

Result<std::size_t> findSurfelElement(const PlyHeader& header, const std::string& path) {
  const std::vector<RowLayout>& elements = header.elements;
  std::optional<std::size_t> empty;
  for (const char* name : kElementNames) {
    const std::optional<std::size_t> index = header.findElement(name);
    if (index && elements[*index].count > 0) return *index;
    if (!empty) empty = index;
  }
  if (empty) return *empty;
  return Status::corruption(fmt::format(
      "{}: found {} elements, first {}, expected one named vertex, point, points or surfel{}", path,
      elements.size(), elements.empty() ? "none" : elements.front().name,
      elements.empty() ? "" : " (--part " + elements.front().name + " takes that one)"));
}

Result<PlyHeader> parsePlyHeader(std::string_view text, const std::string& path) {
  return HeaderParser(text.substr(0, kMaxPlyHeaderBytes), path).parse();
}

Result<PlyHeader> readPlyHeader(ByteInput& file) {
  // Headers are short; only one that does not parse gets the room that it may have at most
  for (std::size_t most = kUsualHeaderBytes;; most = kMaxPlyHeaderBytes) {
    std::string text(most, '\0');
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                             file.readSome(0, std::as_writable_bytes(std::span(text))));
    text.resize(got);
    Result<PlyHeader> header = parsePlyHeader(text, file.path());
    if (header.ok() || got < most || most == kMaxPlyHeaderBytes) return header;
  }
}

std::string formatPlyHeader(const PlyHeader& header) {
  std::string text = fmt::format("ply\nformat {} 1.0\n", encodingName(header.encoding));
  for (std::string comment : header.comments) {
    std::replace_if(
        comment.begin(), comment.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
    text += fmt::format("comment {}\n", comment);
  }
  for (const RowLayout& element : header.elements) {
    text += fmt::format("element {} {}\n", element.name, element.count);
    for (const RowProperty& property : element.properties) {
      const std::string list =
          property.is_list ? fmt::format("list {} ", valueTypeName(property.count_type)) : "";
      text += fmt::format("property {}{} {}\n", list, valueTypeName(property.type), property.name);
    }
  }
  return text + "end_header\n";
}

bool needsByteSwap(PlyEncoding encoding) {
  if (encoding == PlyEncoding::kAscii) return false;
  return (encoding == PlyEncoding::kBinaryLittleEndian) !=
         (std::endian::native == std::endian::little);
}

}  // namespace surfeit
