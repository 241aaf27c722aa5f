// Any file that `surfeit view` draws, as a stream of rows with named scalar properties: those of a
// cloud of any format, or the surfels of a .sft file page by page. Only one batch is in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/row_layout.h"
#include "core/bounds.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// One thread at a time; next() may use TBB's threads itself.
class CloudRows {
 public:
  // Most rows that next() returns, unless one page of a .sft file holds more.
  static constexpr std::size_t kBatchRows = 32768;

  virtual ~CloudRows() = default;

  virtual const std::string& path() const = 0;
  // Names, types and offsets of a row's properties; row_bytes apart.
  virtual const RowLayout& element() const = 0;
  // The axis that the file says is up.
  virtual UpAxis up() const = 0;
  // What is to be told of the file, one sentence each.
  virtual std::vector<std::string> notes() const { return {}; }
  // The next rows, empty at the end. Valid until the next call on this object.
  virtual Result<std::span<const std::byte>> next() = 0;
  // Back to the first row.
  virtual Status rewind() = 0;

  // Bounds of the positions where the file states them.
  virtual std::optional<Bounds3d> statedBounds() const { return std::nullopt; }
};

// Opens a file by its content: a scene, or any cloud that cloud/cloud_formats.h reads. kCorruption
// when it is neither, or has no x, y and z.
// `options`: what of a cloud is read, and under which names.
Result<std::unique_ptr<CloudRows>> openCloudRows(const std::string& path,
                                                 const RowReaderOptions& options = {});

}  // namespace surfeit
