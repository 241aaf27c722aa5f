// The files of a user: read at positions, written to appear whole or not at all, and scratch space
// without a name. Every message names the path, the place and the system's reason.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "storage/positional_file.h"
#include "surfeit/status.h"

namespace surfeit {

// A file open for reading. Reads are safe from any thread.
class InputFile {
 public:
  // "-" is standard input. What comes from a pipe or socket is kept in a temporary file
  // (storage/input_spool.h). kIoError when the path cannot be opened or is a directory or device.
  // `access` decides how readView
  // reads; the other reads, which have no alignment, are cached.
  static Result<InputFile> open(const std::string& path, Access access = Access::kCached);

  // A file without a name that holds these bytes, in memory; `name` begins messages. kIoError when
  // the system has no memory for it.
  static Result<InputFile> fromBytes(Bytes bytes, const std::string& name);

  const std::string& path() const { return file_.name(); }
  std::uint64_t size() const { return size_; }

  // Reads exactly bytes.size() bytes at `offset`. kCorruption when the file ends before that.
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes) const {
    return file_.readAt(offset, bytes);
  }
  // Reads up to bytes.size() bytes at `offset`; fewer only at the end of the file.
  Result<std::size_t> readSome(std::uint64_t offset, std::span<std::byte> bytes) const {
    return file_.readSome(offset, bytes);
  }
  // The bytes [offset, offset + size) as a view into `buffer`, which grows as needed, by up to two
  // alignments more than size; shorter only at the end of the file.
  Result<Bytes> readView(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) const {
    return file_.readView(offset, size, buffer);
  }

  // kCorruption when the file has been written to since open, as its size or the time of the last
  // write tell. That its path names another file by now, or none, is no failure.
  Status checkUnchanged() const;

 private:
  friend class AtomicFile;
  static Result<InputFile> fromOpen(PositionalFile file, Access access);

  PositionalFile file_;
  std::uint64_t size_ = 0;
  std::int64_t written_ns_ = 0;  // time of the last write, since 1970
};

// A file that appears under its final name only when complete. Until then it has no name, where the
// file system allows that (O_TMPFILE), else that of a temporary file beside it
// (storage/temporary_name.h); commit() syncs it, renames it, and syncs the directory. Destroyed
// without commit() it leaves nothing; killed, it leaves at most the temporary file, which the next
// writer of the path removes. Of two writers of one path at once, the last to commit wins. Takes up
// to BlockWriter::kDefaultBlocks blocks of memory. One thread at a time.
//
// A symbolic link stays and what it leads to is replaced; a file that was there keeps its
// permissions. Devices, FIFOs, sockets and standard output ("-") are written to by commit(), from
// a temporary file (storage/output_target.h).
class AtomicFile {
 public:
  // kInvalidArgument for a directory, kIoError where nothing can be written.
  static Result<AtomicFile> create(const std::string& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&& other) noexcept;
  ~AtomicFile();

  const std::string& path() const;
  // Bytes appended so far, buffered ones included.
  std::uint64_t size() const;

  // The first failure of any of these is final, and the only answer of every later call: in
  // particular a sync that failed is not tried again, since the system may have dropped the bytes.
  Status append(Bytes bytes);
  // Overwrites bytes that were appended before.
  Status writeAt(std::uint64_t offset, Bytes bytes);
  // The file appears. Nothing may be written after it. When this fails, what was under the name
  // before is still there; except that when only the directory could not be synced, the new file
  // is, and may be lost with the power.
  Status commit();

  // Ends the file without ever giving it a name: it lasts as long as it is open. It goes by `name`
  // in messages. Not synced. Nothing may be written after it.
  Result<InputFile> finishUnnamed(const std::string& name, Access access = Access::kDirect);

 private:
  struct State;
  explicit AtomicFile(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

// Scratch space on disk that has no name and goes when the process does. Written and read by direct
// I/O where the file system allows. Safe from any thread. Takes `blocks` blocks of
// BlockWriter::kBlockBytes while appending, none before the first append.
class TemporaryFile {
 public:
  // In `directory`, which must exist. Costs little until the first block is full.
  static Result<TemporaryFile> create(const std::string& directory, std::size_t blocks = 4);
  TemporaryFile(TemporaryFile&& other) noexcept;
  TemporaryFile& operator=(TemporaryFile&& other) noexcept;
  ~TemporaryFile();

  // Bytes appended so far.
  std::uint64_t size() const;

  // Returns the offset at which the bytes lie. A failed write is the answer of some later append or
  // flush, and of all that follow; it is not tried again.
  Result<std::uint64_t> append(Bytes bytes);
  // Waits until all that was appended is in the file.
  Status flush();

  // Read exactly the bytes asked for, as their counterparts of InputFile; kCorruption when fewer
  // were appended. What has not been flushed, they flush.
  Status readAt(std::uint64_t offset, std::span<std::byte> bytes) const;
  Result<Bytes> readView(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) const;
  // Gives the space of a flushed range back to the file system, where that works. What was there
  // must not be read again.
  void release(std::uint64_t offset, std::uint64_t size);

 private:
  struct State;
  explicit TemporaryFile(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

// The directory part of a path, "." when there is none.
std::string directoryOf(const std::string& path);

// Bytes that the file system of `directory` still takes from this user.
Result<std::uint64_t> availableBytes(const std::string& directory);

}  // namespace surfeit
