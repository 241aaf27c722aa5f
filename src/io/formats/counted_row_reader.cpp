#include "io/formats/counted_row_reader.h"

#include <fmt/format.h>

#include <algorithm>

namespace surfeit {

Status CountedRowReader::readTo(std::size_t count, AlignedBuffer& buffer) {
  if (count > 0) {
    buffer.reserve(count * element_.row_bytes);
    SURFEIT_RETURN_IF_ERROR(decodeRows(count, buffer.data()));
    row_ += count;
  }
  if (row_ == element_.count && !end_checked_) {
    SURFEIT_RETURN_IF_ERROR(checkEnd());
    end_checked_ = true;
  }
  return {};
}

Result<Bytes> CountedRowReader::readRows(std::size_t max_rows, AlignedBuffer& buffer) {
  SURFEIT_RETURN_IF_ERROR(failure_);
  const auto count =
      static_cast<std::size_t>(std::min<std::uint64_t>(element_.count - row_, max_rows));
  failure_ = readTo(count, buffer);
  SURFEIT_RETURN_IF_ERROR(failure_);
  return Bytes(buffer.data(), count * element_.row_bytes);
}

Status CountedRowReader::rewind() {
  row_ = 0;
  failure_ = moveTo(0);
  return failure_;
}

Status CountedRowReader::seekRow(std::uint64_t row) {
  if (!isSeekable() || row > element_.count) {
    return Status::invalidArgument(fmt::format("{}: seek to row {} of {} rows{}", path_, row,
                                               element_.count,
                                               isSeekable() ? "" : ", which cannot be sought"));
  }
  row_ = row;
  failure_ = moveTo(row);
  return failure_;
}

Status CountedRowReader::damagedAt(std::uint64_t offset, std::string_view what) const {
  return Status::corruption(fmt::format("{}: byte {}: {}", path_, offset, what));
}

Status CountedRowReader::damagedRow(std::uint64_t row, std::string_view what) const {
  return Status::corruption(fmt::format("{}: row {}: {}", path_, row, what));
}

}  // namespace surfeit
