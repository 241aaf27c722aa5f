// Rows that a caller has in memory, as a cloud to read.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "cloud/rows/row_reader.h"

namespace surfeit {

class MemoryRows : public RowReader {
 public:
  const RowLayout& element() const override { return layout_; }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    const auto count =
        static_cast<std::size_t>(std::min<std::uint64_t>(max_rows, layout_.count - next_));
    if (count == 0) return Bytes();
    buffer.reserve(count * layout_.row_bytes);
    SURFEIT_RETURN_IF_ERROR(pack(next_, count, buffer.data()));
    next_ += count;
    return Bytes(buffer.data(), count * layout_.row_bytes);
  }
  Status rewind() override { return seekRow(0); }
  bool isSeekable() const override { return true; }
  Status seekRow(std::uint64_t row) override {
    next_ = row;
    return {};
  }

 protected:
  explicit MemoryRows(RowLayout layout) : layout_(std::move(layout)) {}

  const RowLayout layout_;

 private:
  // Writes rows from `first` on, as the layout has them.
  virtual Status pack(std::uint64_t first, std::size_t count, std::byte* rows) = 0;

  std::uint64_t next_ = 0;
};

}  // namespace surfeit
