#include "cloud/ply/ply_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

#include "cloud/ply/ply_cursor.h"
#include "cloud/ply/ply_number.h"
#include "cloud/ply/ply_positions.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxListItems = 1 << 20;
// Only so few bytes can be a line end rather than data.
constexpr std::size_t kMaxLineEnd = 2;
constexpr std::size_t kNoList = std::numeric_limits<std::size_t>::max();

}  // namespace

// Where in the file we are.
struct PlyReader::State {
  explicit State(ByteInput opened) : cursor(std::move(opened)) {}

  PlyCursor cursor;
  PlyHeader header;
  Status failure;  // of the last read, until the next seek

  std::size_t element_index = 0;
  std::uint64_t row = 0;
  std::vector<std::uint64_t> element_begin;  // offsets of the first elements, as far as known
  std::vector<std::byte> skipped_row;
  std::string_view token;

  ByteInput& file() { return cursor.file(); }
  const ByteInput& file() const { return cursor.file(); }
  const RowLayout& element() const { return header.elements[element_index]; }
  bool isAscii() const { return header.encoding == PlyEncoding::kAscii; }
  bool hasFixedRows() const { return !isAscii() && !element().hasLists(); }

  Status damaged(std::string_view what) const {
    return Status::corruption(
        fmt::format("{}: element {} row {}: {}", file().path(), element().name, row, what));
  }
  Status endsEarly(std::string_view expected) const {
    const std::optional<std::uint64_t> size = file().size();
    return damaged(fmt::format("file ends early: {} bytes, expected {}",
                               size.value_or(cursor.offset()), expected));
  }
  Status invalidCall(std::string_view what) const {
    return Status::invalidArgument(fmt::format("{}: {}", file().path(), what));
  }

  // What `read` returns, unless a read has failed before. A failure is kept for the next ones.
  template <typename Read>
  auto unlessFailed(Read read) -> decltype(read()) {
    SURFEIT_RETURN_IF_ERROR(failure);
    auto result = read();
    if (!result.ok()) failure = result.status();
    return result;
  }

  Status readBytes(std::span<std::byte> bytes) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, cursor.read(bytes));
    if (got < bytes.size()) return endsEarly(fmt::format("{} more", bytes.size() - got));
    return {};
  }

  Status skipBytes(std::uint64_t size) {
    const std::uint64_t offset = cursor.offset();
    if (const std::optional<std::uint64_t> file_size = file().size()) {
      if (size > *file_size - std::min(*file_size, offset)) {
        return endsEarly(fmt::format("{} bytes at {}", size, offset));
      }
      cursor.skip(size);
    } else if (size > 0) {
      // The last of the bytes must be there
      cursor.skip(size - 1);
      std::byte last;
      SURFEIT_RETURN_IF_ERROR(readBytes({&last, 1}));
    }
    return {};
  }

  // --- Ascii rows ---

  Status badToken(const RowProperty& property, ValueType type) const {
    SURFEIT_RETURN_IF_ERROR(cursor.failure());
    const std::string expected = fmt::format("{} of type {}", property.name, valueTypeName(type));
    if (!token.empty()) {
      std::byte value[8];
      std::string_view advice;
      if (token.find(',') != token.npos) {
        advice = ": PLY has points before decimals and no commas; write it with points";
      } else if (parsePlyNumber(token, ValueType::kFloat64, value)) {
        advice = ", which does not hold it: make it float in the header";
      }
      return damaged(fmt::format("found {}, expected {}{}", quoteText(token), expected, advice));
    }
    if (cursor.isAtEnd()) return endsEarly(expected);
    return damaged(fmt::format("line ends early, expected {}", expected));
  }

  Status readAsciiRow(std::byte* scalars, std::size_t wanted_list, std::vector<double>* list) {
    cursor.skipEmptyLines();
    const std::vector<RowProperty>& properties = element().properties;
    for (std::size_t i = 0; i < properties.size(); ++i) {
      // A scalar
      const RowProperty& property = properties[i];
      token = cursor.nextWord();
      if (!property.is_list) {
        if (!parsePlyNumber(token, property.type, scalars + property.offset)) {
          return badToken(property, property.type);
        }
        continue;
      }

      // The length of a list, then its items
      std::byte value[8];
      if (!parsePlyNumber(token, property.count_type, value)) {
        return badToken(property, property.count_type);
      }
      const bool is_wanted = i == wanted_list;
      SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t item_count,
                               listLength(property, value, is_wanted));
      for (std::uint64_t item = 0; item < item_count; ++item) {
        token = cursor.nextWord();
        if (!parsePlyNumber(token, property.type, value)) return badToken(property, property.type);
        if (is_wanted) list->push_back(rowValue(value, property.type));
      }
    }

    // A row with too many values is as wrong as one with too few
    token = cursor.nextWord();
    if (!token.empty()) {
      return damaged(fmt::format("found {}, expected the end of the line", quoteText(token)));
    }
    cursor.passLineEnd();
    return cursor.failure();
  }

  // --- Binary rows with lists ---

  Status readBinaryValue(ValueType type, std::byte* value, WideInteger wide = WideInteger::kNone) {
    SURFEIT_RETURN_IF_ERROR(readBytes({value, valueTypeBytes(type)}));
    if (needsByteSwap(header.encoding)) swapValue(value, type);
    widenValue(value, wide);
    return {};
  }

  Status readBinaryRow(std::byte* scalars, std::size_t wanted_list, std::vector<double>* list) {
    const std::vector<RowProperty>& properties = element().properties;
    for (std::size_t i = 0; i < properties.size(); ++i) {
      // A scalar
      const RowProperty& property = properties[i];
      if (!property.is_list) {
        SURFEIT_RETURN_IF_ERROR(
            readBinaryValue(property.type, scalars + property.offset, property.wide));
        continue;
      }

      // The length of a list, then its items
      std::byte value[8];
      SURFEIT_RETURN_IF_ERROR(readBinaryValue(property.count_type, value));
      const bool is_wanted = i == wanted_list;
      SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t item_count,
                               listLength(property, value, is_wanted));
      if (!is_wanted) {
        SURFEIT_RETURN_IF_ERROR(skipBytes(item_count * valueTypeBytes(property.type)));
        continue;
      }
      for (std::uint64_t item = 0; item < item_count; ++item) {
        SURFEIT_RETURN_IF_ERROR(readBinaryValue(property.type, value, property.wide));
        list->push_back(rowValue(value, property.type));
      }
    }
    return {};
  }

  Result<std::uint64_t> listLength(const RowProperty& property, const std::byte* value,
                                   bool is_wanted) const {
    const double length = rowValue(value, property.count_type);
    if (length < 0 || (is_wanted && length > kMaxListItems)) {
      return damaged(fmt::format("list {} has length {}, expected 0 to {}", property.name, length,
                                 is_wanted ? kMaxListItems : 0xffffffffu));
    }
    return static_cast<std::uint64_t>(length);
  }

  // --- Elements ---

  // Reads one row; the caller has made sure that there is one.
  Status readRow(std::byte* scalars, std::size_t wanted_list, std::vector<double>* list) {
    SURFEIT_RETURN_IF_ERROR(isAscii() ? readAsciiRow(scalars, wanted_list, list)
                                      : readBinaryRow(scalars, wanted_list, list));
    ++row;
    return {};
  }

  // At the end of an element, notes where the next begins; the last must end with the file.
  Status endElement() {
    if (row < element().count) return {};
    SURFEIT_RETURN_IF_ERROR(file().checkUnchanged());
    if (element_begin.size() > element_index + 1) return {};
    const std::uint64_t next_begin = cursor.offset();
    const bool is_last =
        std::all_of(header.elements.begin() + static_cast<std::ptrdiff_t>(element_index) + 1,
                    header.elements.end(), [](const RowLayout& later) { return later.count == 0; });
    if (is_last) SURFEIT_RETURN_IF_ERROR(checkEnd());
    element_begin.push_back(next_begin);
    return {};
  }

  Status checkEnd() {
    const std::uint64_t begin = cursor.offset();
    const std::optional<std::uint64_t> size = file().size();
    if (size && begin >= *size) return {};
    if (!size && !isAscii()) return checkCompressedEnd();
    if (isAscii() || *size - begin <= kMaxLineEnd) cursor.skipEmptyLines();
    SURFEIT_RETURN_IF_ERROR(cursor.failure());
    if (size ? cursor.offset() >= *size : cursor.isAtEnd()) return {};
    return notTheEnd(size ? fmt::format("{} bytes", *size - cursor.offset()) : "bytes",
                     cursor.offset());
  }

  // Reads to the end of the file, so that its checksum is seen, too.
  Status checkCompressedEnd() {
    const std::uint64_t begin = cursor.offset();
    std::array<std::byte, kMaxLineEnd + 1> bytes;
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, cursor.read(bytes));
    const bool is_line_end = std::all_of(
        bytes.begin(), bytes.begin() + std::ptrdiff_t(size),
        [](std::byte byte) { return byte == std::byte{'\n'} || byte == std::byte{'\r'}; });
    if (size <= kMaxLineEnd && is_line_end) return {};
    return notTheEnd("bytes", begin);
  }

  Status notTheEnd(std::string_view found, std::uint64_t offset) const {
    return Status::corruption(fmt::format(
        "{}: {} at {} after the last element, expected the end of the file: the header "
        "counts fewer rows{}",
        file().path(), found, offset,
        isAscii() ? ""
                  : ", or it was written or copied in text mode, which puts a byte 13 in "
                    "front of each byte 10: save or copy it in binary mode"));
  }

  // What the file can hold bounds every count before anyone uses it; sums cannot overflow later.
  Status checkCounts() {
    // More than any disk holds stands for a size that is not known
    constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 62;
    const std::uint64_t size = file().size().value_or(kMostBytes);
    std::uint64_t left = size - std::min(size, header.data_offset);
    bool is_fixed_size = !isAscii();
    for (element_index = 0; element_index < header.elements.size(); ++element_index) {
      // An ascii value takes a digit and a blank; a list takes its length at least
      std::uint64_t least_row_bytes = element().row_bytes;
      for (const RowProperty& property : element().properties) {
        if (property.is_list) least_row_bytes += valueTypeBytes(property.count_type);
      }
      if (isAscii()) least_row_bytes = 2 * element().properties.size();
      if (least_row_bytes == 0) continue;  // and no rows either
      // The last line may lack its end
      const std::uint64_t rows_that_fit = (left + (isAscii() ? 1 : 0)) / least_row_bytes;
      if (element().count > rows_that_fit) {
        row = rows_that_fit;
        return damaged(
            fmt::format("file ends early: {} bytes hold at most {} rows of {}{} bytes, expected {}",
                        left, rows_that_fit, isAscii() || element().hasLists() ? "at least " : "",
                        least_row_bytes, element().count));
      }
      left -= std::min(left, element().count * least_row_bytes);
      is_fixed_size = is_fixed_size && !element().hasLists();
    }
    element_index = 0;

    // With rows of fixed size the end is known at once
    if (is_fixed_size && !file().isCompressed()) {
      cursor.jumpTo(size - left);
      SURFEIT_RETURN_IF_ERROR(checkEnd());
    }
    return {};
  }

  Status seekElement(std::size_t index) {
    // Start at the last element whose place is known, or go on from here when inside it
    const std::size_t known = std::min(index, element_begin.size() - 1);
    if (known != element_index || known == index || !failure.ok()) {
      cursor.jumpTo(element_begin[known]);
      element_index = known;
      row = 0;
      failure = {};
    }

    // Rows of fixed size are passed by arithmetic, others must be read
    while (element_index < index) {
      if (hasFixedRows()) {
        SURFEIT_RETURN_IF_ERROR(skipBytes((element().count - row) * element().row_bytes));
        row = element().count;
      }
      skipped_row.resize(element().row_bytes);
      while (row < element().count) {
        SURFEIT_RETURN_IF_ERROR(readRow(skipped_row.data(), kNoList, nullptr));
      }
      SURFEIT_RETURN_IF_ERROR(endElement());
      ++element_index;
      row = 0;
    }
    return {};
  }

  Result<std::size_t> readRows(std::span<std::byte> rows) {
    const std::size_t row_bytes = element().row_bytes;
    const std::size_t row_count = static_cast<std::size_t>(
        std::min<std::uint64_t>(element().count - row, rows.size() / row_bytes));
    rows = rows.first(row_count * row_bytes);
    if (!hasFixedRows()) {
      for (std::size_t i = 0; i < row_count; ++i) {
        SURFEIT_RETURN_IF_ERROR(readRow(rows.data() + i * row_bytes, kNoList, nullptr));
      }
    } else {
      // The rows of the file are the packed rows
      SURFEIT_RETURN_IF_ERROR(readBytes(rows));
      if (needsByteSwap(header.encoding)) swapRows(element(), rows);
      widenRows(element(), rows);
      row += row_count;
    }
    SURFEIT_RETURN_IF_ERROR(endElement());
    return row_count;
  }

  Result<Bytes> readRowView(std::size_t max_rows, AlignedBuffer& view_buffer) {
    const std::size_t row_bytes = element().row_bytes;
    const std::size_t row_count =
        static_cast<std::size_t>(std::min<std::uint64_t>(element().count - row, max_rows));
    const std::size_t size = row_count * row_bytes;
    if (!hasFixedRows()) {
      view_buffer.reserve(size);
      const std::span<std::byte> rows(view_buffer.data(), size);
      SURFEIT_RETURN_IF_ERROR(readRows(rows).status());
      return Bytes(rows);
    }

    // The rows of the file are the packed rows
    const std::uint64_t at = cursor.offset();
    SURFEIT_ASSIGN_OR_RETURN(const Bytes view, file().readView(at, size, view_buffer));
    if (view.size() < size) {
      row += view.size() / row_bytes;
      return damaged(
          fmt::format("file ends early: {} bytes at {}, expected {}", view.size(), at, size));
    }
    if (size > 0) {
      const std::span rows(view_buffer.data() + (view.data() - view_buffer.data()), size);
      if (needsByteSwap(header.encoding)) swapRows(element(), rows);
      widenRows(element(), rows);
    }
    cursor.jumpTo(at + size);
    row += row_count;
    SURFEIT_RETURN_IF_ERROR(endElement());
    return view;
  }

  void seekRow(std::uint64_t new_row) {
    row = new_row;
    cursor.jumpTo(element_begin[element_index] + row * element().row_bytes);
    failure = {};
  }

  Result<bool> readRowWithList(std::span<std::byte> scalars, std::size_t list_property,
                               std::vector<double>& list) {
    list.clear();
    const bool has_row = row < element().count;
    if (has_row) SURFEIT_RETURN_IF_ERROR(readRow(scalars.data(), list_property, &list));
    SURFEIT_RETURN_IF_ERROR(endElement());
    return has_row;
  }
};

Result<PlyReader> PlyReader::open(const std::string& path, Access access) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput file, ByteInput::open(path, access));
  auto state = std::make_unique<State>(std::move(file));
  SURFEIT_ASSIGN_OR_RETURN(state->header, readPlyHeader(state->file()));
  SURFEIT_RETURN_IF_ERROR(widenPositions(state->file(), state->header));
  SURFEIT_RETURN_IF_ERROR(state->checkCounts());
  state->element_begin = {state->header.data_offset};
  state->cursor.jumpTo(state->header.data_offset);
  state->row = 0;
  return PlyReader(std::move(state));
}

PlyReader::PlyReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
PlyReader::PlyReader(PlyReader&&) noexcept = default;
PlyReader& PlyReader::operator=(PlyReader&&) noexcept = default;
PlyReader::~PlyReader() = default;

const std::string& PlyReader::path() const { return state_->file().path(); }

const PlyHeader& PlyReader::header() const { return state_->header; }

Status PlyReader::seekElement(std::size_t index) {
  if (index >= state_->header.elements.size()) {
    return state_->invalidCall(
        fmt::format("seek to element {} of {}", index, state_->header.elements.size()));
  }
  Status status = state_->seekElement(index);
  if (!status.ok()) state_->failure = status;
  return status;
}

Result<std::size_t> PlyReader::readRows(std::span<std::byte> rows) {
  if (state_->header.elements.empty()) return state_->invalidCall("no element to read");
  const std::size_t row_bytes = state_->element().row_bytes;
  if (row_bytes == 0 || rows.size() < row_bytes) {
    return state_->invalidCall(
        fmt::format("room for {} bytes given to read rows of {} bytes", rows.size(), row_bytes));
  }
  return state_->unlessFailed([&] { return state_->readRows(rows); });
}

Result<Bytes> PlyReader::readRowView(std::size_t max_rows, AlignedBuffer& buffer) {
  if (state_->header.elements.empty()) return state_->invalidCall("no element to read");
  if (state_->element().row_bytes == 0 || max_rows == 0) {
    return state_->invalidCall(
        fmt::format("{} rows of {} bytes asked for", max_rows, state_->element().row_bytes));
  }
  return state_->unlessFailed([&] { return state_->readRowView(max_rows, buffer); });
}

bool PlyReader::hasFixedRows() const {
  return !state_->header.elements.empty() && state_->hasFixedRows() &&
         !state_->file().isCompressed();
}

Status PlyReader::seekRow(std::uint64_t row) {
  if (!hasFixedRows() || row > state_->element().count) {
    return state_->invalidCall(
        fmt::format("seek to row {}, expected an element of fixed rows, at least as many", row));
  }
  state_->seekRow(row);
  return {};
}

Result<bool> PlyReader::readRowWithList(std::span<std::byte> scalars, std::size_t list_property,
                                        std::vector<double>& list) {
  if (state_->header.elements.empty()) return state_->invalidCall("no element to read");
  const RowLayout& element = state_->element();
  if (scalars.size() < element.row_bytes || list_property >= element.properties.size() ||
      !element.properties[list_property].is_list) {
    return state_->invalidCall(
        fmt::format("property {} of element {} read as a list, with {} "
                    "bytes for {} bytes of scalars",
                    list_property, element.name, scalars.size(), element.row_bytes));
  }
  return state_->unlessFailed(
      [&] { return state_->readRowWithList(scalars, list_property, list); });
}

}  // namespace surfeit
