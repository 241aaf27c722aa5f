#include "octree/build/slab.h"

#include <algorithm>

namespace surfeit {

// A part of a cloud begins where every cell that it goes on with has had kFreshSurfels.
SlabCutter::SlabCutter(SortedSurfelStream& stream, const StreamEnds& ends)
    : stream_(stream), boundary_level_(ends.begin_level), end_level_(ends.end_level) {
  for (int level = 0; level < ends.begin_level && level <= kCurveLevels; ++level) {
    cell_places_[static_cast<std::size_t>(level)] = -std::int64_t{kFreshSurfels};
  }
}

// Pulls batches until `count` surfels lie ahead or the stream ends.
Status SlabCutter::ensure(std::size_t count) {
  while (available_ < count && !stream_ended_) {
    SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const SortedBatch> batch, stream_.next());
    if (batch == nullptr) {
      stream_ended_ = true;
    } else {
      available_ += batch->tickets.size();
      if (batches_.empty()) batch_place_ += std::int64_t(batch->dropped_before);
      batches_.push_back(std::move(batch));
    }
  }
  return {};
}

CurveKey SlabCutter::keyAt(std::size_t offset) const {
  offset += at_;
  for (const std::shared_ptr<const SortedBatch>& batch : batches_) {
    if (offset < batch->tickets.size()) return batch->tickets[offset].key;
    offset -= batch->tickets.size();
  }
  return 0;
}

// Unfiltered surfels before the front.
std::int64_t SlabCutter::frontPlace() const {
  return batch_place_ + std::int64_t(batches_.front()->placeOf(at_));
}

// Whether a slab ends before the front in any case.
bool SlabCutter::beginsAnew() const {
  if (boundary_level_ < 1 || boundary_level_ > kCurveLevels) return false;
  const std::int64_t cell = cell_places_[static_cast<std::size_t>(boundary_level_ - 1)];
  return frontPlace() - cell >= std::int64_t{kFreshSurfels};
}

std::size_t SlabCutter::runInCell(int level, std::size_t limit) const {
  const CurveKey first = keyAt(0);
  std::size_t inside = 1, outside = std::min(available_, limit) + 1;
  while (inside + 1 < outside) {
    const std::size_t middle = inside + (outside - inside) / 2;
    if (firstDifferentLevel(first, keyAt(middle - 1)) > level) {
      inside = middle;
    } else {
      outside = middle;
    }
  }
  return inside;
}

Result<std::optional<Slab>> SlabCutter::next() {
  Slab slab;
  while (slab.surfel_count < kBrickSurfels) {
    SURFEIT_RETURN_IF_ERROR(ensure(kBrickSurfels + 1));
    if (available_ == 0 || (slab.surfel_count > 0 && beginsAnew())) break;
    int level = boundary_level_;
    if (available_ > kBrickSurfels) {
      level = std::max(level, firstDifferentLevel(keyAt(0), keyAt(kBrickSurfels)));
    }
    if (in_giant_ || level > kCurveLevels) {
      if (slab.surfel_count > 0) break;
      takeGiantPiece(slab);
      return std::optional<Slab>(std::move(slab));
    }
    take(runInCell(level, kBrickSurfels), level, slab);
  }
  if (slab.surfel_count == 0) return std::optional<Slab>();
  return std::optional<Slab>(std::move(slab));
}

void SlabCutter::takeGiantPiece(Slab& slab) {
  const bool begins = !in_giant_;
  take(runInCell(kCurveLevels, kBrickSurfels), kCurveLevels, slab);
  in_giant_ = boundary_level_ > kCurveLevels;
  slab.giant = GiantPiece{begins, !in_giant_};
}

// Moves `count` surfels from the front to the slab, as a brick.
void SlabCutter::take(std::size_t count, int level, Slab& slab) {
  const CurveKey last = keyAt(count - 1);
  slab.surfel_count += count;
  available_ -= count;
  while (count > 0) {
    const std::size_t size = std::min(count, batches_.front()->tickets.size() - at_);
    if (size > 0) slab.runs.push_back({batches_.front(), at_, at_ + size});
    at_ += size;
    count -= size;
    if (at_ == batches_.front()->tickets.size()) {
      batch_place_ += std::int64_t(batches_.front()->unfilteredCount());
      batches_.pop_front();
      at_ = 0;
      if (!batches_.empty()) batch_place_ += std::int64_t(batches_.front()->dropped_before);
    }
  }
  boundary_level_ = available_ > 0 ? firstDifferentLevel(last, keyAt(0)) : end_level_;
  for (int begun = boundary_level_; available_ > 0 && begun <= kCurveLevels; ++begun) {
    cell_places_[static_cast<std::size_t>(begun)] = frontPlace();
  }
  slab.bricks.push_back({slab.surfel_count, level, boundary_level_});
}

}  // namespace surfeit
