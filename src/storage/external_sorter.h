// Sorts records of one size in a given memory. Runs that fill it are sorted and spilled to a
// temporary file, and merged as they are read:
//
//   add -> run --sort--> file ... finish: merge runs while they are too many ... merge -> read
//
// What fits into memory never sees a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/assert.h"
#include "storage/file.h"
#include "storage/record_sort.h"
#include "surfeit/status.h"

namespace surfeit {

// Records come out in the order of recordLess (record_sort.h); that of the input does not show. One
// thread at a time; sorts with all threads of the current arena. Throws std::bad_alloc. The first
// failure, or exception, is final: every later call returns it.
//
// Memory, all included but for the stacks: that of `count` records where these fit. Else 2.125 MiB
// for the file and the list of runs, and beside them what memory_bytes leaves: one run, or the
// blocks of a merge. After finish() it is one block per run, within what reading_bytes leaves, and
// no more than 1 MiB each. Only what is used is ever touched.
class ExternalSorter {
 public:
  // Runs that are kept before some are merged. Of so many at most, the memory decides how many are
  // merged at once: one for every 32 KiB, or 30 in the least memory.
  static constexpr std::size_t kMostRuns = 4096;
  static constexpr std::uint64_t kAnyCount = std::numeric_limits<std::uint64_t>::max();
  // A good least for who does not know how much is to come: runs of 6 MiB.
  static constexpr std::uint64_t kLeastMemory = std::uint64_t{8} << 20;

  // Neither memory may be below leastMemoryBytes().
  struct Options {
    std::size_t record_bytes = 0;     // at least kRecordKeyBytes, a multiple of 4
    std::uint64_t count = kAnyCount;  // records to come, or more than do
    std::uint64_t memory_bytes = 0;   // until finish() returns
    // From then on. 0: memory_bytes when nothing was spilled, else a quarter of it, or the least.
    std::uint64_t reading_bytes = 0;
    std::string temporary_directory;
    std::size_t most_runs = kMostRuns;  // from 2; fewer make many passes, for tests
  };

  // The least memory that sorts so many records: no more than 3.125 MiB, however many. Merging
  // takes more where records are larger than 300 KiB.
  static std::uint64_t leastMemoryBytes(std::uint64_t count, std::size_t record_bytes);

  explicit ExternalSorter(Options options);
  ExternalSorter(const ExternalSorter&) = delete;
  ExternalSorter& operator=(const ExternalSorter&) = delete;
  ~ExternalSorter();

  // Errors, here and below: kIoError of the temporary file, damage found by its checksums included.
  Status add(const std::byte* record);
  template <typename Record>
  requires std::is_class_v<Record> Status add(const Record& record) {
    SURFEIT_ASSERT(sizeof record == options_.record_bytes);
    return add(reinterpret_cast<const std::byte*>(&record));
  }
  // All are in: the first record is the current one.
  Status finish();

  // The current record, until the next call of another function; nullptr at the end, and after a
  // failure.
  const std::byte* current() const { return current_; }
  // Goes on to the next record. What has been read gives its space on the disk back.
  Status advance();
  // Copies the current record and those that follow it, as many as `out` holds unless the end
  // comes, and goes on behind them. Returns how many, 0 at the end.
  Result<std::size_t> read(std::span<std::byte> out);
  template <typename Records>
  Result<std::size_t> next(Records&& out) {
    return read(std::as_writable_bytes(std::span(out)));
  }

  // Where the current record stands, and back to it. From the first mark on, what is read keeps its
  // space on the disk.
  using Mark = std::vector<std::uint64_t>;
  Mark mark();
  Status reset(const Mark& mark);

  std::uint64_t count() const { return count_; }
  // Bytes written to the temporary file so far, those of merges included.
  std::uint64_t temporaryBytes() const { return file_ != nullptr ? file_->size() : 0; }

 private:
  class Merge;
  // Sorted records in the file; begins at a multiple of kDirectAlignment.
  struct Run {
    std::uint64_t offset = 0;
    std::uint64_t records = 0;
  };
  // What runs are made of: records with a checksum.
  struct Unit {
    explicit Unit(std::size_t record_size);
    std::uint64_t runBytes(std::uint64_t run_records) const;

    std::size_t record_bytes, records, bytes;
  };

  template <typename Work>
  Status attempt(const Work& work);
  void fail(Status status);
  Status makeRoom();
  Status spill();
  Status appendUnits(Bytes sorted);
  Status mergeDownTo(std::size_t most_runs);
  void standAt(std::size_t place);

  const Options options_;
  const Unit unit_;
  std::uint64_t merge_bytes_ = 0;    // for a merge before and
  std::uint64_t reading_bytes_ = 0;  // after finish() returns
  std::uint64_t most_kept_ = 0;      // records that may stay in memory from then on
  std::size_t capacity_ = 0;         // records of a run
  AlignedBuffer memory_;             // the run being filled
  std::size_t filled_ = 0;           // records in it
  std::size_t place_ = 0;            // of the current one, while all are in it
  std::uint64_t count_ = 0;

  std::unique_ptr<TemporaryFile> file_;
  std::vector<Run> runs_;
  std::unique_ptr<Merge> merge_;  // from finish() on, when anything was spilled
  const std::byte* current_ = nullptr;
  Status failure_;
};

}  // namespace surfeit
