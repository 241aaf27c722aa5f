// A file whose parts are read in any order: a compressed one is decompressed to a temporary file
// when it is opened.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "storage/byte_input.h"
#include "storage/file.h"
#include "storage/output_target.h"
#include "storage/temporary_bytes.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. Offsets are those of the bytes after decompression.
class SpooledInput {
 public:
  static Result<SpooledInput> open(const std::string& path, Access access);

  const std::string& path() const { return input_.path(); }
  std::uint64_t size() const { return size_; }
  // kCorruption when the file ends before that.
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes);
  // All of the bytes asked for; kCorruption when the file ends before that.
  Result<Bytes> readView(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer);
  Status checkUnchanged() const { return input_.checkUnchanged(); }

 private:
  explicit SpooledInput(ByteInput input) : input_(std::move(input)) {}
  Status spool();

  ByteInput input_;
  std::uint64_t size_ = 0;
  std::optional<TemporaryBytes> spooled_;  // when the file is compressed
};

}  // namespace surfeit
