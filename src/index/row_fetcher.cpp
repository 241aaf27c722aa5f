#include "index/row_fetcher.h"

#include <algorithm>
#include <exception>
#include <new>

namespace surfeit {

RowFetcher::RowFetcher(SurfelSource& source, std::size_t read_bytes)
    : source_(source), max_rows_(std::max<std::size_t>(1, read_bytes / source.rowBytes())) {
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

void RowFetcher::fetchRows() {
  std::uint64_t record = 0;
  for (;;) {
    std::size_t slot = 0;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || !free_.empty(); });
      if (stopping_) return;
      slot = free_.back();
      free_.pop_back();
    }
    const Result<Bytes> bytes = source_.readRows(max_rows_, buffers_[slot]);
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
