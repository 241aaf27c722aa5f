// A cloud of any format as a stream of rows: records of fixed size with named scalar values. This
// is the one way by which clouds are read; cloud/cloud_formats.h opens them,
// surfels/rows/surfel_mapping.h and the gather find what they need by the names of properties.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "storage/positional_file.h"
#include "surfeit/status.h"

namespace surfeit {

// Rows that a reader's format marks as not to be used: they are left out unless a user says which
// to take.
struct RowExclusions {
  struct Kind {
    std::string name;       // "withheld"
    std::string condition;  // that holds for what is left out (cloud/rows/row_filter.h)
  };
  std::vector<Kind> kinds;
  // What the conditions speak of, with its places in a row; also in bytes that no property of the
  // element takes.
  std::vector<RowProperty> properties;
};

// One thread at a time. Errors name the file, the place (record or byte), what was found and what
// was expected; kCorruption for what the file holds, kIoError for what the system refused. After a
// failure every read fails the same way until rewind() or seekRow(). Takes a few MiB at most,
// besides the buffers that readRows is given.
class RowReader {
 public:
  virtual ~RowReader() = default;

  virtual const std::string& path() const = 0;
  // "PLY", "PTC 1", "LAS 1.2 point format 3": as a person would say it.
  virtual std::string formatName() const = 0;

  // Name, count and properties of a row. Properties are scalars, named as cloud/rows/channels.h has
  // it, in host byte order at their offsets, which grow; bytes of row_bytes that none of them takes
  // mean nothing (channels that were dropped). The count is exact: formats that do not state one
  // are counted when they are opened.
  virtual const RowLayout& element() const = 0;
  // Text that the file carries along and that a result may keep.
  virtual std::vector<std::string> comments() const { return {}; }
  // What the file has that rows do not, one sentence each: "list property faces is not kept".
  virtual std::vector<std::string> notes() const { return {}; }

  // The next rows, max_rows (at least 1) or as many as are left; empty at the end. The view lies in
  // `buffer`, which grows as needed, and lasts as long as the buffer is not used again.
  virtual Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) = 0;
  // Back to the first row.
  virtual Status rewind() = 0;

  // Whether seekRow works without reading what lies between.
  virtual bool isSeekable() const { return false; }
  // The next readRows begins with row `row`, at most the count. kInvalidArgument unless
  // isSeekable().
  virtual Status seekRow(std::uint64_t row);

  // What readRows returns and is better left out (cloud/rows/filtered_reader.h); mostly nothing.
  virtual RowExclusions exclusions() const { return {}; }
  // The reader of the file itself, where this one takes rows of another: for what a format has
  // beside rows (cameras, windows of pictures).
  virtual const RowReader& file() const { return *this; }
};

// kInvalidArgument when an element has no properties, since all channels are renamed to nothing.
Status checkChannelsLeft(const RowLayout& element, const std::string& path);

}  // namespace surfeit
