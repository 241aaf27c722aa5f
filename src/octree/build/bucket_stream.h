// Takes the buckets of a SurfelStore in order, sorts each in memory and hands it out. Reads ahead
// while the last bucket is being used.
#pragma once

#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <vector>

#include "core/bounds.h"
#include "core/recycler.h"
#include "octree/build/sorted_surfels.h"
#include "octree/build/surfel_store.h"
#include "surfeit/progress.h"

namespace surfeit {

class BucketStream : public SortedSurfelStream {
 public:
  // Bytes that a surfel of a bucket takes at most while buckets follow each other: packed once;
  // unpacked and as a ticket in this batch and the last one; and sorting.
  static constexpr std::size_t kBytesPerSurfel = 64 + 2 * (64 + sizeof(Ticket)) + sizeof(Ticket);

  struct Options {
    RootCube cube;
    std::size_t capacity = 0;        // most surfels of a bucket that is sorted in memory
    std::uint64_t spare_memory = 0;  // for blocks that are distributed again, before another file
    std::string temporary_directory;
  };

  // `store` is finished. Buckets of more surfels than fit are distributed again, by finer
  // splitters: also when all surfels have one key, or are equal. `progress` is asked whether to go
  // on.
  BucketStream(std::unique_ptr<SurfelStore> store, Options options, const Progress& progress);
  ~BucketStream() override;

  Result<std::shared_ptr<const SortedBatch>> next() override;

  // Most bytes in temporary files so far.
  std::uint64_t temporaryBytes() const { return peak_temporary_bytes_; }

 private:
  // A store whose buckets are being taken. Its words are curve keys, or with level > 0 the
  // content's word number level - 1, all words before being equal.
  struct Level {
    std::unique_ptr<SurfelStore> store;
    int word = 0;
    std::size_t next_bucket = 0;
  };
  // The blocks of a bucket, being read or read.
  struct Reading {
    std::vector<AlignedBuffer> buffers;
    std::vector<Bytes> views;
    std::vector<std::size_t> in_file;  // blocks that are read, the others lie in memory
    const SurfelStore* store = nullptr;
    std::size_t bucket = 0;
    std::vector<std::future<Status>> parts;
  };

  void startReading(const SurfelStore& store, std::size_t bucket);
  Status finishReading();
  void readAhead();
  Result<std::shared_ptr<const SortedBatch>> load(const SurfelStore& store, std::size_t bucket);
  Result<std::shared_ptr<const SortedBatch>> nextOfEqual();
  Status unpack(std::span<const SurfelStore::Block> blocks, std::span<const Bytes> packed,
                SortedBatch& batch);
  Status fetchSurfels(const SurfelStore& store, const SurfelStore::Block& block,
                      AlignedBuffer& buffer, std::vector<Surfel>& surfels) const;
  Status namedError(const Status& status) const;
  void sort(SortedBatch& batch);
  Status distribute(const SurfelStore& store, std::size_t bucket, int word);
  Result<std::vector<SortWord>> chooseSplitters(const SurfelStore& store, std::size_t bucket,
                                                int& word);
  SortWord wordOf(const Surfel& surfel, int word) const;
  void noteTemporaryBytes();

  const Options options_;
  const Progress& progress_;
  std::vector<Level> levels_;
  Reading reading_;
  std::vector<Ticket> scratch_;
  Recycler<SortedBatch> batches_;
  std::uint64_t peak_temporary_bytes_ = 0;
  // A bucket of equal surfels, handed out piece by piece
  const SurfelStore* equal_store_ = nullptr;
  std::size_t equal_bucket_ = 0, equal_block_ = 0;
};

}  // namespace surfeit
