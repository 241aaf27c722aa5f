// A file to be written that appears whole or not at all (storage/file.h, AtomicFile), compressed
// when its name ends with .gz or .zst.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "storage/file.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Like AtomicFile. What is to be compressed is kept in a file without a name until commit(), so
// that headers can be completed; the disk needs room for both. One thread at a time.
class ByteOutput {
 public:
  // `progress`, if any, outlives the output. append() and commit() poll it:
  // kInterrupted; what commit() compresses is counted.
  static Result<ByteOutput> create(const std::string& path, Progress* progress = nullptr);
  ByteOutput(ByteOutput&&) noexcept;
  ByteOutput& operator=(ByteOutput&&) noexcept;
  ~ByteOutput();

  const std::string& path() const;
  // Bytes appended so far, before compression.
  std::uint64_t size() const;
  Status append(Bytes bytes);
  // Overwrites bytes that were appended before.
  Status writeAt(std::uint64_t offset, Bytes bytes);
  // Compresses where the name asks for it; then the file appears.
  Status commit();

 private:
  struct State;
  explicit ByteOutput(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// The name without .gz or .zst.
std::string_view withoutCompression(std::string_view path);

}  // namespace surfeit
