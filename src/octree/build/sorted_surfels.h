// Surfels in curve order, as the octree is built from them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "storage/file.h"
#include "octree/build/curve_sort.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// A run of surfels along the curve: tickets in order, surfels in any. Immutable when handed out, so
// threads may share it.
struct SortedBatch {
  std::vector<Ticket> tickets;
  std::span<Surfel> surfels;  // what the tickets' indices point into
  // Where a filter left surfels out: how many of the stream behind it came before this batch and
  // after the last one, the place of each ticket among those of the batch, and their number.
  std::uint64_t dropped_before = 0;
  std::vector<std::uint32_t> places;
  std::size_t unfiltered_count = 0;

  // Surfels of the stream before any filter.
  std::size_t placeOf(std::size_t ticket) const { return places.empty() ? ticket : places[ticket]; }
  std::size_t unfilteredCount() const { return places.empty() ? tickets.size() : unfiltered_count; }

  // Room for `count` surfels, each in one cache line; what was there is lost. Batches are used again
  // for buckets of other sizes: much more room than is needed is given back, or each would grow to
  // the largest.
  void resize(std::size_t count) {
    const std::size_t bytes = count * sizeof(Surfel);
    if (memory_.capacity() > bytes + bytes / kMostSpare) {
      memory_ = AlignedBuffer();
      tickets = std::vector<Ticket>();
    }
    tickets.resize(count);
    memory_.reserve(bytes);
    surfels = {reinterpret_cast<Surfel*>(memory_.data()), count};
  }

 private:
  static constexpr std::size_t kMostSpare = 4;  // a quarter

  AlignedBuffer memory_;
};

// Where sorted surfels come from, batch after batch. Surfels of one key come in an order that follows
// from their content. One thread at a time; a stream may use all threads of the current arena.
class SortedSurfelStream {
 public:
  virtual ~SortedSurfelStream() = default;
  // The next batch, never empty; nullptr at the end.
  virtual Result<std::shared_ptr<const SortedBatch>> next() = 0;
};

}  // namespace surfeit
