#include "octree/neighbours/repeated_surfels.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <span>
#include <utility>

#include "octree/neighbours/local_density.h"

namespace surfeit {
namespace {

// A batch with some of the surfels of another one.
struct ThinnedBatch : SortedBatch {
  std::shared_ptr<const SortedBatch> whole;
};

}  // namespace

bool isSamePiece(const Surfel& a, const Surfel& b) {
  if (a.group != b.group || a.isSphere() != b.isSphere()) return false;
  if (a.isSphere()) return true;
  const float facing = glm::dot(a.normal, b.normal);
  return (a.isTwoSided() && b.isTwoSided() ? std::abs(facing) : facing) > 0;
}

// Whether a surfel repeats a piece at the position of the last one, which has the same key.
bool RepeatFilter::isRepeated(const Surfel& surfel) {
  if (pieces_.front().position != surfel.position) {
    pieces_.assign(1, surfel);
    return false;
  }
  for (const Surfel& piece : pieces_) {
    if (isSamePiece(piece, surfel)) return true;
  }
  pieces_.push_back(surfel);
  return false;
}

// The tickets of what is kept, with their places; none where that is all.
void RepeatFilter::thin(const SortedBatch& batch, SortedBatch& thinned) {
  const std::span<const Ticket> tickets = batch.tickets;
  std::vector<Ticket>& left = thinned.tickets;
  std::vector<std::uint32_t>& places = thinned.places;
  bool is_thinned = false;
  for (std::size_t i = 0; i < tickets.size(); ++i) {
    // Few surfels have the key of another: the rest need not be looked at
    bool is_repeated = false;
    if (has_last_ && tickets[i].key == last_key_) {
      if (pieces_.empty()) pieces_.push_back(batch.surfels[tickets[i - 1].index]);
      const Surfel& surfel = batch.surfels[tickets[i].index];
      is_repeated = isRepeated(surfel);
      if (is_repeated && repeats_ == Repeats::kKeep) {
        repeated_ += (surfel.flags & kSurfelNeedsSize) == 0 || hasAreaAlone(surfel) ? 1 : 0;
        is_repeated = false;
      }
    } else {
      pieces_.clear();
    }
    has_last_ = true;
    last_key_ = tickets[i].key;
    if (is_repeated) {
      ++repeated_;
      if (!is_thinned) {
        left.reserve(tickets.size() - 1);
        left.assign(tickets.begin(), tickets.begin() + std::ptrdiff_t(i));
        places.reserve(tickets.size() - 1);
        for (std::size_t place = 0; place < i; ++place) {
          places.push_back(static_cast<std::uint32_t>(place));
        }
      }
      is_thinned = true;
    } else if (is_thinned) {
      left.push_back(tickets[i]);
      places.push_back(static_cast<std::uint32_t>(i));
    }
  }
  // The next batch may go on here
  if (pieces_.empty()) pieces_.push_back(batch.surfels[tickets.back().index]);
}

Result<std::shared_ptr<const SortedBatch>> RepeatFilter::next() {
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const SortedBatch> batch, source_.next());
    if (batch == nullptr) return batch;
    const std::uint64_t before = leftOut();
    const auto thinned = std::make_shared<ThinnedBatch>();
    thin(*batch, *thinned);
    if (leftOut() == before && dropped_ == 0) return batch;
    if (leftOut() == before) {
      thinned->tickets = batch->tickets;
    } else if (thinned->tickets.empty()) {
      dropped_ += batch->tickets.size();
      continue;
    }
    thinned->dropped_before = std::exchange(dropped_, 0);
    thinned->unfiltered_count = batch->tickets.size();
    thinned->surfels = batch->surfels;
    thinned->whole = std::move(batch);
    return std::shared_ptr<const SortedBatch>(thinned);
  }
}

}  // namespace surfeit
