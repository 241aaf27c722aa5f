#include "cloud/parts/counted_row_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace surfeit {

void growBuffer(AlignedBuffer& buffer, std::size_t used, std::size_t bytes) {
  if (bytes <= buffer.capacity()) return;
  AlignedBuffer larger(bytes);
  if (used > 0) std::memcpy(larger.data(), buffer.data(), used);
  buffer = std::move(larger);
}

Status CountedRowReader::readTo(std::size_t count, AlignedBuffer& buffer) {
  // The count of a compressed file may lie: room doubles as rows prove to be there
  const std::size_t row_bytes = element_.row_bytes;  // 0 when all channels are dropped
  std::size_t room = std::min(count, kUnprovenBytes / std::max<std::size_t>(1, row_bytes) + 1);
  buffer.reserve(room * row_bytes);
  for (std::size_t done = 0; done < count; room = std::min(count, 2 * room)) {
    growBuffer(buffer, done * row_bytes, room * row_bytes);
    SURFEIT_RETURN_IF_ERROR(decodeRows(room - done, buffer.data() + done * row_bytes));
    row_ += room - done;
    done = room;
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
  end_checked_ = false;
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
