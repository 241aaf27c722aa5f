// Sorts records of one size in a given memory: runs that fill it are sorted and spilled to a
// temporary file, and merged as they are read, as often as needed. What fits into memory never sees
// a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// A record begins with two numbers of 64 bits, by which it is sorted; records that share both are
// ordered by the bytes behind them, so that the order of the input does not show. One thread at a
// time; sorts with all threads of the current arena. Throws std::bad_alloc.
class RecordSorter {
 public:
  static constexpr std::size_t kKeyBytes = 16;
  // Besides what is sorted: the blocks of the file's writer.
  static constexpr std::uint64_t kLeastMemory = std::uint64_t{8} << 20;

  struct Options {
    std::size_t record_bytes = 0;    // at least kKeyBytes, a multiple of 4
    std::uint64_t memory_bytes = 0;  // at least kLeastMemory
    std::string temporary_directory;
  };

  explicit RecordSorter(Options options);
  RecordSorter(const RecordSorter&) = delete;
  RecordSorter& operator=(const RecordSorter&) = delete;
  ~RecordSorter();

  // Errors, here and below: kIoError of the temporary file.
  Status add(const std::byte* record);
  // All are in: the first record is the current one. Takes a quarter of the memory from now on when
  // anything was spilled.
  Status finish();

  // The record that is up, nullptr at the end; until advance() or reset().
  const std::byte* current() const { return current_; }
  Status advance();

  // Where the current record stands, and back to it.
  using Mark = std::vector<std::uint64_t>;
  Mark mark() const;
  Status reset(const Mark& mark);

  std::uint64_t count() const { return count_; }
  std::uint64_t temporaryBytes() const { return file_ != nullptr ? file_->size() : 0; }

 private:
  struct Ticket {
    std::uint64_t key = 0;
    std::uint64_t index = 0;
  };
  struct Run {
    std::uint64_t begin = 0, end = 0;  // in the file
  };
  class Merge;

  void sortTickets();
  Status spill();
  Status mergeDownTo(std::size_t most_runs);
  std::size_t mostInputs(std::uint64_t memory) const;

  const Options options_;
  std::size_t capacity_ = 0;
  AlignedBuffer memory_;
  std::size_t filled_ = 0;
  std::vector<Ticket> tickets_;
  std::size_t place_ = 0;  // of the current record, when all are in memory
  std::uint64_t count_ = 0;
  std::unique_ptr<TemporaryFile> file_;
  std::vector<Run> runs_;
  std::unique_ptr<Merge> merge_;
  const std::byte* current_ = nullptr;
};

}  // namespace surfeit
