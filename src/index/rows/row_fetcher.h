// Fetches the records of a cloud ahead of those who decode them, on a thread of its own that mostly
// waits for the device.
#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "surfels/rows/surfel_source.h"

namespace surfeit {

class RowFetcher {
 public:
  // Buffers, which bound what is fetched ahead.
  static constexpr std::size_t kSlots = 4;

  // Records in one of the buffers.
  struct Rows {
    Bytes bytes;
    std::uint64_t first_record = 0;
    std::size_t slot = 0;
  };

  // Begins at once; about `read_bytes` at a time. Fetches records [begin, end), as far as there are
  // some; `source` is at its first one.
  RowFetcher(SurfelSource& source, std::size_t read_bytes, std::uint64_t begin = 0,
             std::uint64_t end = ~std::uint64_t{0});
  ~RowFetcher();

  // The next rows; empty at the end or after a failure. Waits. One thread at a time.
  Rows next();
  // Frees the rows' buffer. From any thread.
  void giveBack(const Rows& rows);
  // What ended the fetching, once next() gave nothing. Throws std::bad_alloc, if that was it.
  Status status() const;

 private:
  void run();
  void fetchRows();
  Status skipRows();

  SurfelSource& source_;
  const std::size_t max_rows_;
  const std::uint64_t begin_, end_;
  std::array<AlignedBuffer, kSlots> buffers_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::vector<std::size_t> free_;
  std::vector<Rows> ready_;  // oldest first
  bool ended_ = false, stopping_ = false;
  Status status_;
  std::exception_ptr exception_;  // of the thread
  std::thread thread_;
};

}  // namespace surfeit
