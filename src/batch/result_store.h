// Brings results, which come in the order of the curve, back into the order of the input, in a
// given memory. Where they do not fit, they go by buckets, ranges of indices that fit one by one:
//
//   put -> open block of the bucket --full--> file ... finish ... bucket by bucket -> take
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "gather/rules/receiver.h"
#include "storage/file.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// Throws std::bad_alloc. The first failure is final: every later call returns it.
//
// Memory, all included but for the stack of the thread that writes the file: a result per index
// where these fit, at 4 bytes per float of the outputs. Else 2.125 MiB for the file, 16 bytes per
// bucket, and beside them what memory_bytes leaves: one open block per bucket; after finish(),
// within what reading_bytes leaves, the results of one bucket and a block.
class ResultStore {
 public:
  // Neither memory may be below leastMemoryBytes(count).
  struct Options {
    std::uint64_t count = 0;  // indices are below it
    // Of results, what is kept: a set of GatherOutput.
    std::uint32_t outputs = kOutputOcclusion | kOutputIrradiance;
    std::uint64_t memory_bytes = 0;   // until finish() returns
    std::uint64_t reading_bytes = 0;  // from then on; 0: memory_bytes
    std::string temporary_directory;
  };
  struct Entry {
    std::uint64_t index = 0;
    GatherResult result;
  };

  // The least memory that brings so many results into order. It grows with the square root of the
  // count: 2.7 MiB for a million, 13.5 MiB for 500 million.
  static std::uint64_t leastMemoryBytes(std::uint64_t count, std::size_t result_floats = 4);

  explicit ResultStore(Options options);
  ResultStore(const ResultStore&) = delete;
  ResultStore& operator=(const ResultStore&) = delete;
  ~ResultStore();

  // From any thread, each index at most once. Errors, here and below: kIoError of the temporary
  // file, damage found by its checksums included.
  Status put(std::span<const Entry> entries);
  // All are in. From here on one thread at a time.
  Status finish();
  // The results of the next indices, from 0 on; NaN in all outputs for those that were never put.
  // No more may be taken than there are. What has been taken gives its space on the disk back.
  Status take(std::span<GatherResult> results);

  // Bytes in the temporary file so far. From any thread.
  std::uint64_t temporaryBytes() const;

 private:
  struct Plan;
  // The entries of consecutive indices. Its blocks in the file are a list from the last to the
  // first: memory need not grow with their number.
  struct Bucket {
    std::uint64_t entries = 0;
    std::uint64_t last_block = 0;  // its offset
  };

  static Plan planFor(std::uint64_t memory_bytes, std::uint64_t reading_bytes, std::uint64_t count,
                      std::size_t result_floats);
  std::byte* openBlock(std::size_t bucket) const;
  std::size_t blockRecords() const;
  std::size_t recordBytes() const { return sizeof(std::uint32_t) + floats_ * sizeof(float); }
  Status putAll(std::span<const Entry> entries);
  Status writeBlock(std::size_t bucket, std::size_t records);
  Status loadBucket(std::size_t bucket);

  const Options options_;
  const std::size_t floats_;          // of a packed result
  std::uint64_t bucket_indices_ = 0;  // of every bucket but the last
  std::uint64_t block_bytes_ = 0;     // 0: all are in results_
  std::uint64_t taken_ = 0;

  mutable std::mutex mutex_;  // guards what follows until finish(), but results_
  std::vector<Bucket> buckets_;
  AlignedBuffer blocks_;  // the open blocks of all buckets; later the one being read
  std::unique_ptr<TemporaryFile> file_;
  Status failure_;

  std::vector<float> results_;  // packed; all, or those of the bucket being taken
};

}  // namespace surfeit
