// A file as bytes, whether it is compressed or not. gzip and zstd are recognised by their first
// bytes, not by the name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. Offsets are those of the bytes after decompression. Takes up to 1 MiB when
// the file is compressed (zstd windows above 8 MiB are refused as kCorruption, so up to 9 MiB).
class ByteInput {
 public:
  // kIoError when the path cannot be opened or is not a regular file.
  static Result<ByteInput> open(const std::string& path, Access access = Access::kCached);
  ByteInput(ByteInput&&) noexcept;
  ByteInput& operator=(ByteInput&&) noexcept;
  ~ByteInput();

  const std::string& path() const;
  bool isCompressed() const;
  // Bytes of the file; nothing when it is compressed.
  std::optional<std::uint64_t> size() const;

  // Reads up to bytes.size() bytes at `offset`; fewer only at the end. A compressed file is decoded
  // forward, and from its start when `offset` lies before the last read's end. kCorruption when
  // compressed bytes are damaged or end early; kInterrupted, of all reads, when the process is
  // cancelled (core/process_cancelled.h). Several gzip members or zstd frames in a row are one
  // file.
  Result<std::size_t> readSome(std::uint64_t offset, std::span<std::byte> bytes);
  // Reads exactly bytes.size() bytes; kCorruption when the file ends before that, naming `offset`
  // and how many were expected.
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes);
  // A view of the next bytes in `buffer`, as InputFile::readView; without a copy only where the
  // file is not compressed.
  Result<Bytes> readView(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer);

  // kCorruption when the file has been written to since open.
  Status checkUnchanged() const;

 private:
  struct State;
  explicit ByteInput(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
