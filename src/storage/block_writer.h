// Appends to a file by way of a few aligned blocks, which a background thread writes by direct I/O
// while the caller fills the next. What is small costs no thread: it begins with the first full
// block.
//
//   append -> [ block being filled ] -> queue of full blocks -> thread -> disk
//                     ^------------- free blocks <---------------'
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "storage/positional_file.h"
#include "surfeit/status.h"

namespace surfeit {

// Safe from any thread. The first failure is final: nothing is written again, and every later call
// returns it.
class BlockWriter {
 public:
  static constexpr std::size_t kBlockBytes = 1 << 20;
  static constexpr std::size_t kDefaultBlocks = 4;

  // Writes to `file`, which is empty and outlives the writer. Takes no more memory than `blocks`
  // blocks, at least 2.
  explicit BlockWriter(PositionalFile& file, std::size_t blocks = kDefaultBlocks);
  BlockWriter(const BlockWriter&) = delete;
  BlockWriter& operator=(const BlockWriter&) = delete;
  // Drops what is not written yet.
  ~BlockWriter();

  // Returns the offset at which the bytes lie. They are in the file after the next flush.
  Result<std::uint64_t> append(Bytes bytes);
  // Replaces bytes that were appended before.
  Status overwrite(std::uint64_t offset, Bytes bytes);
  // Waits until all that was appended is in the file, which may be longer by a padding of less than
  // kDirectAlignment bytes.
  Status flush();

  // Bytes appended so far.
  std::uint64_t size() const { return size_.load(std::memory_order_relaxed); }
  // Of these, how many are certain to be in the file.
  std::uint64_t flushedSize() const { return flushed_size_.load(std::memory_order_acquire); }
  // Whether a padding was written, so that the file wants cutting to size().
  bool isPadded() const { return is_padded_; }

 private:
  struct FullBlock {
    AlignedBuffer block;
    std::uint64_t offset = 0;
  };

  Status takeFreeBlock();
  void queueFullBlock();
  void startThread();
  void runThread();
  void writeNext(std::unique_lock<std::mutex>& lock);
  Status drainQueue();
  Status failure();
  Status fail(Status status);

  PositionalFile& file_;
  const std::size_t max_blocks_;

  // Whoever appends, overwrites or flushes holds this one from begin to end
  std::mutex append_mutex_;
  AlignedBuffer block_;          // being filled; empty when the last one has just been queued
  std::size_t filled_ = 0;       // bytes in it
  bool tail_is_written_ = true;  // the file has the bytes of block_
  std::size_t allocated_blocks_ = 0;
  std::atomic<std::uint64_t> size_{0};
  std::atomic<std::uint64_t> flushed_size_{0};
  bool is_padded_ = false;

  // What appenders and the thread share; taken after append_mutex_
  std::mutex queue_mutex_;
  std::condition_variable block_queued_, block_written_;
  std::vector<FullBlock> queue_;  // oldest first
  std::vector<AlignedBuffer> free_blocks_;
  bool is_writing_ = false;
  bool is_stopping_ = false;
  Status failure_;
  std::atomic<bool> has_failed_{false};
  std::thread thread_;
};

}  // namespace surfeit
