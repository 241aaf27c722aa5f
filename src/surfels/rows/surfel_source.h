// Surfel clouds as streams: raw records in the order of the file, fetched by one thread and decoded
// by any. surfels/rows/surfel_mapping.h has the names and the rules.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cloud/rows/row_reader.h"
#include "storage/file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"
#include "surfels/rows/surfel_mapping.h"

namespace surfeit {

// The sizes that a cloud states: the property of rows with the first of them, and what --channels
// takes so that none is read. Empty where it states none.
struct SizeNames {
  std::string property, drops;
  bool has_area = false;
};

// A cloud that can be read several times. One thread at a time, but for decodeRows and what only
// tells about the cloud: those are safe from any thread at any time.
//
// There are two ways to read: surfels by read(), or raw records by readRows() and decodeRows(), so
// that several threads share the decoding. Both move through the same file: whoever changes from
// one to the other calls rewind() first.
class SurfelSource {
 public:
  virtual ~SurfelSource() = default;

  virtual const std::string& path() const = 0;
  // Records in the file, valid or not.
  virtual std::uint64_t recordCount() const = 0;
  virtual CloudChannels channels() const = 0;
  // Positions of surfels are counted from here from now on: the records' doubles less this, as
  // floats. 0 before. Finite.
  virtual void setOrigin(const glm::dvec3& origin) = 0;
  // The axis that the cloud says is up.
  virtual UpAxis up() const { return kDefaultUpAxis; }
  // Lines of text that the cloud has (core/up_comment.h, core/group_comment.h).
  virtual std::vector<std::string> comments() const { return {}; }
  // Whether the records hold positions as floats.
  virtual bool hasFloatPositions() const { return false; }

  // What the file has that surfels do not, and rules by which values were read, one sentence each.
  virtual std::vector<std::string> notes() const { return {}; }

  // How --channels keeps the albedo from being read as it is; empty where it does not.
  virtual std::string albedoAdvice() const { return {}; }

  virtual SizeNames sizeNames() const { return {}; }

  // Whether surfels come with a coverage: then their area is minus that
  // (surfels/rows/surfel_mapping.h).
  virtual bool hasCoverage() const { return false; }

  // Fills the front of `surfels` and returns how many; 0 at the end. Invalid records are skipped
  // and counted, or with `strict` refused as kCorruption naming the record and the defect.
  virtual Result<std::size_t> read(std::span<Surfel> surfels) = 0;
  // Back to the first record; defects start again from zero.
  virtual Status rewind() = 0;
  // What read() has skipped so far.
  virtual const SurfelDefects& defects() const = 0;

  // Bytes of one raw record as readRows delivers it.
  virtual std::size_t rowBytes() const = 0;
  // The next raw records, as many as `max_rows` (at least 1) and the end allow; empty at the end.
  // The view lies in `buffer` and lasts as long as the buffer is not used again. kCorruption when
  // the file ends early or was written to since it was opened.
  virtual Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) = 0;
  // Decodes rows (a whole number of them), the first of which is record number `first_record` of
  // the file, to the front of `surfels`, which has room for all rows; returns how many surfels
  // there are. Invalid records are skipped and counted in `defects`, or with `strict` the first of
  // these rows that is invalid is refused as by read().
  virtual Result<std::size_t> decodeRows(Bytes rows, std::uint64_t first_record,
                                         std::span<Surfel> surfels,
                                         SurfelDefects& defects) const = 0;

  // Whether seekRow works: records of fixed size, not text.
  virtual bool isSeekable() const = 0;
  // The next readRows begins with record `record`, at most recordCount(). kInvalidArgument unless
  // isSeekable().
  virtual Status seekRow(std::uint64_t record) = 0;
};

// The rows of an open reader as surfels.
Result<std::unique_ptr<SurfelSource>> makeSurfelSource(std::unique_ptr<RowReader> reader,
                                                       bool strict);

}  // namespace surfeit
