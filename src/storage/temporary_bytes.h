// Bytes that are appended to a temporary file and read again in any order, a checksum with every
// 64 KiB of them:
//
//   unit = [ checksum : 8 | bytes : up to 64 KiB ]
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. The first failure is final: every later call returns it. Takes 64 KiB
// beside the blocks of its TemporaryFile.
class TemporaryBytes {
 public:
  // In `directory`, which must exist.
  static Result<TemporaryBytes> create(const std::string& directory);

  // Bytes appended so far.
  std::uint64_t size() const { return size_; }
  Status append(Bytes bytes);
  // All is in: from here on it is read.
  Status flush();
  // Exactly bytes.size() bytes. kCorruption when fewer were appended, kIoError when they are
  // damaged.
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes);

 private:
  TemporaryBytes(TemporaryFile file, std::string directory)
      : file_(std::move(file)), directory_(std::move(directory)) {}
  Status appendUnit();
  Status load(std::uint64_t unit);
  Status keep(Status status);

  TemporaryFile file_;
  std::string directory_;  // for messages
  std::uint64_t size_ = 0;
  std::vector<std::byte> unit_;    // being filled, or read; with its checksum
  std::uint64_t unit_number_ = 0;  // of it
  bool is_flushed_ = false;
  Status failure_;
};

}  // namespace surfeit
