// Sorts receivers along the curve in a given memory. Runs that fill it are sorted and spilled to a
// temporary file, and merged as they are read:
//
//   add -> run --sort--> file ... finish: merge runs while they are too many ... merge -> next
//
// What fits into memory never sees a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/curve_key.h"
#include "gather/rules/receiver.h"
#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// A receiver, its place on the curve, and its index in the input.
struct SortedReceiver {
  CurveKey key = 0;
  std::uint64_t index = 0;
  LocalReceiver receiver;
  std::uint32_t reserved = 0;  // no padding: receivers are written as bytes

  bool operator<(const SortedReceiver& other) const {
    return key != other.key ? key < other.key : index < other.index;
  }
};
static_assert(sizeof(SortedReceiver) == 56);

// One thread at a time; sorts with all threads of the current arena. Throws std::bad_alloc. After a
// failure or an exception it is of no further use.
//
// Memory, all included but for the stack of the thread that writes the file: 56 bytes per receiver
// of `count` where these fit. Else 2.125 MiB for the file and the list of runs, and beside them
// what memory_bytes leaves: one run, or the blocks of a merge. After finish() it is one block per
// run, within what reading_bytes leaves, and no more than 1 MiB each. Only what is used is ever
// touched.
class ReceiverSorter {
 public:
  // Runs that are kept before some are merged. Of so many at most, the memory decides how many are
  // merged at once: one for every 44 KiB, or 22 in the least memory.
  static constexpr std::size_t kMostRuns = 4096;

  // Neither memory may be below leastMemoryBytes(count).
  struct Options {
    std::uint64_t count = 0;          // receivers to come, or more than do
    std::uint64_t memory_bytes = 0;   // until finish() returns
    std::uint64_t reading_bytes = 0;  // from then on; 0: memory_bytes
    std::string temporary_directory;
    std::size_t most_runs = kMostRuns;  // from 2; fewer make many passes, for tests
  };

  // The least memory that sorts so many receivers: no more than 3.125 MiB, however many.
  static std::uint64_t leastMemoryBytes(std::uint64_t count);

  explicit ReceiverSorter(Options options);
  ReceiverSorter(const ReceiverSorter&) = delete;
  ReceiverSorter& operator=(const ReceiverSorter&) = delete;
  ~ReceiverSorter();

  // In any order; every index once, keys below 2^63. Errors, here and below: kIoError of the
  // temporary file, damage found by its checksums included.
  Status add(const SortedReceiver& receiver);
  // All are in.
  Status finish();
  // The next receivers by key, and by index where keys are equal, whatever the memory. Fills `out`
  // unless the end comes; returns how many, 0 at the end. What has been read gives its space on the
  // disk back.
  Result<std::size_t> next(std::span<SortedReceiver> out);

  // Bytes written to the temporary file so far, those of merges included.
  std::uint64_t temporaryBytes() const { return file_ != nullptr ? file_->size() : 0; }

 private:
  class Merge;
  // Sorted receivers in the file; begins at a multiple of kDirectAlignment.
  struct Run {
    std::uint64_t offset = 0;
    std::uint64_t receivers = 0;
  };

  std::span<SortedReceiver> receivers() const;
  Status spill();
  Status appendUnits(std::span<const SortedReceiver> sorted);
  Status mergeDownTo(std::size_t most_runs);
  Result<Run> mergeToRun(std::span<const Run> runs, std::uint64_t block_bytes);

  const Options options_;
  std::uint64_t merge_bytes_ = 0;    // for a merge before and
  std::uint64_t reading_bytes_ = 0;  // after finish() returns
  std::size_t capacity_ = 0;         // receivers of a run
  AlignedBuffer memory_;             // the run being filled
  std::size_t filled_ = 0;           // receivers in it
  std::size_t place_ = 0;            // of them, handed out
  std::uint64_t added_ = 0;

  std::unique_ptr<TemporaryFile> file_;
  std::vector<Run> runs_;
  std::unique_ptr<Merge> merge_;  // from finish() on, when anything was spilled
};

}  // namespace surfeit
