// Surfels in any order go in, and come out by buckets: ranges of the curve, each small enough to be
// sorted in memory. Full blocks of a bucket wait in memory while the allowance lasts, then in a
// temporary file. docs/architecture.md, "Sorting", says why buckets and not sorted runs.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "storage/file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// What surfels are distributed by: their curve key, or words of their content where all keys are
// equal.
using SortWord = std::uint64_t;

class SurfelStore {
 public:
  struct Plan {
    // Bucket b holds words in [splitters[b - 1], splitters[b]); rising, one less than buckets.
    std::vector<SortWord> splitters;
    std::size_t block_surfels = 2048;  // that are packed at once; every bucket has room for as many
    std::uint64_t memory_bytes = 0;    // for packed blocks
    std::string temporary_directory;
    bool gives_back = false;  // the space of blocks that were read: for disks that are nearly full
  };

  // A packed block of a bucket, at an address in memory or an offset in the temporary file.
  struct Block {
    std::uint64_t place = 0;
    std::uint32_t bytes = 0;
    std::uint32_t surfels : 31 = 0;
    std::uint32_t in_memory : 1 = 0;
  };
  static_assert(sizeof(Block) == 16);

  explicit SurfelStore(Plan plan);
  ~SurfelStore();

  // Adds surfels, each by its word. From any thread. Errors: kIoError of the temporary file.
  Status add(std::span<const Surfel> surfels, std::span<const SortWord> words);
  // Packs what is still open. Call once, when all are added; then from any thread:
  Status finish();

  std::size_t bucketCount() const { return bucket_count_; }
  bool givesBack() const { return plan_.gives_back; }
  std::uint64_t surfelCount(std::size_t bucket) const;
  std::span<const Block> blocks(std::size_t bucket) const;
  // The bytes of a block, for unpackSurfels; in `buffer` when they come from the file.
  Result<Bytes> fetch(const Block& block, AlignedBuffer& buffer) const;
  // The same of a block that lies in memory.
  Bytes inMemory(const Block& block) const;

  // The block will not be fetched again.
  void release(const Block& block) const;

  // Bytes in the temporary file so far. From any thread.
  std::uint64_t temporaryBytes() const { return temporary_bytes_; }

 private:
  struct Bucket;

  std::size_t bucketOf(SortWord word) const;
  Status append(Bucket& bucket, std::span<const Surfel> surfels);
  Status store(Bucket& bucket, std::span<const Surfel> surfels);
  std::byte* allocate(std::size_t bytes);

  const Plan plan_;
  std::size_t bucket_count_;
  std::vector<std::uint32_t> first_bucket_;  // by the top bits of a word
  std::unique_ptr<Bucket[]> buckets_;
  AlignedBuffer open_;  // the open blocks of all buckets

  std::mutex memory_mutex_;
  std::vector<AlignedBuffer> chunks_;  // filled one after the other
  std::size_t chunk_used_ = 0;
  std::uint64_t memory_used_ = 0;
  bool memory_full_ = false;

  std::mutex file_mutex_;  // guards creation
  std::unique_ptr<TemporaryFile> file_;
  std::atomic<std::uint64_t> temporary_bytes_{0};
};

}  // namespace surfeit
