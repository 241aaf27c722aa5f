// Streams the rows of a PLY file, ascii or binary of either endianness, plain or compressed,
// without ever holding more than a small buffer. Row counts are 64 bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cloud/ply/ply_format.h"
#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// Reads elements in the order of the file. One thread at a time; the buffer takes 256 KiB. Every
// message names the file, the element and the row, counted from 0. A file that ends early, has
// bytes after its last element (a final newline is fine) or holds a token that is no number of its
// type is kCorruption. open refuses counts that the size of the file cannot hold, before anything
// is allocated; bytes after the last element are noticed there when all rows have a fixed size,
// else when the last row has been read. The size of what is compressed is not known: there both
// show when the rows are read. A file that was written to since open is kCorruption when the last
// row of an element has been read. After a failure every read fails the same way until seekElement
// or seekRow. In ascii files a row is a line; empty lines are skipped.
class PlyReader {
 public:
  // With kDirect, readRowView of fixed rows goes past the page cache; all else is cached.
  static Result<PlyReader> open(const std::string& path, Access access = Access::kCached);
  PlyReader(PlyReader&&) noexcept;
  PlyReader& operator=(PlyReader&&) noexcept;
  ~PlyReader();

  const std::string& path() const;
  const PlyHeader& header() const;

  // Moves to the first row of element `index`, forwards or back to the start of the file.
  Status seekElement(std::size_t index);

  // Reads up to rows.size() / row_bytes rows of the current element into `rows`, packed in host
  // byte order at the offsets of the header; list properties are read and dropped. Returns the
  // number of rows; 0 at the end of the element.
  Result<std::size_t> readRows(std::span<std::byte> rows);

  // The next rows of the current element, max_rows or as many as are left, packed as by readRows.
  // The view lies in `buffer`, which grows to hold them, and is empty at the end of the element.
  // Rows that the file has packed are not copied.
  Result<Bytes> readRowView(std::size_t max_rows, AlignedBuffer& buffer);

  // Whether the rows of the current element can be found by arithmetic: binary, without lists, not
  // compressed.
  bool hasFixedRows() const;
  // Moves to row `row` of the current element, at most its count. kInvalidArgument unless
  // hasFixedRows().
  Status seekRow(std::uint64_t row);

  // Reads one row of the current element: its scalars into `scalars` (row_bytes long) and the list
  // property number `list_property` (index into properties) into `list`, as doubles. A list longer
  // than 2^20 items is kCorruption. False at the end of the element. kInvalidArgument when the
  // property is no list or `scalars` is too short.
  Result<bool> readRowWithList(std::span<std::byte> scalars, std::size_t list_property,
                               std::vector<double>& list);

 private:
  struct State;
  explicit PlyReader(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
