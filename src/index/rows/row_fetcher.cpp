#include "index/rows/row_fetcher.h"

#include <algorithm>
#include <exception>
#include <new>

namespace surfeit {

RowFetcher::RowFetcher(SurfelSource& source, std::size_t read_bytes, std::uint64_t begin,
                       std::uint64_t end)
    : source_(source),
      max_rows_(std::max<std::size_t>(1, read_bytes / source.rowBytes())),
      begin_(begin),
      end_(end) {
  ready_.reserve(kSlots);
  for (std::size_t slot = 0; slot < kSlots; ++slot) free_.push_back(slot);
  thread_ = std::thread([this] { run(); });
}

RowFetcher::~RowFetcher() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

// No exception may leave the thread: not even that there is no memory for the text of another.
void RowFetcher::run() {
  try {
    fetchRows();
  } catch (...) {
    const std::lock_guard lock(mutex_);
    exception_ = std::current_exception();
    ended_ = true;
    changed_.notify_all();
  }
}

// Before the first record: what cannot be sought is read.
Status RowFetcher::skipRows() {
  if (begin_ == 0) return {};
  if (source_.isSeekable()) return source_.seekRow(begin_);
  AlignedBuffer buffer;
  for (std::uint64_t record = 0; record < begin_;) {
    {
      const std::lock_guard lock(mutex_);
      if (stopping_) return {};
    }
    const auto rows = static_cast<std::size_t>(std::min<std::uint64_t>(max_rows_, begin_ - record));
    SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, source_.readRows(rows, buffer));
    if (bytes.empty()) return {};
    record += bytes.size() / source_.rowBytes();
  }
  return {};
}

void RowFetcher::fetchRows() {
  const Status skipped = skipRows();
  std::uint64_t record = begin_;
  for (;;) {
    std::size_t slot = 0;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || !free_.empty(); });
      if (stopping_) return;
      slot = free_.back();
      free_.pop_back();
    }
    const auto rows = static_cast<std::size_t>(std::min<std::uint64_t>(max_rows_, end_ - record));
    const Result<Bytes> bytes = !skipped.ok() ? Result<Bytes>(skipped)
                                : rows == 0   ? Result<Bytes>(Bytes())
                                              : source_.readRows(rows, buffers_[slot]);
    const std::lock_guard lock(mutex_);
    if (!bytes.ok() || bytes->empty()) {
      status_ = bytes.status();
      ended_ = true;
    } else {
      ready_.push_back({*bytes, record, slot});
      record += bytes->size() / source_.rowBytes();
    }
    changed_.notify_all();
    if (ended_) return;
  }
}

RowFetcher::Rows RowFetcher::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return ended_ || !ready_.empty(); });
  if (ready_.empty()) return {};
  const Rows rows = ready_.front();
  ready_.erase(ready_.begin());
  return rows;
}

void RowFetcher::giveBack(const Rows& rows) {
  const std::lock_guard lock(mutex_);
  free_.push_back(rows.slot);
  changed_.notify_all();
}

Status RowFetcher::status() const {
  const std::lock_guard lock(mutex_);
  if (exception_ == nullptr) return status_;
  try {
    std::rethrow_exception(exception_);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    return Status::failed(source_.path() + ": " + error.what());
  }
}

}  // namespace surfeit
