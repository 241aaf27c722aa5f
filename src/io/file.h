// Files through system calls: positional reads, buffered appends, and files that appear whole or
// not at all. Every message names the path, the offset and the system's reason.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/status.h"

namespace surfeit {

using Bytes = std::span<const std::byte>;

// Memory that direct I/O can reach: begins at a multiple of kDirectAlignment. Grows only, and is
// reused: first touch of fresh memory costs more than the disk. Move-only.
inline constexpr std::size_t kDirectAlignment = 4096;
class AlignedBuffer {
 public:
  AlignedBuffer() = default;
  explicit AlignedBuffer(std::size_t bytes) { reserve(bytes); }
  AlignedBuffer(AlignedBuffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), capacity_(std::exchange(other.capacity_, 0)) {}
  AlignedBuffer& operator=(AlignedBuffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ~AlignedBuffer();
  // Room for `bytes` at least; what was there is lost when it must grow.
  void reserve(std::size_t bytes);
  std::byte* data() const { return data_; }
  std::size_t capacity() const { return capacity_; }

 private:
  std::byte* data_ = nullptr;
  std::size_t capacity_ = 0;
};

// An open descriptor, closed when it goes. Move-only.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int descriptor) : descriptor_(descriptor) {}
  FileDescriptor(FileDescriptor&& other) noexcept;
  FileDescriptor& operator=(FileDescriptor&& other) noexcept;
  ~FileDescriptor();
  int get() const { return descriptor_; }
  bool isOpen() const { return descriptor_ >= 0; }
  void close();

 private:
  int descriptor_ = -1;
};

// A file open for reading. readAt is safe from any thread.
class InputFile {
 public:
  // kIoError when the path cannot be opened or is not a regular file.
  static Result<InputFile> open(const std::string& path);

  const std::string& path() const { return path_; }
  std::uint64_t size() const { return size_; }

  // Reads exactly bytes.size() bytes at `offset`. kCorruption when the file ends before that.
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes) const;
  // Reads up to bytes.size() bytes at `offset`; fewer only at the end of the file.
  Result<std::size_t> readSome(std::uint64_t offset, std::span<std::byte> bytes) const;
  // The bytes [offset, offset + size) as a view into `buffer`, which grows as needed; shorter only
  // at the end of the file.
  Result<Bytes> readView(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) const;

 private:
  std::string path_;
  FileDescriptor descriptor_;
  std::uint64_t size_ = 0;
};

// A file that appears under its final name only when complete: written to a temporary file beside
// it, synced, renamed, and the directory synced. Destroyed without commit() it leaves nothing.
// One thread at a time.
class AtomicFile {
 public:
  static Result<AtomicFile> create(const std::string& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&& other) noexcept;
  ~AtomicFile();

  const std::string& path() const { return path_; }
  // Bytes appended so far, buffered ones included.
  std::uint64_t size() const { return size_; }

  Status append(Bytes bytes);
  // Overwrites bytes that were appended before.
  Status writeAt(std::uint64_t offset, Bytes bytes);
  Status commit();

 private:
  AtomicFile() = default;
  Status flush();
  void discard();

  std::string path_, temporary_path_;
  FileDescriptor descriptor_;
  std::vector<std::byte> buffer_;
  std::uint64_t size_ = 0;
};

// Scratch space on disk that has no name and goes when the process does. append by one thread at
// a time; readAt from any thread once written.
class TemporaryFile {
 public:
  // In `directory`, which must exist.
  static Result<TemporaryFile> create(const std::string& directory);
  std::uint64_t size() const { return size_; }
  Status append(Bytes bytes);
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes) const;

 private:
  std::string directory_;
  FileDescriptor descriptor_;
  std::uint64_t size_ = 0;
};

// The directory part of a path, "." when there is none.
std::string directoryOf(const std::string& path);

}  // namespace surfeit
