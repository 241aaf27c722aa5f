// A cloud of any format as something that rows are appended to: the counterpart of
// cloud/rows/row_reader.h. cloud/cloud_formats.h creates writers by the name of the file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cloud/rows/ply_encoding.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

class RowReader;

// What a writer is to write, known before the first row.
struct RowWriterOptions {
  // Scalars, named as cloud/rows/channels.h has it; their offsets are set by the writer.
  std::vector<RowProperty> properties = {};
  std::vector<std::string> comments = {};
  PlyEncoding ply_encoding = PlyEncoding::kBinaryLittleEndian;  // for PLY only
  // The rows that will come, where that is known. Otherwise formats that state it in front of the
  // data complete their header at the end.
  std::optional<std::uint64_t> count = {};
  // The cloud that the rows come from, or nullptr: a writer of the same format takes from it what
  // rows do not carry (the windows and attributes of a picture, the transform of a grid). Only used
  // by create functions.
  const RowReader* like = nullptr;
  // Polled by finish(), whose work may be long (compression, OpenVDB): kInterrupted. Outlives the
  // writer.
  Progress* progress = nullptr;
  // Memory that a format may take that must hold what it writes until the end (OpenVDB). Others
  // take a few MiB.
  std::uint64_t memory_bytes = std::uint64_t{2} << 30;
  // The budget of the job that gives so much: memory_parts times that, and memory_beside_bytes. For
  // the message that tells what would do.
  std::uint64_t memory_parts = 1, memory_beside_bytes = 0;
};

// One thread at a time. The file appears under its final name only when finish() succeeds;
// destroyed before that, the writer leaves nothing.
class RowWriter {
 public:
  virtual ~RowWriter() = default;

  // The properties of the rows that it takes, with the offsets that rows must follow: packed in the
  // order in which they were given.
  virtual const RowLayout& element() const = 0;
  // What the format cannot keep of these rows, one sentence each: "float64 becomes float32: x".
  virtual std::vector<std::string> notes() const { return {}; }

  // Appends whole rows, packed in host byte order.
  virtual Status writeRows(std::span<const std::byte> rows) = 0;
  // Completes, syncs and renames.
  virtual Status finish() = 0;
  // Rows that wait in a temporary file until the end, where a format needs that.
  virtual std::uint64_t temporaryBytes() const { return 0; }
};

}  // namespace surfeit
