#include "octree/build/slab.h"

#include <algorithm>

namespace surfeit {

// Pulls batches until `count` surfels lie ahead or the stream ends.
Status SlabCutter::ensure(std::size_t count) {
  while (available_ < count && !stream_ended_) {
    SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const SortedBatch> batch, stream_.next());
    if (batch == nullptr) {
      stream_ended_ = true;
    } else {
      available_ += batch->tickets.size();
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
    if (available_ == 0) break;
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
      batches_.pop_front();
      at_ = 0;
    }
  }
  boundary_level_ = available_ > 0 ? firstDifferentLevel(last, keyAt(0)) : 0;
  slab.bricks.push_back({slab.surfel_count, level, boundary_level_});
}

}  // namespace surfeit
