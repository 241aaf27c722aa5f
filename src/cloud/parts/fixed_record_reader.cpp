#include "cloud/parts/fixed_record_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "cloud/parts/bytes_behind.h"
#include "cloud/parts/counted_row_reader.h"
#include "core/assert.h"

namespace surfeit {
namespace {

// Records that are read at once: they stay in the second-level cache until they are decoded
constexpr std::size_t kReadBytes = 512 << 10;

}  // namespace

Status FixedRecordReader::setRecords(std::uint64_t data_offset, std::size_t record_bytes) {
  SURFEIT_CHECK(record_bytes > 0 && element_.row_bytes > 0);
  data_offset_ = data_offset;
  record_bytes_ = record_bytes;
  if (!input_.size()) return {};
  const std::uint64_t data_bytes = *input_.size() - std::min(*input_.size(), data_offset);
  if (data_bytes / record_bytes >= element_.count) return {};
  return Status::corruption(fmt::format(
      "{}: file ends early: {} bytes at {} hold {} records of {} bytes, expected {}", path(),
      data_bytes, data_offset, data_bytes / record_bytes, record_bytes, element_.count));
}

std::uint64_t FixedRecordReader::trailingBytes() const {
  const std::uint64_t end = data_offset_ + element_.count * record_bytes_;
  return input_.size() ? *input_.size() - std::min(*input_.size(), end) : 0;
}

Result<Bytes> FixedRecordReader::readRows(std::size_t max_rows, AlignedBuffer& buffer) {
  SURFEIT_RETURN_IF_ERROR(failure_);
  if (max_rows == 0) {
    return Status::invalidArgument(fmt::format("{}: no rows asked for", path()));
  }
  Result<Bytes> rows = readNext(max_rows, buffer);
  if (!rows.ok()) failure_ = rows.status();
  return rows;
}

Result<Bytes> FixedRecordReader::readNext(std::size_t max_rows, AlignedBuffer& buffer) {
  const std::size_t row_bytes = element_.row_bytes;
  const std::size_t most =
      std::min(max_rows, std::numeric_limits<std::size_t>::max() / 4 / row_bytes);
  const auto row_count =
      static_cast<std::size_t>(std::min<std::uint64_t>(element_.count - next_row_, most));
  if (row_count == 0) return Bytes();

  Bytes rows;
  if (areRecordsRows() && !input_.isCompressed()) {
    SURFEIT_ASSIGN_OR_RETURN(rows, readRecords(row_count, buffer));
  } else {
    // The size of the file has proven the count; only a compressed one may still lie
    const std::size_t size = row_count * row_bytes;
    buffer.reserve(input_.isCompressed() ? std::min(size, kUnprovenBytes) : size);
    const std::size_t block_rows = std::max<std::size_t>(1, kReadBytes / record_bytes_);
    for (std::size_t done = 0; done < row_count;) {
      const std::size_t count = std::min(block_rows, row_count - done);
      SURFEIT_ASSIGN_OR_RETURN(const Bytes records, readRecords(count, records_));
      const std::size_t needed = (done + count) * row_bytes;
      if (needed > buffer.capacity()) {
        growBuffer(buffer, done * row_bytes, std::min(size, 2 * needed));
      }
      decodeRecords(records.data(), count, buffer.data() + done * row_bytes);
      done += count;
    }
    rows = Bytes(buffer.data(), size);
  }
  if (next_row_ == element_.count) SURFEIT_RETURN_IF_ERROR(checkEnd());
  return rows;
}

Status FixedRecordReader::checkEnd() {
  if (refuses_bytes_behind_) {
    const std::uint64_t end = data_offset_ + element_.count * record_bytes_;
    SURFEIT_RETURN_IF_ERROR(checkNothingBehind(input_, end, "point"));
  }
  return input_.checkUnchanged();
}

Result<Bytes> FixedRecordReader::readRecords(std::size_t count, AlignedBuffer& buffer) {
  const std::uint64_t at = data_offset_ + next_row_ * record_bytes_;
  const std::size_t size = count * record_bytes_;
  SURFEIT_ASSIGN_OR_RETURN(const Bytes view, input_.readView(at, size, buffer));
  if (view.size() < size) {
    const std::uint64_t record = next_row_ + view.size() / record_bytes_;
    return Status::corruption(
        fmt::format("{}: record {}: file ends early: {} bytes at {}, expected {}", path(), record,
                    view.size(), at, size));
  }
  next_row_ += count;
  return view;
}

Status FixedRecordReader::rewind() {
  next_row_ = 0;
  failure_ = {};
  return {};
}

Status FixedRecordReader::seekRow(std::uint64_t row) {
  if (!isSeekable() || row > element_.count) {
    return Status::invalidArgument(fmt::format("{}: seek to row {} of {}{}", path(), row,
                                               element_.count,
                                               isSeekable() ? "" : " in a compressed file"));
  }
  next_row_ = row;
  failure_ = {};
  return {};
}

}  // namespace surfeit
