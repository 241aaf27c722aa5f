// What formats of fixed records have in common (PTC, LAS, binary PCD): records of one size stand
// one behind the other from some offset on, and each becomes a row by itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "cloud/rows/row_reader.h"
#include "storage/byte_input.h"

namespace surfeit {

// A reader as RowReader says. Seekable unless the file is compressed; takes 512 KiB, or a record
// where that is more. Formats derive from it, fill element_ and call setRecords once.
class FixedRecordReader : public RowReader {
 public:
  const std::string& path() const override { return input_.path(); }
  const RowLayout& element() const override { return element_; }
  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override;
  Status rewind() override;
  bool isSeekable() const override { return !input_.isCompressed(); }
  Status seekRow(std::uint64_t row) override;

 protected:
  explicit FixedRecordReader(ByteInput input) : input_(std::move(input)) {}

  // Where records begin and what each takes (at least 1 byte). kCorruption when the file is not
  // compressed and too short for element_.count of them; the size of a compressed one is seen as it
  // is read.
  Status setRecords(std::uint64_t data_offset, std::size_t record_bytes);
  // Bytes behind the last record; 0 when the file is compressed.
  std::uint64_t trailingBytes() const;
  // From now on, bytes behind the last record of a compressed file are refused when it is reached:
  // only then they show.
  void refuseBytesBehind() { refuses_bytes_behind_ = true; }
  // Turns `count` records into rows of element_.
  virtual void decodeRecords(const std::byte* records, std::size_t count,
                             std::byte* rows) const = 0;
  // Whether records are rows as they stand: then they are not copied, nor decodeRecords called.
  virtual bool areRecordsRows() const { return false; }

  ByteInput input_;
  RowLayout element_;

 private:
  Result<Bytes> readNext(std::size_t max_rows, AlignedBuffer& buffer);
  Status checkEnd();
  // A view of the next records, all of them.
  Result<Bytes> readRecords(std::size_t count, AlignedBuffer& buffer);

  std::uint64_t data_offset_ = 0;
  std::size_t record_bytes_ = 1;
  std::uint64_t next_row_ = 0;
  bool refuses_bytes_behind_ = false;
  Status failure_;  // of the last read, until the next seek
  AlignedBuffer records_;
};

}  // namespace surfeit
