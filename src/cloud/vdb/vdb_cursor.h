// Reading an OpenVDB file front to back, from any of its places: whatever it says of sizes is held
// against the file before memory is taken for it.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

static_assert(std::endian::native == std::endian::little, "OpenVDB files are little-endian");

// Reads [begin, end) of a file in order. One thread at a time; many cursors may read one file,
// which must outlive them. Takes 64 KiB, or as much as the largest take().
class VdbCursor {
 public:
  VdbCursor() = default;
  VdbCursor(const InputFile& file, std::uint64_t begin, std::uint64_t end);

  std::uint64_t offset() const { return buffer_offset_ + position_; }
  std::uint64_t left() const { return end_ - offset(); }
  const std::string& path() const { return file_->path(); }

  // The next `size` bytes, until the next call. kCorruption when fewer are left, before anything is
  // allocated.
  Result<Bytes> take(std::uint64_t size);
  Status skip(std::uint64_t size);

  // Reads a number or a packed array of numbers.
  template <typename T>
  Status read(T& value) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, take(sizeof(T)));
    std::memcpy(&value, bytes.data(), sizeof(T));
    return {};
  }
  // A text: its length in 32 bits, then its characters. Longer than 64 KiB is kCorruption.
  Status readText(std::string& text);

  // "PATH: at OFFSET: WHAT".
  Status corrupt(const std::string& what) const;

 private:
  const InputFile* file_ = nullptr;
  AlignedBuffer buffer_;
  Bytes view_;
  std::uint64_t buffer_offset_ = 0, end_ = 0;
  std::size_t position_ = 0;
};

}  // namespace surfeit
