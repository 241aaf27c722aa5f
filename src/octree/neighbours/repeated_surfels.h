// Surfels that repeat another: overlapping clouds, the tiles of a survey above all, hold the same
// places more than once.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "octree/build/sorted_surfels.h"
#include "surfeit/index.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Whether two surfels at one position are one piece of surface, so that one of them is enough: of
// one group, both spheres or both disks that face the same way, where of what is two-sided either
// normal will do. Two sides of a sheet are two pieces.
bool isSamePiece(const Surfel& a, const Surfel& b);

// The surfels of another stream, with Repeats::kThin without those that repeat one before them: of
// surfels with one key those of one position follow each other, in an order that follows from their
// content, so the first of a piece does not depend on the order of the inputs. What is handed out
// holds the other stream's batch; where surfels are left out it has tickets of its own.
class RepeatFilter : public SortedSurfelStream {
 public:
  // Beside the batches of the other stream, for each of their surfels.
  static constexpr std::size_t kBytesPerSurfel = 2 * (sizeof(Ticket) + sizeof(std::uint32_t));

  RepeatFilter(SortedSurfelStream& source, Repeats repeats) : source_(source), repeats_(repeats) {}

  Result<std::shared_ptr<const SortedBatch>> next() override;

  // Surfels that repeat another, so far. Where they are kept only those whose area counts twice:
  // areas that are found from neighbours are shared by the surfels at a position.
  std::uint64_t repeated() const { return repeated_; }
  std::uint64_t leftOut() const { return repeats_ == Repeats::kThin ? repeated_ : 0; }

 private:
  bool isRepeated(const Surfel& surfel);
  void thin(const SortedBatch& batch, SortedBatch& thinned);

  SortedSurfelStream& source_;
  const Repeats repeats_;
  std::uint64_t repeated_ = 0;
  std::uint64_t dropped_ = 0;  // surfels of batches of which nothing was left, since the last one
  // Of the last ticket: its key, and the pieces at its position (at most 7 of each group); empty
  // while no other surfel has asked for them
  bool has_last_ = false;
  CurveKey last_key_ = 0;
  std::vector<Surfel> pieces_;
};

}  // namespace surfeit
