#include "octree/build/slab_builder.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <span>

#include "core/long_side.h"
#include "core/thread_scratch.h"
#include "octree/build/curve_cells.h"
#include "octree/build/hidden_surfels.h"
#include "octree/build/loose_surfels.h"
#include "octree/node/hidden_layers.h"
#include "octree/page/node_bounds.h"
#include "octree/page/surfel_group.h"
#include "octree/page/surfel_marks.h"
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

// A cell in which sheets are looked for that hide each other.
struct LayerCell {
  std::span<Surfel> surfels;
  Bounds3 box;
  float reach = 0;  // as far apart as such sheets are at most

  bool reaches(const Bounds3& other) const {
    const glm::vec3 apart =
        glm::max(glm::max(other.min - box.max, box.min - other.max), glm::vec3(0));
    return glm::dot(apart, apart) <= reach * reach;
  }
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
  using Cell = CurveCell;
  void fetchSurfels();
  void buildBrick(std::size_t begin, const Brick& brick);
  void markSurfels(std::size_t first, const Brick& brick);
  void markLayers(std::size_t first, const Brick& brick);
  void addAround(const LayerCell& cell, const LayerCell& other);
  void markLoose(const Cell& cell);
  template <typename Visit>
  void visitCells(std::size_t begin, std::size_t end, int boundary_level, std::size_t capacity,
                  const Visit& visit);
  Cell cellAt(std::size_t begin, std::size_t end, int boundary_level, std::size_t capacity) const {
    return curveCellAt(keys_, begin, end, boundary_level, capacity);
  }
  Bounds3 cubeOf(const Cell& cell) const;
  void makeLeaf(std::size_t begin, std::size_t end, FinishedNode& leaf);
  GroupPlace placeSurfels(std::size_t begin, std::size_t end);
  Status encodePages();

  const Slab& slab_;
  const SceneHeader& header_;
  BuiltSlab& built_;
  SlabSiblings sink_;
  CellSweep sweep_;
  LooseSurfels loose_;
  std::vector<LayerCell> layer_cells_;
  std::vector<Surfel> around_;  // those of a layer cell, then those around it
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
  if (!slab_.giant) markSurfels(begin, brick);
  FinishedNode node;
  int boundary_level = brick.level;
  while (begin < brick.end) {
    std::size_t end = brick.end;
    if (!slab_.giant)
      end = begin + cellAt(begin, brick.end, boundary_level, header_.leaf_capacity).size;
    makeLeaf(begin, end, node);
    boundary_level =
        end < brick.end ? firstDifferentLevel(keys_[end - 1], keys_[end]) : brick.level;
    sweep_.place(node, boundary_level, brick.level, std::span(surfels_).first(end));
    begin = end;
  }
  built_.roots.push_back({node, brick.boundary_level, built_.siblings.size()});
}

// Hidden sides, and what is loose.
void SlabBuilder::markSurfels(std::size_t first, const Brick& brick) {
  for (std::size_t i = first; i < brick.end; ++i) {
    surfels_[i].flags &= static_cast<std::uint16_t>(~kSurfelMarks);
  }
  markLayers(first, brick);
  visitCells(first, brick.end, brick.level, kBentCell, [&](const Cell& cell) {
    markHidden(std::span(surfels_).subspan(cell.begin, cell.size));
  });
  visitCells(first, brick.end, brick.level, kLooseCell, [&](const Cell& cell) { markLoose(cell); });
}

// In the cells of a brick, each with what lies around it in the brick.
void SlabBuilder::markLayers(std::size_t first, const Brick& brick) {
  layer_cells_.clear();
  visitCells(first, brick.end, brick.level, kLayerCell, [&](const Cell& cell) {
    LayerCell& added = layer_cells_.emplace_back();
    added.surfels = std::span(surfels_).subspan(cell.begin, cell.size);
    float area = 0;
    for (const Surfel& surfel : added.surfels) {
      added.box.add(surfel.position);
      area += surfel.area / float(cell.size);
    }
    added.reach = kClosestLayers * std::sqrt(area);
  });
  for (const LayerCell& cell : layer_cells_) {
    around_.assign(cell.surfels.begin(), cell.surfels.end());
    for (const LayerCell& other : layer_cells_) {
      if (&other != &cell && cell.reaches(other.box)) addAround(cell, other);
    }
    if (around_.size() > kMostAround) around_.resize(cell.surfels.size());
    markHidden(around_, cell.surfels.size());
    for (std::size_t i = 0; i < cell.surfels.size(); ++i) cell.surfels[i].flags = around_[i].flags;
  }
}

void SlabBuilder::addAround(const LayerCell& cell, const LayerCell& other) {
  for (const Surfel& surfel : other.surfels) {
    if (cell.reaches({surfel.position, surfel.position})) around_.push_back(surfel);
  }
}

void SlabBuilder::markLoose(const Cell& cell) {
  const std::span<Surfel> surfels = std::span(surfels_).subspan(cell.begin, cell.size);
  if (!loose_.look(surfels, cubeOf(cell), cubeOf({0, 1, 0}))) return;
  visitCells(cell.begin, cell.begin + cell.size, cell.level, kLoosePart, [&](const Cell& part) {
    loose_.mark(part.begin - cell.begin, std::span(surfels_).subspan(part.begin, part.size));
  });
}

// The largest cells of up to `capacity` surfels. More surfels in one cell of the finest level are
// left out.
template <typename Visit>
void SlabBuilder::visitCells(std::size_t begin, std::size_t end, int boundary_level,
                             std::size_t capacity, const Visit& visit) {
  while (begin < end) {
    const Cell cell = cellAt(begin, end, boundary_level, capacity);
    if (cell.size <= capacity) visit(cell);
    begin += cell.size;
    if (begin < end) boundary_level = firstDifferentLevel(keys_[begin - 1], keys_[begin]);
  }
}

Bounds3 SlabBuilder::cubeOf(const Cell& cell) const {
  return cellBounds(surfels_[cell.begin].position, cell.level, header_.cube);
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
  leaf.node.marks = 0;
  for (const Surfel& surfel : surfels) leaf.node.marks |= marksOf(surfel);
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
