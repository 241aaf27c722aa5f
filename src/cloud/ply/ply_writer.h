// Streams rows into a PLY file of one element, "vertex". The file appears under its final name
// only when finish() succeeds, compressed when its name asks for it (storage/byte_output.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cloud/ply/ply_format.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. The count may be unknown when writing begins: a comment after the element
// line leaves room for 20 digits, and finish() completes the header.
class PlyWriter {
 public:
  // `properties` are scalars; their offsets are set here, packed in order. Writing to "-", no
  // properties, lists, and names that are no single words or not unique are kInvalidArgument.
  // `progress` as ByteOutput has it.
  static Result<PlyWriter> create(const std::string& path, PlyEncoding encoding,
                                  std::vector<RowProperty> properties,
                                  std::vector<std::string> comments = {},
                                  Progress* progress = nullptr);
  PlyWriter(PlyWriter&&) noexcept;
  PlyWriter& operator=(PlyWriter&&) noexcept;
  ~PlyWriter();  // removes the temporary file unless finish() succeeded

  // The element being written, with the offsets that rows must follow.
  const RowLayout& element() const;

  // Appends whole rows, packed in host byte order. Ascii numbers are the shortest that read back
  // as the same value.
  Status writeRows(std::span<const std::byte> rows);

  // Completes the header, syncs and renames.
  Status finish();

 private:
  struct State;
  explicit PlyWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
