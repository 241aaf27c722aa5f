// The sweep rests on one fact: a cell of level k is a run of keys that share k digits, so two
// neighbours on the curve whose keys first differ at level d close every open cell of level d and
// deeper, and nothing else.
#include "octree/octree_builder.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/assert.h"

namespace surfeit {
namespace {

// Sorted surfels taken from the stream at once.
constexpr std::size_t kWindow = 4096;

// How far surfels or children reach from `centre`: the radius of a sphere around it that holds
// them all. Rounding of the sums is made up for in the last digits.
float reach(const glm::vec3& centre, const glm::vec3& at, float radius) {
  return (glm::length(at - centre) + radius) * 1.000001f;
}

}  // namespace

Status OctreeBuilder::build(SortedSurfelStream& stream, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(refill(stream));
  int boundary_level = 0;  // the first leaf may be the root
  while (at_ < window_.size()) {
    if (progress.isCancelled()) return Status::interrupted();
    Pending leaf;
    const std::uint64_t taken_before = surfels_taken_;
    const CurveKey first_key = window_[at_].key;
    const std::size_t size = leafSize(boundary_level);
    CurveKey last_key = first_key;
    if (size > 0) {
      last_key = window_[at_ + size - 1].key;
      SURFEIT_RETURN_IF_ERROR(takeLeaf(size, leaf));
    } else {
      SURFEIT_RETURN_IF_ERROR(takeEqualKeys(stream, leaf));
    }
    SURFEIT_RETURN_IF_ERROR(refill(stream));
    boundary_level = at_ < window_.size() ? firstDifferentLevel(last_key, window_[at_].key) : 0;
    SURFEIT_RETURN_IF_ERROR(place(std::move(leaf), boundary_level));
    progress.advance(surfels_taken_ - taken_before);
  }
  SURFEIT_CHECK(cells_.empty());
  return {};
}

// Keeps more surfels than a leaf holds in the window, until the stream ends.
Status OctreeBuilder::refill(SortedSurfelStream& stream) {
  const std::size_t needed = writer_.header().leaf_capacity + 1;
  if (stream_ended_ || window_.size() - at_ >= needed) return {};
  window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(at_));
  at_ = 0;
  while (!stream_ended_ && window_.size() < needed) {
    const std::size_t before = window_.size();
    window_.resize(std::max(kWindow, needed));
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                             stream.next(std::span(window_).subspan(before)));
    window_.resize(before + got);
    stream_ended_ = got == 0;
  }
  return {};
}

// The leaf's cell is the largest that begins here and holds no more than a leaf may. It begins here
// when its level is at least the boundary's; it holds few enough when the surfel after the last
// one that fits lies outside.
std::size_t OctreeBuilder::leafSize(int boundary_level) const {
  const std::size_t capacity = writer_.header().leaf_capacity;
  const std::size_t available = window_.size() - at_;
  const CurveKey first_key = window_[at_].key;
  int level = boundary_level;
  if (available > capacity) {
    level = std::max(level, firstDifferentLevel(first_key, window_[at_ + capacity].key));
  }
  if (level > kCurveLevels) return 0;
  std::size_t size = 1;
  while (size < std::min(available, capacity) &&
         firstDifferentLevel(first_key, window_[at_ + size].key) > level) {
    ++size;
  }
  return size;
}

Status OctreeBuilder::takeSurfels(std::size_t size, std::vector<glm::vec4>& disks, Pending& leaf) {
  for (std::size_t i = 0; i < size; ++i) {
    const Surfel& surfel = window_[at_ + i].surfel;
    leaf.sums.add(surfel);
    disks.emplace_back(surfel.position, surfel.radius);
    SURFEIT_RETURN_IF_ERROR(writer_.addSurfel(surfel));
  }
  at_ += size;
  surfels_taken_ += size;
  return {};
}

Status OctreeBuilder::takeLeaf(std::size_t size, Pending& leaf) {
  SURFEIT_ASSIGN_OR_RETURN(const GroupPlace place, writer_.beginLeaf(size));
  std::vector<glm::vec4> disks;
  SURFEIT_RETURN_IF_ERROR(takeSurfels(size, disks, leaf));
  Node& node = leaf.node.node;
  node = leaf.sums.toNode(writer_.header().flatness_limit);
  for (const glm::vec4& disk : disks) {
    node.radius = std::max(node.radius, reach(node.position, glm::vec3(disk), disk.w));
  }
  node.page = place.page;
  node.first = place.first;
  return {};
}

// More surfels than a leaf holds in one cell of the finest level: a leaf of any size. It begins a
// page, so that only whole pages follow.
Status OctreeBuilder::takeEqualKeys(SortedSurfelStream& stream, Pending& leaf) {
  SURFEIT_ASSIGN_OR_RETURN(const GroupPlace place,
                           writer_.beginLeaf(writer_.header().surfel_group_capacity));
  const CurveKey key = window_[at_].key;
  std::vector<glm::vec4> disks;
  while (at_ < window_.size() && window_[at_].key == key) {
    SURFEIT_RETURN_IF_ERROR(takeSurfels(1, disks, leaf));
    disks.clear();
    SURFEIT_RETURN_IF_ERROR(refill(stream));
  }
  Node& node = leaf.node.node;
  node = leaf.sums.toNode(writer_.header().flatness_limit);
  node.radius = radiusOfBox(node.position, leaf.sums.disk_bounds) * 1.000001f;
  node.page = place.page;
  node.first = place.first;
  return {};
}

Status OctreeBuilder::place(Pending node, int boundary_level) {
  // Close the cells that end here; each takes the node and becomes the node
  while (!cells_.empty() && cells_.back().level >= boundary_level) {
    OpenCell& cell = cells_.back();
    cell.children[static_cast<std::size_t>(cell.child_count++)] = std::move(node);
    SURFEIT_ASSIGN_OR_RETURN(node, closeCell(cell));
    cells_.pop_back();
  }
  // No more surfels: what is left is the root
  if (boundary_level == 0) {
    return writer_.addSiblings(0, std::span(&node.node, 1)).status();
  }
  // The node and the next one are children of one cell of the level above the boundary
  if (cells_.empty() || cells_.back().level < boundary_level - 1) {
    cells_.push_back({boundary_level - 1, 0, {}});
  }
  OpenCell& cell = cells_.back();
  cell.children[static_cast<std::size_t>(cell.child_count++)] = std::move(node);
  return {};
}

Result<OctreeBuilder::Pending> OctreeBuilder::closeCell(OpenCell& cell) {
  const std::span<const Pending> children =
      std::span(cell.children).first(static_cast<std::size_t>(cell.child_count));
  Pending parent;
  std::array<LevelNode, 8> siblings;
  for (std::size_t i = 0; i < children.size(); ++i) {
    parent.sums.add(children[i].sums);
    siblings[i] = children[i].node;
  }
  SURFEIT_ASSIGN_OR_RETURN(
      const GroupPlace place,
      writer_.addSiblings(cell.level + 1, std::span(siblings).first(children.size())));

  Node& node = parent.node.node;
  node = parent.sums.toNode(writer_.header().flatness_limit);
  for (const Pending& child : children) {
    const Node& below = child.node.node;
    node.radius = std::max(node.radius, reach(node.position, below.position, below.radius));
  }
  node.radius =
      std::min(node.radius, radiusOfBox(node.position, parent.sums.disk_bounds) * 1.000001f);
  node.page = place.page;
  node.first = place.first;
  node.child_count = static_cast<std::uint8_t>(children.size());
  parent.node.child_level = static_cast<std::uint8_t>(cell.level + 1);
  return parent;
}

}  // namespace surfeit
