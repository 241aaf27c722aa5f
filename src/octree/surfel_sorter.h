// Sorts any number of surfels along the curve in a fixed amount of memory: what does not fit is
// spilled to a temporary file as sorted runs, which are merged on the way out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/curve_key.h"
#include "io/file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// A surfel and its place on the curve. Plain bytes without padding.
struct SortedSurfel {
  CurveKey key = 0;
  Surfel surfel;
};
static_assert(sizeof(SortedSurfel) == 72);

// Where sorted surfels come from: fills the front of `out` and returns how many, 0 at the end.
class SortedSurfelStream {
 public:
  virtual ~SortedSurfelStream() = default;
  virtual Result<std::size_t> next(std::span<SortedSurfel> out) = 0;
};

// Add all, finish, then take all. Surfels of one key come out ordered by content, so that the order
// of the input does not show. One thread at a time; sorting uses all threads of the current arena.
class SurfelSorter : public SortedSurfelStream {
 public:
  // Bytes that one surfel takes while it waits in memory.
  static constexpr std::size_t kBytesPerSurfel = sizeof(SortedSurfel) + 16;

  // Holds at most `capacity` surfels (at least 1024) in memory; `expected_count` bounds what is
  // allocated when fewer come.
  static Result<std::unique_ptr<SurfelSorter>> create(std::size_t capacity,
                                                      std::uint64_t expected_count,
                                                      const RootCube& cube,
                                                      std::string temporary_directory);

  Status add(std::span<const Surfel> surfels);
  Status finish();
  Result<std::size_t> next(std::span<SortedSurfel> out) override;

  std::uint64_t temporaryBytes() const { return spill_bytes_; }

 private:
  // What is sorted: 16 bytes instead of 72.
  struct Ticket {
    CurveKey key;
    std::uint64_t index;
  };
  // A sorted run in the temporary file and the part of it that is in memory.
  struct Run {
    std::uint64_t offset = 0, records_left = 0;
    std::vector<SortedSurfel> window;
    std::size_t at = 0;
  };

  SurfelSorter(std::size_t capacity, const RootCube& cube, std::string directory)
      : capacity_(capacity), cube_(cube), directory_(std::move(directory)) {}
  void sortTickets();
  Status spill();
  Status refill(Run& run);
  bool comesAfter(std::size_t a, std::size_t b) const;

  std::size_t capacity_;
  RootCube cube_;
  std::string directory_;
  std::vector<Surfel> surfels_;
  std::vector<Ticket> tickets_;
  std::size_t taken_ = 0;  // of the in-memory tickets
  std::unique_ptr<TemporaryFile> file_;
  std::uint64_t spill_bytes_ = 0;
  std::vector<Run> runs_;
  std::vector<std::size_t> heap_;  // run numbers, the next surfel's run on top
};

// Orders surfels of one key by content.
bool contentLess(const Surfel& a, const Surfel& b);

}  // namespace surfeit
