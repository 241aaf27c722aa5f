// What all files of io stand on: aligned memory, descriptors, and an open file that is read and
// written at positions, by direct I/O where the file system has it. Direct I/O takes a twentieth of
// the CPU time of cached I/O, whose page cache is fresh memory that must be touched, filled and
// given back; and it leaves the page cache, which counts against a job's cgroup, alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "surfeit/status.h"

namespace surfeit {

using Bytes = std::span<const std::byte>;

// Direct I/O begins and ends at multiples of this, in the file and in memory.
inline constexpr std::size_t kDirectAlignment = 4096;
// The least multiple of it that is not below `value`.
constexpr std::uint64_t alignedUp(std::uint64_t value) {
  return (value + kDirectAlignment - 1) / kDirectAlignment * kDirectAlignment;
}

// Memory that direct I/O can reach: begins at a multiple of kDirectAlignment. Grows only, and is
// reused: first touch of fresh memory costs more than the disk. Move-only.
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
  // Room for `bytes` at least; what was there is lost when it must grow. Throws std::bad_alloc.
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
  FileDescriptor(FileDescriptor&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept;
  ~FileDescriptor() { close(); }
  int get() const { return descriptor_; }
  bool isOpen() const { return descriptor_ >= 0; }
  void close();

 private:
  int descriptor_ = -1;
};

// How reads and writes reach the disk.
enum class Access : std::uint8_t {
  kCached,  // through the page cache: what is small or read again by others
  kDirect,  // past it where the file system allows, else cached
};

// An open file. Reads and writes are safe from any thread; so are those of different places at
// once.
class PositionalFile {
 public:
  PositionalFile() = default;
  // `name` begins every message. full_disk_advice ends those that tell of a full disk.
  PositionalFile(FileDescriptor descriptor, std::string name, std::string full_disk_advice = {});

  const std::string& name() const { return name_; }
  void setName(std::string name) { name_ = std::move(name); }
  int descriptor() const { return cached_.get(); }
  bool isOpen() const { return cached_.isOpen(); }
  void close();

  // Opens a second descriptor for direct I/O, in `mode` (O_RDONLY or O_RDWR); without it, where it
  // is refused, all goes through the page cache. Does nothing the second time. Before other threads
  // use the file.
  void openDirect(int mode);
  bool isDirect() const { return direct_.isOpen(); }

  // Reads up to bytes.size() bytes at `offset`, cached; fewer only at the end of the file.
  Result<std::size_t> readSome(std::uint64_t offset, std::span<std::byte> bytes) const;
  // Reads exactly bytes.size() bytes. kCorruption when the file ends before that.
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes) const;
  // The bytes [offset, offset + size) as a view into `buffer`, which grows as needed, up to size
  // and two alignments; shorter only at the end of the file. After openDirect it reads the pages
  // that hold them, directly; where that is refused, it lets the page cache go behind it.
  Result<Bytes> readView(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) const;

  // Writes all bytes at any offset, cached.
  Status writeAt(std::uint64_t offset, Bytes bytes) const;
  // Gives space back to the file system: that of the whole pages within the range. Does nothing
  // where the file system cannot.
  void release(std::uint64_t offset, std::uint64_t size) const;
  // Writes directly what begins, lies and ends at multiples of kDirectAlignment; cached where
  // direct I/O is not open or refused.
  Status writeAligned(std::uint64_t offset, Bytes bytes) const;

  // The message of a read that found `found` of `expected` bytes.
  Status endsEarly(std::uint64_t offset, std::size_t expected, std::size_t found) const;
  // "NAME: cannot ACTION: REASON", with the reason of errno.
  Status systemError(const char* action) const;

 private:
  Result<std::size_t> readAligned(std::uint64_t begin, std::size_t least,
                                  std::span<std::byte> bytes) const;
  Status readError(std::uint64_t offset, std::size_t size) const;
  Status writeError(std::uint64_t offset, std::size_t size) const;

  std::string name_, full_disk_advice_;
  FileDescriptor cached_, direct_;
  bool direct_wanted_ = false;
};

// "NAME: cannot ACTION: REASON", with the reason of errno.
Status systemError(const std::string& name, const char* action);

}  // namespace surfeit
