#include "storage/block_writer.h"

#include <fcntl.h>

#include <algorithm>
#include <cstring>
#include <system_error>
#include <utility>

#include "core/assert.h"
#include "core/worker_threads.h"

namespace surfeit {

BlockWriter::BlockWriter(PositionalFile& file, std::size_t blocks)
    : file_(file), max_blocks_(blocks) {
  SURFEIT_CHECK(blocks >= 2);
  // Once and for all: no exception may leave the thread, and no block may be lost
  queue_.reserve(blocks);
  free_blocks_.reserve(blocks);
}

BlockWriter::~BlockWriter() {
  {
    const std::lock_guard lock(queue_mutex_);
    is_stopping_ = true;
  }
  block_queued_.notify_all();
  if (thread_.joinable()) thread_.join();
}

Result<std::uint64_t> BlockWriter::append(Bytes bytes) {
  const std::lock_guard append_lock(append_mutex_);
  if (has_failed_.load(std::memory_order_relaxed)) return failure();
  const std::uint64_t offset = size();
  while (!bytes.empty()) {
    if (block_.capacity() == 0) SURFEIT_RETURN_IF_ERROR(takeFreeBlock());
    const Bytes part = bytes.first(std::min(bytes.size(), kBlockBytes - filled_));
    std::memcpy(block_.data() + filled_, part.data(), part.size());
    filled_ += part.size();
    tail_is_written_ = false;
    size_.store(size() + part.size(), std::memory_order_relaxed);
    bytes = bytes.subspan(part.size());
    if (filled_ == kBlockBytes) queueFullBlock();
  }
  return offset;
}

// A block to fill: a used one if there is, else a new one, else the next that is written.
Status BlockWriter::takeFreeBlock() {
  std::unique_lock lock(queue_mutex_);
  if (free_blocks_.empty() && allocated_blocks_ < max_blocks_) {
    block_.reserve(kBlockBytes);
    ++allocated_blocks_;
    return failure_;
  }
  block_written_.wait(lock, [this] { return !free_blocks_.empty(); });
  block_ = std::move(free_blocks_.back());
  free_blocks_.pop_back();
  return failure_;
}

void BlockWriter::queueFullBlock() {
  startThread();
  std::unique_lock lock(queue_mutex_);
  queue_.push_back({std::exchange(block_, {}), size() - kBlockBytes});
  filled_ = 0;
  tail_is_written_ = true;
  // Without a thread the caller does its work
  if (!thread_.joinable()) return writeNext(lock);
  block_queued_.notify_one();
}

void BlockWriter::startThread() {
  if (thread_.joinable()) return;
  file_.openDirect(O_RDWR);
  try {
    thread_ = std::thread([this] { runThread(); });
  } catch (const std::system_error&) {
    // No more threads to be had: slower, not wrong
  }
}

void BlockWriter::runThread() {
  std::unique_lock lock(queue_mutex_);
  while (true) {
    block_queued_.wait(lock, [this] { return is_stopping_ || !queue_.empty(); });
    if (is_stopping_) return;
    writeNext(lock);
  }
}

// Writes the first block of the queue, without holding the lock; after a failure drops it.
void BlockWriter::writeNext(std::unique_lock<std::mutex>& lock) {
  FullBlock full = std::move(queue_.front());
  queue_.erase(queue_.begin());
  if (failure_.ok()) {
    is_writing_ = true;
    lock.unlock();
    Status status = catchAll("write", [&] {
      return file_.writeAligned(full.offset, {full.block.data(), kBlockBytes});
    });
    lock.lock();
    is_writing_ = false;
    if (!status.ok()) {
      failure_ = std::move(status);
      has_failed_ = true;
    }
  }
  free_blocks_.push_back(std::move(full.block));
  block_written_.notify_all();
}

Status BlockWriter::drainQueue() {
  std::unique_lock lock(queue_mutex_);
  block_written_.wait(lock, [this] { return queue_.empty() && !is_writing_; });
  return failure_;
}

Status BlockWriter::flush() {
  const std::lock_guard append_lock(append_mutex_);
  SURFEIT_RETURN_IF_ERROR(drainQueue());
  if (!tail_is_written_) {
    // The block stays: what is appended next goes on in it, and writes it again
    const std::uint64_t offset = size() - filled_;
    Bytes tail(block_.data(), filled_);
    if (file_.isDirect()) {
      const std::size_t padding = alignedUp(filled_) - filled_;
      std::memset(block_.data() + filled_, 0, padding);
      tail = Bytes(block_.data(), filled_ + padding);
      is_padded_ = is_padded_ || padding > 0;
      SURFEIT_RETURN_IF_ERROR(fail(file_.writeAligned(offset, tail)));
    } else {
      SURFEIT_RETURN_IF_ERROR(fail(file_.writeAt(offset, tail)));
    }
    tail_is_written_ = true;
  }
  flushed_size_.store(size(), std::memory_order_release);
  return {};
}

Status BlockWriter::overwrite(std::uint64_t offset, Bytes bytes) {
  const std::lock_guard append_lock(append_mutex_);
  if (has_failed_.load(std::memory_order_relaxed)) return failure();
  SURFEIT_CHECK(offset <= size() && bytes.size() <= size() - offset);
  // What lies before the block being filled is in the file, or on its way
  const std::uint64_t block_offset = size() - filled_;
  if (offset < block_offset && !bytes.empty()) {
    const std::size_t before =
        static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), block_offset - offset));
    SURFEIT_RETURN_IF_ERROR(drainQueue());
    SURFEIT_RETURN_IF_ERROR(fail(file_.writeAt(offset, bytes.first(before))));
    bytes = bytes.subspan(before);
    offset += before;
  }
  if (!bytes.empty()) {
    std::memcpy(block_.data() + (offset - block_offset), bytes.data(), bytes.size());
    tail_is_written_ = false;
  }
  return {};
}

Status BlockWriter::failure() {
  const std::lock_guard lock(queue_mutex_);
  return failure_;
}

// Keeps the status when it is the first failure; returns it.
Status BlockWriter::fail(Status status) {
  if (status.ok()) return status;
  const std::lock_guard lock(queue_mutex_);
  if (failure_.ok()) failure_ = std::move(status);
  has_failed_ = true;
  return failure_;
}

}  // namespace surfeit
