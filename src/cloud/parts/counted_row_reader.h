// What readers of rows have in common: where they are, that a failure stays, and that the end is
// looked at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/row_reader.h"

namespace surfeit {

// Rows of a count that may lie are given so much room before their bytes have been seen.
inline constexpr std::size_t kUnprovenBytes = 16 << 20;
// Makes room for `bytes` in a buffer and keeps the first `used` bytes of it. Throws std::bad_alloc.
void growBuffer(AlignedBuffer& buffer, std::size_t used, std::size_t bytes);

// A reader whose count is known when it is made. What derives from it only decodes.
class CountedRowReader : public RowReader {
 public:
  const std::string& path() const override { return path_; }
  std::string formatName() const override { return format_name_; }
  const RowLayout& element() const override { return element_; }
  std::vector<std::string> comments() const override { return comments_; }
  std::vector<std::string> notes() const override { return notes_; }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) final;
  Status rewind() final;
  Status seekRow(std::uint64_t row) final;

 protected:
  // Decodes the next `count` rows, at least 1 and no more than are left, to `rows`.
  virtual Status decodeRows(std::size_t count, std::byte* rows) = 0;
  // The next decodeRows begins with `row`, which is 0 unless isSeekable(). For readers that go on
  // from where they are; others go by row().
  virtual Status moveTo(std::uint64_t) { return {}; }
  // Called when the last row has been decoded: whether the file ends as it should.
  virtual Status checkEnd() { return {}; }

  // Of the row that decodeRows decodes next.
  std::uint64_t row() const { return row_; }
  // kCorruption: "PATH: row N: WHAT", "PATH: byte N: WHAT".
  Status damagedRow(std::uint64_t row, std::string_view what) const;
  Status damagedAt(std::uint64_t offset, std::string_view what) const;

  std::string path_, format_name_;
  RowLayout element_;
  std::vector<std::string> comments_, notes_;

 private:
  Status readTo(std::size_t count, AlignedBuffer& buffer);

  std::uint64_t row_ = 0;
  bool end_checked_ = false;
  Status failure_;
};

}  // namespace surfeit
