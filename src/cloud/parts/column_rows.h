// Clouds that are stored attribute by attribute (Houdini's JSON geometry, PDB) as rows: for each
// block of rows every column is read at its own place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cloud/parts/counted_row_reader.h"
#include "cloud/parts/spooled_input.h"
#include "cloud/parts/stored_values.h"

namespace surfeit {

// How a column is cut into pages of `rows` rows, the last one shorter, and a page into slices, each
// with some of the components: page by page, slice by slice, row by row. A slice that has one value
// for all rows of a page may be stored once.
struct ColumnPages {
  std::uint64_t rows = 1;           // at least 1
  std::vector<std::size_t> slices;  // components, at least 1 each
  // By slice, by page; empty: none is constant.
  std::vector<std::vector<bool>> constant;
};

// The values of an attribute, all of one type.
struct Column {
  // In the file, or in the spool of the reader
  std::uint64_t offset = 0;
  bool is_spooled = false;
  StoredType type = StoredType::kFloat32;
  bool is_swapped = false;
  std::size_t components = 1;       // in the file
  std::size_t used_components = 1;  // the first so many go to rows
  std::size_t to = 0;               // of the first value in a row
  std::optional<ColumnPages> pages;

  std::size_t tupleBytes() const { return components * storedBytes(type); }
  // Bytes that the values of `rows` rows take.
  std::uint64_t bytes(std::uint64_t rows) const;
};

// Seekable. Readers of such formats derive from it, fill its protected members and those of
// CountedRowReader, and add columns whose bytes the file, or the spool, is known to have. Takes up
// to 4 MiB, or 16 KiB per column where that is more.
class ColumnRowReader : public CountedRowReader {
 public:
  bool isSeekable() const override { return true; }

 protected:
  explicit ColumnRowReader(SpooledInput input) : input_(std::move(input)) {}

  // After the last other column.
  void addColumn(Column column);
  Status decodeRows(std::size_t count, std::byte* rows) override;
  Status checkEnd() override { return input_.checkUnchanged(); }

  SpooledInput input_;
  std::optional<TemporaryFile> spool_;  // values that the file does not have in an array

 private:
  struct OpenColumn {
    Column column;
    // Of the page that was read last
    std::uint64_t page = 0, page_offset = 0;
    // Bytes [window_begin, window_begin + window.size()) of the file or the spool
    std::uint64_t window_begin = 0;
    Bytes window;
    AlignedBuffer buffer;
  };

  Status decodeFixed(OpenColumn& open, std::uint64_t row, std::size_t count, std::byte* rows);
  Status decodePaged(OpenColumn& open, std::uint64_t row, std::size_t count, std::byte* rows);
  Result<const std::byte*> readBytes(OpenColumn& open, std::uint64_t offset, std::size_t size);

  std::vector<OpenColumn> columns_;
};

}  // namespace surfeit
