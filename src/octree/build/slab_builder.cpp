#include "octree/build/slab_builder.h"

#include <algorithm>

#include "core/thread_scratch.h"
#include "octree/build/hidden_surfels.h"
#include "octree/node/hidden_layers.h"
#include "octree/page/node_bounds.h"
#include "octree/page/surfel_group.h"
#include "storage/page_codec.h"

namespace surfeit {
namespace {

// Keeps siblings in the slab until their place in the file is known.
class SlabSiblings : public SiblingSink {
 public:
  explicit SlabSiblings(BuiltSlab& built) : built_(built) {}
  GroupPlace addSiblings(int level, std::span<const LevelNode> siblings) override {
    const std::uint32_t number = static_cast<std::uint32_t>(built_.siblings.size());
    built_.siblings.push_back(
        {static_cast<std::uint8_t>(level), static_cast<std::uint8_t>(siblings.size())});
    built_.nodes.insert(built_.nodes.end(), siblings.begin(), siblings.end());
    return {number, 0};
  }

 private:
  BuiltSlab& built_;
};

class SlabBuilder {
 public:
  SlabBuilder(const Slab& slab, const SceneHeader& header, BuiltSlab& built)
      : slab_(slab),
        header_(header),
        built_(built),
        sink_(built),
        sweep_(sink_, header.flatness_limit) {}

  Status build() {
    built_.clear();
    fetchSurfels();
    built_.surfel_count = surfels_.size();
    built_.giant = slab_.giant;
    std::size_t begin = 0;
    for (const Brick& brick : slab_.bricks) {
      buildBrick(begin, brick);
      begin = brick.end;
    }
    page_begins_.push_back(surfels_.size());
    return encodePages();
  }

 private:
  void fetchSurfels();
  void buildBrick(std::size_t begin, const Brick& brick);
  void markLayers(std::size_t first, const Brick& brick);
  std::size_t cellSize(std::size_t begin, std::size_t end, int boundary_level,
                       std::size_t capacity) const;
  void makeLeaf(std::size_t begin, std::size_t end, FinishedNode& leaf);
  GroupPlace placeSurfels(std::size_t begin, std::size_t end);
  Status encodePages();

  const Slab& slab_;
  const SceneHeader& header_;
  BuiltSlab& built_;
  SlabSiblings sink_;
  CellSweep sweep_;
  std::vector<Surfel>& surfels_ = surfelScratch();
  std::vector<CurveKey>& keys_ = keyScratch();
  std::vector<std::size_t> page_begins_;  // surfels at which pages begin

  // Per thread, because the first touch of memory costs more than what is done with it here
  static std::vector<Surfel>& surfelScratch() {
    std::vector<Surfel>& surfels = threadScratch<std::vector<Surfel>>([] {});
    return surfels;
  }
  static std::vector<CurveKey>& keyScratch() {
    std::vector<CurveKey>& keys = threadScratch<std::vector<CurveKey>>([] {});
    return keys;
  }
};

// Brings the surfels together in curve order.
void SlabBuilder::fetchSurfels() {
  surfels_.resize(slab_.surfel_count);
  keys_.resize(slab_.surfel_count);
  std::size_t at = 0;
  for (const Slab::Run& run : slab_.runs) {
    const Ticket* const tickets = run.batch->tickets.data();
    const Surfel* const surfels = run.batch->surfels.data();
    for (std::size_t i = run.begin; i < run.end; ++i, ++at) {
      // They lie anywhere in the bucket: ask for them before they are needed
      constexpr std::size_t kAhead = 16;
      if (i + kAhead < run.end) __builtin_prefetch(surfels + tickets[i + kAhead].index);
      keys_[at] = tickets[i].key;
      surfels_[at] = surfels[tickets[i].index];
    }
  }
}

void SlabBuilder::buildBrick(std::size_t begin, const Brick& brick) {
  if (!slab_.giant) markLayers(begin, brick);
  FinishedNode node;
  int boundary_level = brick.level;
  while (begin < brick.end) {
    std::size_t end = brick.end;
    if (!slab_.giant)
      end = begin + cellSize(begin, brick.end, boundary_level, header_.leaf_capacity);
    makeLeaf(begin, end, node);
    boundary_level =
        end < brick.end ? firstDifferentLevel(keys_[end - 1], keys_[end]) : brick.level;
    sweep_.place(node, boundary_level, brick.level, std::span(surfels_).first(end));
    begin = end;
  }
  built_.roots.push_back({node, brick.boundary_level, built_.siblings.size()});
}

void SlabBuilder::markLayers(std::size_t first, const Brick& brick) {
  for (std::size_t i = first; i < brick.end; ++i) {
    surfels_[i].flags &= static_cast<std::uint16_t>(~(kSurfelHiddenFront | kSurfelHiddenBack));
  }
  for (const std::size_t most : kLayerCells) {
    int boundary_level = brick.level;
    for (std::size_t begin = first; begin < brick.end;) {
      const std::size_t size = cellSize(begin, brick.end, boundary_level, most);
      if (size <= most) markHidden(std::span(surfels_).subspan(begin, size));
      begin += size;
      if (begin < brick.end) boundary_level = firstDifferentLevel(keys_[begin - 1], keys_[begin]);
    }
  }
}

// Surfels of the cell that begins here, the largest with no more than `capacity`: its level is at
// least the boundary's, and deep enough to leave out the surfel after the last one that fits. More
// surfels than that in one cell of the finest level are one.
std::size_t SlabBuilder::cellSize(std::size_t begin, std::size_t end, int boundary_level,
                                  std::size_t capacity) const {
  int level = boundary_level;
  std::size_t limit = std::min(end - begin, capacity);
  if (end - begin > capacity) {
    level = std::max(level, firstDifferentLevel(keys_[begin], keys_[begin + capacity]));
  }
  if (level > kCurveLevels) {
    level = kCurveLevels;
    limit = end - begin;
  }
  std::size_t size = 1;
  while (size < limit && firstDifferentLevel(keys_[begin], keys_[begin + size]) > level) ++size;
  return size;
}

void SlabBuilder::makeLeaf(std::size_t begin, std::size_t end, FinishedNode& leaf) {
  const std::span<const Surfel> surfels = std::span(surfels_).subspan(begin, end - begin);
  leaf.sums = NodeSums();
  for (const Surfel& surfel : surfels) leaf.sums.add(surfel);
  const glm::vec3 centre = leaf.sums.centre();
  float radius = 0;
  for (const Surfel& surfel : surfels) {
    radius = std::max(radius, reach(centre, surfel.position, radiusWithLoss(surfel)));
  }
  Node& node = leaf.node.node;
  node = leaf.sums.toNode(header_.flatness_limit, radius);
  boundSurfels(surfels, leaf.node);
  leaf.node.child_level = 0;
  leaf.node.has_layers = std::any_of(surfels.begin(), surfels.end(), [](const Surfel& surfel) {
    return hiddenSidesOf(surfel) != 0;
  });
  const GroupPlace place = placeSurfels(begin, end);
  node.page = place.page;
  node.first = place.first;
}

// A leaf begins a new page unless it fits the open one whole; a larger one than a page begins one,
// and fills as many as it needs.
GroupPlace SlabBuilder::placeSurfels(std::size_t begin, std::size_t end) {
  const std::size_t capacity = header_.surfel_group_capacity;
  if (page_begins_.empty() || end - page_begins_.back() > capacity) page_begins_.push_back(begin);
  const GroupPlace place{static_cast<std::uint32_t>(page_begins_.size() - 1),
                         static_cast<std::uint16_t>(begin - page_begins_.back())};
  while (end - page_begins_.back() > capacity) {
    page_begins_.push_back(page_begins_.back() + capacity);
  }
  return place;
}

Status SlabBuilder::encodePages() {
  std::vector<std::byte>& payload = threadScratch<std::vector<std::byte>>([] {});
  std::vector<std::byte>& stored = threadScratch<std::vector<std::byte>>([] {});
  const PageForm form = header_.pageForm();
  for (std::size_t p = 0; p + 1 < page_begins_.size(); ++p) {
    const std::size_t begin = page_begins_[p];
    const std::size_t packed_bytes = encodeSurfelGroup(
        std::span(surfels_).subspan(begin, page_begins_[p + 1] - begin), form, payload);
    SURFEIT_RETURN_IF_ERROR(compressPage(payload, packed_bytes, stored));
    built_.surfel_pages.add(stored, payload.size());
  }
  return {};
}

}  // namespace

void BuiltSlab::clear() {
  surfel_pages.clear();
  nodes.clear();
  siblings.clear();
  roots.clear();
}

Status buildSlab(const Slab& slab, const SceneHeader& header, BuiltSlab& built) {
  return SlabBuilder(slab, header, built).build();
}

}  // namespace surfeit
